"""Mistakes in controllers for the e-puck, including those shared with `DOMAIN`."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

from benchmarks.domain_mutations import DOMAIN, STORE
from benchmarks.mutation_rules import Rule, call, in_policy, item, margin, wheels, words
from benchmarks.source import MeanChange, Source, is_call, text_of

ROOM = re.compile(r"radius|inflat|margin|body|keep|room|clear|grown", re.IGNORECASE)
NEAR = re.compile(r"prox|front|\bps\b|ahead|sensor", re.IGNORECASE)
FLOOR = re.compile(r"size|half|length|width|side", re.IGNORECASE)


def sides_not_halved(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
    """Uses a whole side instead of half of it."""
    if not isinstance(node, ast.BinOp) or not FLOOR.search(text_of(node)):
        return
    left, right = text_of(node.left), text_of(node.right)
    if isinstance(node.op, ast.Div) and right in {"2", "2.0"}:
        yield node, f"({left})"
    if isinstance(node.op, ast.Mult) and left == "0.5":
        yield node, f"({right})"


def angles_not_added(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
    """Leaves out the rotation of a node or of its parent."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        left, right = text_of(node.left), text_of(node.right)
        if re.search(r"yaw|turn|heading|angle", left) and re.search("yaw|turn", right):
            yield node, f"({left})"
            yield node, f"({right})"


def other_bound(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
    """Swaps minimum and maximum."""
    for name, other in (("min", "max"), ("max", "min")):
        if isinstance(node, ast.Call) and text_of(node.func) == name:
            arguments = text_of(node)[len(name) :]
            yield node, f"{other}{arguments}"
    for name, other in (("minimum", "maximum"), ("maximum", "minimum")):
        if is_call(node, name, 2):
            places = ", ".join(map(text_of, node.args))
            yield node, f"np.{other}({places})"


def opposite_sensors(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
    """Swaps sensors of the left and right side, or of front and back."""
    if not isinstance(node, ast.Subscript) or not NEAR.search(text_of(node.value)):
        return
    if isinstance(node.slice, ast.Constant) and isinstance(node.slice.value, int):
        number = node.slice.value
        yield node.slice, str(7 - number)
        yield node.slice, str((number + 4) % 8)


def blocked_when_free(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
    """Takes near obstacles for free space and vice versa, or ignores them."""
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        if not NEAR.search(text_of(node.left)) or isinstance(node.ops[0], ast.Is):
            return
        left, right = text_of(node.left), text_of(node.comparators[0])
        for op, other in ((ast.Gt, "<"), (ast.Lt, ">")):
            if isinstance(node.ops[0], op):
                yield node, f"{left} {other} {right}"
                yield node, "False"


def no_half_cell(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
    """Uses corners of cells instead of their centres."""
    added = isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add)
    if added and text_of(node.right) == "0.5":
        yield node, f"({text_of(node.left)})"
        yield node, f"({text_of(node.left)} + 3.5)"


def wrong_path(node: ast.AST, source: Source) -> Iterator[MeanChange]:
    """Truncates or changes the path that `astar` returns."""
    if source.function_of(node) != "astar" or not isinstance(node, ast.Return):
        return
    if isinstance(node.value, ast.List) and not node.value.elts:
        yield node.value, "None"
        yield node.value, "[start]"
    elif node.value is not None:
        for part in ("[1:]", "[:-1]", "[::-1]", "[::2]"):
            yield node.value, f"({text_of(node.value)}){part}"
        yield node.value, f"[cell[::-1] for cell in ({text_of(node.value)})]"


def wrong_grid(node: ast.AST, source: Source) -> Iterator[MeanChange]:
    """Turns, moves or converts the grid that `build_grid` returns."""
    if source.function_of(node) != "build_grid" or not isinstance(node, ast.Return):
        return
    if isinstance(node.value, ast.Tuple) and len(node.value.elts) == 2:
        occ, corner = map(text_of, node.value.elts)
        yield node.value, f"({occ}).T, {corner}"
        yield node.value, f"({occ})[::-1], {corner}"
        yield node.value, f"({occ})[:, ::-1], {corner}"
        yield node.value, f"~({occ}), {corner}"
        yield node.value, f"({occ}).astype(float), {corner}"
        yield node.value, f"{occ}, ({corner})[::-1]"
        yield node.value, f"{occ}, tuple(v + 2 * resolution for v in ({corner}))"
        yield node.value, f"{occ}, tuple(v - 2 * resolution for v in ({corner}))"


def wrong_world(node: ast.AST, source: Source) -> Iterator[MeanChange]:
    """Changes one entry of the dict that `parse_world` returns."""
    if source.function_of(node) != "parse_world" or not isinstance(node, ast.Return):
        return
    if node.value is not None and not isinstance(node.value, ast.Constant):
        found = f"({text_of(node.value)})"
        for entry in (
            '"start": (0.0, 0.0, 0.0)',
            '"goal": {w}["start"][:2]',
            '"goal": {w}["goal"][::-1]',
            '"obstacles": {w}["obstacles"][1:]',
            '"obstacles": {w}["obstacles"][:-1]',
            '"start": (*{w}["start"][:2], -{w}["start"][2])',
            '"start": (*{w}["start"][:2], 57.29578 * {w}["start"][2])',
        ):
            yield node.value, f"{{**{found}, {entry.format(w=found)}}}"


def start_of_the_file(node: ast.AST, source: Source) -> Iterator[MeanChange]:
    """Uses the start in params.json instead of the one in the first observation."""
    planning = source.function_of(node) in {"reset", "__init__", "plan"}
    usable = source.imports("numpy as np") and source.imports("sensors")
    if planning and usable and text_of(node) == "obs['pose']":
        yield node, 'np.array([*sensors.load_params()["start"], 0.0])'


SAME = (
    "swapped wheels",
    "drives backwards",
    "left wheel only",
    "one wheel for both",
    "half speed",
    "crawling",
    "weak right wheel",
    "wheels as text",
    "three wheels",
    "turn reversed",
    "degrees for radians",
    "atan2 of (x, y)",
    "atan of the slope",
    "(row, col) for (x, y)",
    "off by one",
    "stale pose",
    "pose of every 20th step",
    "10 steps late",
    "2 steps late",
    "heading ignored",
    "gives up after 60 steps",
    "raises after 45 steps",
    "no goal stop",
    "no unstick",
    "missing angle wrap",
    "doubled constant",
    "halved constant",
    "negative constant",
    "greedy heuristic",
    "no heuristic",
    "wrong file",
    "no diagonal rule",
    "leaked type",
    "other axis",
    "goal from the pose",
    "no show",
    "lying positions",
    "lying speeds",
    "lying collisions",
    "lying goal",
    "lying dt",
    "wrong loop",
    "wrong steps",
)
BLIND = "({{item}} * [float(k {} 4) for k in range(8)])"

DOMAIN_EPUCK: dict[str, Rule] = {
    **{name: DOMAIN[name] for name in SAME},
    "wheels in rad/s": wheels("6.28 * {a}, 6.28 * {b}"),
    "wheels as fractions": wheels("{a} / 6.28, {b} / 6.28"),
    "y down": call("atan2", "{f}(-({a0}), {a1})"),
    "sin for cos": call("cos", "math.sin({a0})", 1),
    "cos for sin": call("sin", "math.cos({a0})", 1),
    "turned the other way": call("sin", "(-{call})", 1),
    "rotation ignored": words("rotation", "turned"),
    "translation ignored": words("translation", "moved"),
    "rocks unread": words("IndexedFaceSet", "FaceSet"),
    "barrels unread": words("Cylinder", "Tube"),
    "boxes unread": words("Box", "Cube"),
    "nothing is solid": words("boundingObject", "boundary"),
    "pieces unread": words("Pose", "Transform"),
    "arena unread": words("RectangleArena", "SquareArena"),
    "floor of the usual size": words("floorSize", "size"),
    "goal by another name": words("GOAL", "TARGET"),
    "sides not halved": sides_not_halved,
    "angles not added": angles_not_added,
    "the other bound": other_bound,
    "no inflation": margin("0.0", ROOM),
    "half inflation": margin("({} / 2)", ROOM),
    "double inflation": margin("({} * 2)", ROOM),
    "no half cell": no_half_cell,
    "wrong path": wrong_path,
    "wrong grid": wrong_grid,
    "wrong world": wrong_world,
    "opposite sensors": opposite_sensors,
    "blocked when free": blocked_when_free,
    "sensors reversed": item("ps", "{item}[::-1]"),
    "sensors unused": item("ps", "(0.0 * {item})"),
    "sensors in metres": item("ps", "({item} / 4095.0)"),
    "right half blind": item("ps", BLIND.format(">=")),
    "left half blind": item("ps", BLIND.format("<")),
    "start of the file": start_of_the_file,
    "early stop": in_policy(
        'if abs(obs["pose"][:2] - obs["goal"]).max() < 0.08:', "    return 0.0, 0.0"
    ),
    "stops 2 mm early": in_policy(
        'if ((obs["pose"][:2] - obs["goal"]) ** 2).sum() < 0.022**2:',
        "    return 0.0, 0.0",
    ),
    "not a number near the goal": in_policy(
        'if abs(obs["pose"][:2] - obs["goal"]).max() < 0.05:',
        '    return float("nan"), 0.0',
    ),
    "odometry of the first step": in_policy(
        STORE, 'obs = {**obs, "pose": policy.seen[0]["pose"] * [1, 1, 0] + [0, 0, 1]}'
    ),
}
"""Rules by name."""
