"""Typical mistakes in controllers, by people and models, as syntax tree mutations.

Each rule examines one node and yields (node, new text) for every possible change. It
matches names and expressions, so it applies to controllers of any style.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

from benchmarks.lies import LIES
from benchmarks.mutation_rules import (
    Rule,
    call,
    constant,
    heuristic,
    in_policy,
    item,
    margin,
    never,
    wheels,
)
from benchmarks.source import (
    MeanChange,
    Source,
    arguments,
    called,
    constant_key,
    is_call,
    is_pair,
    text_of,
)

TURN = re.compile(r"^(err|error|turn|omega|steer|delta|bearing_error|diff|rotation)")
STUCK = re.compile(r"stuck|escape|recover|blocked|progress|patience", re.IGNORECASE)
WRAP = re.compile(r"wrap|norm|angle|remainder")
GOAL = re.compile(r"goal|toleran|arriv|reached|done|stop", re.IGNORECASE)


def turn_reversed(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
    if isinstance(node, ast.Assign) and TURN.match(text_of(node.targets[0])):
        yield node.value, f"-({text_of(node.value)})"


def rows_for_columns(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
    if isinstance(node, ast.Subscript) and is_pair(node.slice):
        a, b = node.slice.elts
        plain = not isinstance(a, ast.Slice) and not isinstance(b, ast.Slice)
        if plain and not is_call(a, "newaxis"):
            yield node.slice, f"{text_of(b)}, {text_of(a)}"
    shape = isinstance(node, ast.Assign) and text_of(node.value).endswith(".shape")
    if shape and is_pair(node.targets[0]):
        a, b = node.targets[0].elts
        yield node.targets[0], f"{text_of(b)}, {text_of(a)}"


def off_by_one(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
    for name in ("round", "floor", "ceil", "int"):
        if is_call(node, name, 1):
            yield node, f"({text_of(node)} + 1)"
            yield node, f"({text_of(node)} - 1)"
    if isinstance(node, ast.Call) and called(node) == "range":
        *head, last = (text_of(a) for a in node.args[:2])
        rest = [text_of(a) for a in node.args[2:]]
        yield node, f"range({', '.join([*head, f'({last}) - 1', *rest])})"


def sensor_side(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
    if not isinstance(node, ast.Subscript) or not isinstance(node.slice, ast.Slice):
        return
    part, owner = node.slice, text_of(node.value)
    if re.search(r"range|scan|ray", owner) and not part.step:
        lower, upper = (text_of(x) if x else "" for x in (part.lower, part.upper))
        yield node, f"{owner}[{upper}:{lower}]"
        yield node, f"{owner}[::-1][{lower}:{upper}]"


def no_wrap(node: ast.AST, source: Source) -> Iterator[MeanChange]:
    if is_call(node, "remainder", 2):
        yield node, f"({text_of(node.args[0])})"
    elif isinstance(node, ast.Call) and len(node.args) == 1:
        own = source.defines(called(node))
        if own and WRAP.search(called(node)):
            yield node, f"({text_of(node.args[0])})"
    modulo = isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mod)
    if modulo and re.search(r"pi|tau", text_of(node.right)):
        yield node, f"({text_of(node.left)})"


def wrong_file(node: ast.AST, source: Source) -> Iterator[MeanChange]:
    if node in source.tree.body and isinstance(node, ast.Assign):
        value = node.value
        if isinstance(value, ast.Constant) and isinstance(value.value, str):
            yield value, '"map.jpg"'


def no_diagonal_rule(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
    if isinstance(node, ast.BoolOp):
        text = text_of(node)
        calls = [n for n in ast.walk(node) if isinstance(n, ast.Call)]
        if re.search(r"\bd[xyij]\b", text) and (calls or "[" in text):
            yield node, "False"
            yield node, "True"
        if isinstance(node.op, ast.Or) and len(calls) == len(node.values) == 2:
            for side in node.values:
                yield node, f"({text_of(side)})"


def leaked_type(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
    for name in ("bool", "int", "float"):
        if is_call(node, name, 1):
            yield node, f"({text_of(node.args[0])})"


def wrong_nearest(node: ast.AST, source: Source) -> Iterator[MeanChange]:
    if source.function_of(node) != "nearest_free":
        return
    if is_call(node, "hypot", 2):
        a, b = (text_of(x) for x in node.args)
        yield node, f"max(abs({a}), abs({b}))"
        yield node, f"(abs({a}) + abs({b}))"
    read = isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)
    if read and re.match(r"max_r|limit|reach", node.id):
        yield node, f"({node.id} + 1)"
        yield node, f"({node.id} - 1)"
    if isinstance(node, ast.Raise):
        names = arguments(source.functions["nearest_free"])
        yield node, f"return int({names[1]}), int({names[2]})"
        yield node, 'raise KeyError("none")'


def wrong_path(node: ast.AST, source: Source) -> Iterator[MeanChange]:
    if source.function_of(node) != "plan_path" or not isinstance(node, ast.Return):
        return
    if isinstance(node.value, ast.List) and not node.value.elts:
        yield node.value, "None"
        yield node.value, "[start]"
    elif node.value is not None and not isinstance(node.value, ast.List):
        for part in ("[1:]", "[:-1]", "[::-1]", "[::2]"):
            yield node.value, f"({text_of(node.value)}){part}"
        yield node.value, f"tuple({text_of(node.value)})"


def other_axis(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant):
        axis = node.slice.value
        if constant_key(node.value) in {"goal", "pose"} and axis in {0, 1}:
            yield node.slice, str(1 - axis)


def start_of_the_file(node: ast.AST, source: Source) -> Iterator[MeanChange]:
    planning = source.function_of(node) in {"reset", "__init__", "plan"}
    if planning and constant_key(node) == "pose" and source.imports("sensors"):
        yield node, '(*sensors.load_params("params.json")["start"], 0.0)'


def no_show(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
    if isinstance(node, ast.Call) and called(node) == "show":
        yield node, "policy"
    if isinstance(node, ast.If) and "__name__" in text_of(node.test):
        yield node, 'MODE = "library"'


BLIND = "({{item}} + [220.0 * (2 * k {} len({{item}})) for k in range(len({{item}}))])"
STORE = "policy.seen = getattr(policy, 'seen', []) + [obs]"

DOMAIN: dict[str, Rule] = {
    "swapped wheels": wheels("{b}, {a}"),
    "drives backwards": wheels("-{a}, -{b}"),
    "left wheel only": wheels("{a}, 0.0"),
    "one wheel for both": wheels("{a}, {a}"),
    "half speed": wheels("0.5 * {a}, 0.5 * {b}"),
    "crawling": wheels("0.05 * {a}, 0.05 * {b}"),
    "weak right wheel": wheels("{a}, 0.6 * {b}"),
    "wheel speeds in px/s": wheels("75.59 * {a}, 75.59 * {b}"),
    "wheels as text": wheels("str({a}), str({b})"),
    "three wheels": wheels("{a}, {b}, 0.0"),
    "turn reversed": turn_reversed,
    "degrees for radians": call("atan2", "math.degrees({call})"),
    "radians left out": call("radians", "({a0})", 1),
    "y up": call("atan2", "{f}(-({a0}), {a1})"),
    "atan2 of (x, y)": call("atan2", "{f}({a1}, {a0})"),
    "atan of the slope": call("atan2", "math.atan(({a0}) / (({a1}) or 1e-9))"),
    "(row, col) for (x, y)": rows_for_columns,
    "is_occupied(y, x)": call("is_occupied", "{f}({a1}, {a0})"),
    "one pixel off": call("is_occupied", "{f}({a0} + 1, {a1})"),
    "map transposed": call("load_occupancy", "{call}.T", 1),
    "map upside down": call("load_occupancy", "{call}[::-1]", 1),
    "map mirrored": call("load_occupancy", "{call}[:, ::-1]", 1),
    "map inverted": call("load_occupancy", "~{call}", 1),
    "map ignored": call("load_occupancy", "({call} & False)", 1),
    "no inflation": margin("0.0"),
    "half inflation": margin("({} / 2)"),
    "double inflation": margin("({} * 2)"),
    "no goal stop": never(GOAL, returns=True),
    "early stop": in_policy(
        'if abs(obs["pose"][:2] - obs["goal"]).max() < 40.0:', "    return 0.0, 0.0"
    ),
    "stops 2 px early": in_policy(
        'if ((obs["pose"][:2] - obs["goal"]) ** 2).sum() < 22.0**2:',
        "    return 0.0, 0.0",
    ),
    "off by one": off_by_one,
    "obstacle side ignored": sensor_side,
    "wrong sensor side": item("ranges", "{item}[::-1]"),
    "ranges unused": item("ranges", "(0.0 * {item} + 220.0)"),
    "ranges in metres": item("ranges", "({item} / 3779.52)"),
    "left half blind": item("ranges", BLIND.format("<")),
    "right half blind": item("ranges", BLIND.format(">=")),
    "stale pose": in_policy(
        STORE,
        'obs = {**obs, "pose": policy.seen[0]["pose"]}',
    ),
    "pose of every 20th step": in_policy(
        STORE,
        "past = policy.seen[(len(policy.seen) - 1) // 20 * 20]",
        'obs = {**obs, "pose": past["pose"]}',
    ),
    "10 steps late": in_policy(STORE, "obs = policy.seen[-10:][0]"),
    "2 steps late": in_policy(STORE, "obs = policy.seen[-2:][0]"),
    "heading ignored": in_policy('obs = {**obs, "pose": obs["pose"] * [1, 1, 0]}'),
    "gives up after 60 steps": in_policy(
        STORE, "if len(policy.seen) > 60:", "    return 0.0, 0.0"
    ),
    "raises after 45 steps": in_policy(
        STORE, "if len(policy.seen) > 45:", "    return policy.seen[len(policy.seen)]"
    ),
    "not a number near the goal": in_policy(
        'if abs(obs["pose"][:2] - obs["goal"]).max() < 30.0:',
        '    return float("nan"), 0.0',
    ),
    "no unstick": never(STUCK),
    "missing angle wrap": no_wrap,
    "doubled constant": constant("2 * {}"),
    "halved constant": constant("{} / 2"),
    "constant off by one": constant("{} + 1"),
    "negative constant": constant("-{}"),
    "zero constant": constant("0 * {}"),
    "greedy heuristic": heuristic("5 * {}"),
    "no heuristic": heuristic("0 * {}"),
    "wrong file": wrong_file,
    "no diagonal rule": no_diagonal_rule,
    "leaked type": leaked_type,
    "wrong nearest": wrong_nearest,
    "wrong path": wrong_path,
    "other axis": other_axis,
    "goal from the pose": item("goal", '{owner}["pose"]'),
    "start of the file": start_of_the_file,
    "no show": no_show,
    **LIES,
}
"""Rules by name."""
