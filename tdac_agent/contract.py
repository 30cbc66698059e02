"""What a controller file may and must contain, read from its syntax tree."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator

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
CONSTANTS_2D = (
    "MAP_IMG",
    "PARAMS_JSON",
    "ROBOT_IMG",
    "AXLE_LENGTH_PX",
    "SENSOR_RANGE_PX",
    "SENSOR_FOV_DEG",
    "N_RAYS",
    "LOOKAHEAD",
    "STOP_DIST",
    "SLOW_DIST",
)
FORBIDDEN_CALLS = frozenset(
    ["eval", "exec", "compile", "__import__", "breakpoint", "input", "globals", "vars"]
)
SEEDED_CONSTRUCTORS = frozenset({"Random", "default_rng", "Generator", "SeedSequence"})
MAX_SOURCE_BYTES = 200_000


def top_level_names(tree: ast.Module) -> dict[str, ast.stmt]:
    """Names that the module's top level binds, with the statement that does."""
    names: dict[str, ast.stmt] = {}
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names[node.name] = node
        elif isinstance(node, ast.Assign):
            for target in node.targets:
                names.update((name, node) for name in _target_names(target))
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            names.update((name, node) for name in _target_names(node.target))
    return names


def _target_names(target: ast.expr) -> list[str]:
    if isinstance(target, ast.Name):
        return [target.id]
    if isinstance(target, ast.Tuple | ast.List):
        return [name for item in target.elts for name in _target_names(item)]
    return []


def import_problems(tree: ast.Module) -> list[str]:
    """Imports of modules that are not allowed, or anywhere but at the top."""
    top = set(tree.body)
    problems = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            modules = [("." * node.level) + (node.module or "")]
        else:
            continue
        for module in modules:
            allowed = module.split(".")[0] in ALLOWED_IMPORTS
            problems += [] if allowed else [f"line {node.lineno}: import of {module!r}"]
        if node not in top:
            problems.append(f"line {node.lineno}: import not at the top level")
    return problems


def forbidden_calls(tree: ast.Module) -> Iterator[str]:
    """Calls and names that run or reach code a reader cannot see."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id in FORBIDDEN_CALLS | {"__builtins__"}:
            yield f"line {node.lineno}: {node.id}"
        elif isinstance(node, ast.Attribute) and _is_private_dunder(node.attr):
            yield f"line {node.lineno}: .{node.attr}"


def _is_private_dunder(name: str) -> bool:
    return name in {
        "__globals__",
        "__builtins__",
        "__subclasses__",
        "__code__",
        "__bases__",
        "__mro__",
        "__loader__",
        "__spec__",
        "__import__",
    }


def file_writes(tree: ast.Module) -> Iterator[str]:
    """Calls of `open` that may write, and NumPy functions that save."""
    for node in _calls(tree):
        name = _call_name(node)
        if name == "open" and not _reads_only(node):
            yield f"line {node.lineno}: open() for writing"
        if name in {"save", "savez", "savez_compressed", "savetxt", "tofile", "memmap"}:
            yield f"line {node.lineno}: {name}()"


def _reads_only(call: ast.Call) -> bool:
    mode: ast.expr | None = call.args[1] if len(call.args) > 1 else None
    for keyword in call.keywords:
        if keyword.arg == "mode":
            mode = keyword.value
    if mode is None:
        return True
    return isinstance(mode, ast.Constant) and mode.value in {"r", "rt", "rb"}


def sleeps(tree: ast.Module) -> Iterator[str]:
    """Calls of `sleep`."""
    for node in _calls(tree):
        if _call_name(node) == "sleep":
            yield f"line {node.lineno}: sleep()"
    for statement in ast.walk(tree):
        if isinstance(statement, ast.ImportFrom) and statement.module == "time":
            names = {alias.name for alias in statement.names}
            yield from (f"line {statement.lineno}: import of sleep",) * (
                "sleep" in names
            )


def swallowed_errors(tree: ast.Module) -> Iterator[str]:
    """Bare `except`, and handlers that do nothing."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.ExceptHandler):
            continue
        if node.type is None:
            yield f"line {node.lineno}: bare except"
        elif isinstance(node.type, ast.Name) and node.type.id == "BaseException":
            yield f"line {node.lineno}: except BaseException"
        elif all(_does_nothing(statement) for statement in node.body):
            yield f"line {node.lineno}: except that only passes"


def _does_nothing(node: ast.stmt) -> bool:
    return isinstance(node, ast.Pass | ast.Continue) or (
        isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    )


def runtime_errors(tree: ast.Module) -> Iterator[str]:
    """`raise RuntimeError`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and node.exc is not None:
            raised = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
            if isinstance(raised, ast.Name) and raised.id == "RuntimeError":
                yield f"line {node.lineno}: raise RuntimeError"


def surface_indexing(tree: ast.Module) -> Iterator[str]:
    """Subscripts of a drawing surface, which is not an array."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript):
            name = _last_name(node.value)
            if name in {"surface", "screen", "window", "map_img", "display"}:
                yield f"line {node.lineno}: {name}[...]"


def unseeded_randomness(tree: ast.Module) -> Iterator[str]:
    """Random numbers that differ from run to run."""
    modules = _random_modules(tree)
    for node in _calls(tree):
        function = node.func
        seeded = bool(node.args or node.keywords)
        if isinstance(function, ast.Attribute):
            owner = ast.unparse(function.value)
            if owner not in modules:
                continue
            name = function.attr
        elif isinstance(function, ast.Name) and function.id in modules:
            name = function.id
        else:
            continue
        if name in SEEDED_CONSTRUCTORS and seeded:
            continue
        if name == "seed" and seeded:
            continue
        yield f"line {node.lineno}: {ast.unparse(function)}()"


def _random_modules(tree: ast.Module) -> set[str]:
    """How this file spells the modules (and functions) that draw random numbers."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                spelled = alias.asname or alias.name
                if alias.name in {"random", "numpy.random"}:
                    names.add(spelled)
                if alias.name == "numpy":
                    names.add(f"{spelled}.random")
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                spelled = alias.asname or alias.name
                if node.module in {"random", "numpy.random"}:
                    names.add(spelled)
                if node.module == "numpy" and alias.name == "random":
                    names.add(spelled)
    return names


def calls_in(node: ast.AST) -> set[str]:
    """Last names of everything called inside a node."""
    return {_call_name(call) for call in _calls(node)}


def has_main_guard(tree: ast.Module) -> bool:
    """Whether the file ends in `if __name__ == "__main__": main()`."""
    for node in tree.body:
        if isinstance(node, ast.If) and "__name__" in ast.unparse(node.test):
            return "main" in calls_in(node)
    return False


def positional_arity(function: ast.FunctionDef) -> tuple[int, int]:
    """Least and most positional arguments a function takes."""
    arguments = function.args
    total = len(arguments.posonlyargs) + len(arguments.args)
    return total - len(arguments.defaults), 99 if arguments.vararg else total


def _calls(node: ast.AST) -> Iterator[ast.Call]:
    return (child for child in ast.walk(node) if isinstance(child, ast.Call))


def _call_name(call: ast.Call) -> str:
    return _last_name(call.func)


def _last_name(node: ast.expr) -> str:
    if isinstance(node, ast.Name):
        return node.id
    return node.attr if isinstance(node, ast.Attribute) else ""


HYGIENE: dict[str, Callable[[ast.Module], Iterator[str]]] = {
    "forbidden_calls": forbidden_calls,
    "file_writes": file_writes,
    "sleeps": sleeps,
    "swallowed_errors": swallowed_errors,
    "runtime_errors": runtime_errors,
    "surface_indexing": surface_indexing,
    "unseeded_randomness": unseeded_randomness,
}
"""The unstable patterns, each by name."""
