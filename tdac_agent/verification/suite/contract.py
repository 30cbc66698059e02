"""Imports and definitions of a controller file, read from its syntax tree."""

from __future__ import annotations

import ast
import functools
import warnings
from collections.abc import Collection, Iterator
from importlib.util import decode_source
from typing import NamedTuple

ALLOWED_IMPORTS = frozenset(
    [
        "math",
        "heapq",
        "json",
        "re",
        "collections",
        "itertools",
        "functools",
        "dataclasses",
        "typing",
        "bisect",
        "random",
        "time",
        "numpy",
        "sensors",
        "__future__",
    ]
)
# Modules that allowed modules import, and that can be reached through them.
_HIDDEN_MODULES = frozenset(
    [
        *("builtins", "codecs", "ctypes", "ctypeslib", "f2py", "gc", "importlib"),
        *("inspect", "io", "os", "pathlib", "pickle", "posix", "shutil", "signal"),
        *("socket", "subprocess", "sys", "threading"),
    ]
)
MAX_SOURCE_BYTES = 200_000


class ParseError(ValueError):
    """A source is too large or does not parse; the message says why."""


def parse_source(source: bytes) -> ast.Module:
    """Returns the syntax tree, in the encoding that the file declares, as Python does.

    Raises:
        ParseError: There is none.
    """
    size = len(source)
    if size > MAX_SOURCE_BYTES:
        limit = f"at most {MAX_SOURCE_BYTES} are allowed"
        raise ParseError(f"the source has {size} bytes, {limit}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)
            return ast.parse(decode_source(source))
    except SyntaxError as error:
        line = f" (line {error.lineno})" if error.lineno else ""
        reason = f"{error.msg}{line}"
    except (ValueError, RecursionError, MemoryError) as error:
        reason = str(error) or type(error).__name__
    raise ParseError(f"the source does not parse: {reason}")


def time_step(dt: float) -> int | float:
    """Returns the constant `TIME_STEP`: `dt` (s) in ms, as an int if it is whole."""
    milliseconds = round(1e3 * dt, 6)
    return int(milliseconds) if milliseconds.is_integer() else milliseconds


def top_level_names(tree: ast.Module) -> dict[str, ast.stmt]:
    """Returns the names that importing the module binds, with their statements."""
    return dict(_bindings(tree.body))


def _bindings(body: list[ast.stmt]) -> Iterator[tuple[str, ast.stmt]]:
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name, node
        elif isinstance(node, ast.Import | ast.ImportFrom):
            for alias in node.names:
                yield alias.asname or alias.name.partition(".")[0], node
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            # An annotation without a value binds nothing.
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            for target in targets if node.value is not None else ():
                yield from ((name, node) for name in _target_names(target))
        else:
            for block in ("body", "orelse", "finalbody"):
                yield from _bindings(getattr(node, block, []))


def _target_names(target: ast.expr) -> list[str]:
    if isinstance(target, ast.Name):
        return [target.id]
    if isinstance(target, ast.Starred):
        return _target_names(target.value)
    if isinstance(target, ast.Tuple | ast.List):
        return [name for item in target.elts for name in _target_names(item)]
    return []


def import_error(tree: ast.Module, without: Collection[str] = ()) -> str | None:
    """Says which imports are not allowed, and what is; None if all of them are.

    Args:
        tree: The source.
        without: Modules that are not there in this case.
    """
    problems = import_problems(tree)
    allowed = " ".join(sorted(ALLOWED_IMPORTS - {"__future__", *without}))
    return f"{'; '.join(problems)}; allowed modules: {allowed}" if problems else None


def reads_clock(tree: ast.Module) -> bool:
    """Whether a source imports `time`, the one allowed module that knows it."""
    return any(each.module == "time" for each in imports_in(tree))


class Imported(NamedTuple):
    """What one name of an import statement is.

    Attributes:
        line: Line of the statement.
        module: Name of the module.
        name: Name of what is imported from it; empty for the module itself.
        known_as: Its name in the file.
    """

    line: int
    module: str
    name: str
    known_as: str


def imports_in(tree: ast.Module) -> Iterator[Imported]:
    """Yields what is imported anywhere in a source."""
    for node in nodes_of(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            for alias in node.names:
                known_as = alias.asname or alias.name
                if isinstance(node, ast.Import):
                    yield Imported(node.lineno, alias.name, "", known_as)
                else:
                    yield Imported(node.lineno, node.module or "", alias.name, known_as)


def policy_error(tree: ast.Module) -> str | None:
    """Says why `policy` is not a plain function of one observation; None if it is."""
    function = top_level_names(tree).get("policy")
    if not isinstance(function, ast.FunctionDef):
        return "no `def policy(obs)` at the top level"
    least, most = positional_arity(function)
    taken = str(least) if least == most else f"{least} to {most}"
    return None if least <= 1 <= most else f"policy takes {taken} arguments, not 1"


def import_problems(tree: ast.Module) -> list[str]:
    """Describes imports that are not allowed or not at the top level."""
    top = set(tree.body)
    problems = []
    for node in nodes_of(tree):
        if isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            modules = [("." * node.level) + (node.module or "")]
        else:
            continue
        for module in modules:
            first, *rest = module.split(".")
            if first not in ALLOWED_IMPORTS or any(map(_is_hidden, rest)):
                problems.append(f"line {node.lineno}: import of {module!r}")
            elif isinstance(node, ast.ImportFrom):
                names = [alias.name for alias in node.names if _is_hidden(alias.name)]
                problems += [
                    f"line {node.lineno}: import of {name!r} from {module!r}"
                    for name in names
                ]
        if node not in top:
            problems.append(f"line {node.lineno}: import not at the top level")
    return [*problems, *_reached_modules(tree)]


def _is_hidden(name: str) -> bool:
    return name.lstrip("_") in _HIDDEN_MODULES


def _reached_modules(tree: ast.Module) -> Iterator[str]:
    """Describes uses of a module through an imported one, such as `random._os`."""
    imports = [n for n in nodes_of(tree) if isinstance(n, ast.Import | ast.ImportFrom)]
    bound = {name for name, _ in _bindings([*imports])}
    inner: set[ast.expr] = set()
    for node in nodes_of(tree):  # the longest dotted name comes first
        if isinstance(node, ast.Attribute) and node not in inner:
            root, hidden = _root_and_hidden(node, inner)
            if hidden is not None and isinstance(root, ast.Name) and root.id in bound:
                between = "." if hidden.value is root else "…"
                yield f"line {node.lineno}: use of {root.id}{between}{hidden.attr}"


def _root_and_hidden(
    node: ast.Attribute, inner: set[ast.expr]
) -> tuple[ast.expr, ast.Attribute | None]:
    """Returns the root and first hidden module of a name; adds its parts to `inner`."""
    root: ast.expr = node
    hidden = None
    while isinstance(root, ast.Attribute):
        if _is_hidden(root.attr):
            hidden = root
        inner.add(root)
        root = root.value
    return root, hidden


def calls_in(*nodes: ast.AST) -> set[str]:
    """Returns the last names of everything called inside some nodes."""
    return {call_name(call) for node in nodes for call in calls(node)}


def has_main_guard(tree: ast.Module) -> bool:
    """Whether the file has an `if __name__ == "__main__": main()`."""
    return any(
        isinstance(node, ast.If)
        and _is_main_test(node.test)
        and "main" in calls_in(*node.body)
        for node in tree.body
    )


def _is_main_test(test: ast.expr) -> bool:
    if not (isinstance(test, ast.Compare) and isinstance(test.ops[0], ast.Eq)):
        return False
    sides = [test.left, *test.comparators]
    names = [side.id for side in sides if isinstance(side, ast.Name)]
    values = [side.value for side in sides if isinstance(side, ast.Constant)]
    return len(sides) == 2 and names == ["__name__"] and values == ["__main__"]


def positional_arity(function: ast.FunctionDef) -> tuple[int, int]:
    """Returns the least and greatest number of positional arguments."""
    arguments = function.args
    total = len(arguments.posonlyargs) + len(arguments.args)
    return total - len(arguments.defaults), 99 if arguments.vararg else total


@functools.lru_cache(maxsize=8)
def nodes_of(node: ast.AST) -> tuple[ast.AST, ...]:
    """Returns a node and all nodes below it, in the order of `ast.walk`, but faster."""
    nodes = [node]
    for parent in nodes:  # the list grows meanwhile
        for value in parent.__dict__.values():
            if isinstance(value, ast.AST):
                nodes.append(value)
            elif type(value) is list:
                nodes += [item for item in value if isinstance(item, ast.AST)]
    return tuple(nodes)


def calls(node: ast.AST) -> Iterator[ast.Call]:
    """Yields every call inside a node."""
    return (child for child in nodes_of(node) if isinstance(child, ast.Call))


def call_name(call: ast.Call) -> str:
    """Returns the last name of the called function: `sleep` for `time.sleep(1)`."""
    return last_name(call.func)


def last_name(node: ast.expr) -> str:
    """Returns the name, or the name of the attribute; otherwise an empty string."""
    if isinstance(node, ast.Name):
        return node.id
    return node.attr if isinstance(node, ast.Attribute) else ""
