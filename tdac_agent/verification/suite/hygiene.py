"""Unstable patterns in a controller's source, found by name and line."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator

from tdac_agent.verification.suite.contract import (
    call_name,
    calls,
    imports_in,
    last_name,
    nodes_of,
)

FORBIDDEN_CALLS = frozenset(
    ["eval", "exec", "compile", "__import__", "breakpoint", "input", "globals", "vars"]
)
FORBIDDEN_ATTRIBUTES = frozenset(
    [
        *("__globals__", "__builtins__", "__subclasses__", "__code__", "__bases__"),
        *("__mro__", "__loader__", "__spec__", "__import__"),
    ]
)
SEEDED = frozenset({"Random", "default_rng", "Generator", "SeedSequence", "seed"})
"""Functions that are allowed with a seed."""
SAVERS = frozenset(
    [
        *("save", "savez", "savez_compressed", "savetxt", "tofile", "memmap"),
        *("dump", "open_memmap", "write_text", "write_bytes"),
    ]
)
# Longer names are not modules of random numbers, and may be expensive to build.
MOST_DOTS = 3
SURFACES = frozenset({"surface", "screen", "window", "map_img", "display"})


def forbidden_calls(tree: ast.Module) -> Iterator[str]:
    """Finds names that run code or give access to the interpreter."""
    for node in nodes_of(tree):
        if (
            isinstance(node, ast.Name)
            and node.id in FORBIDDEN_CALLS | FORBIDDEN_ATTRIBUTES
        ):
            yield f"line {node.lineno}: {node.id}"
        elif isinstance(node, ast.Attribute) and node.attr in FORBIDDEN_ATTRIBUTES:
            yield f"line {node.lineno}: .{node.attr}"


def file_writes(tree: ast.Module) -> Iterator[str]:
    """Finds calls of `open` that may write, and functions that save files."""
    for node in calls(tree):
        name = call_name(node)
        if name == "open" and not _reads_only(node):
            yield f"line {node.lineno}: open() for writing"
        if name in SAVERS:
            yield f"line {node.lineno}: {name}()"
    called = {node.func for node in calls(tree)}
    for other in nodes_of(tree):
        if isinstance(other, ast.Name) and other.id == "open" and other not in called:
            yield f"line {other.lineno}: open under another name"


def _reads_only(call: ast.Call) -> bool:
    # The first argument of `path.open(mode)` is the mode.
    place = 1 if isinstance(call.func, ast.Name) else 0
    modes = call.args[place : place + 1]
    modes += [each.value for each in call.keywords if each.arg in ("mode", None)]
    return all(getattr(mode, "value", None) in ("r", "rt", "rb") for mode in modes[-1:])


def sleeps(tree: ast.Module) -> Iterator[str]:
    """Finds calls and imports of `sleep`."""
    for node in calls(tree):
        if call_name(node) == "sleep":
            yield f"line {node.lineno}: sleep()"
    for each in imports_in(tree):
        if (each.module, each.name) == ("time", "sleep"):
            yield f"line {each.line}: import of sleep"


def swallowed_errors(tree: ast.Module) -> Iterator[str]:
    """Finds `except` clauses that catch everything or do nothing."""
    for node in nodes_of(tree):
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
    """Finds `raise RuntimeError`."""
    for node in nodes_of(tree):
        if isinstance(node, ast.Raise) and node.exc is not None:
            raised = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
            if isinstance(raised, ast.Name) and raised.id == "RuntimeError":
                yield f"line {node.lineno}: raise RuntimeError"


def surface_indexing(tree: ast.Module) -> Iterator[str]:
    """Finds subscripts of drawing surfaces, which are not arrays."""
    for node in nodes_of(tree):
        if isinstance(node, ast.Subscript) and last_name(node.value) in SURFACES:
            yield f"line {node.lineno}: {last_name(node.value)}[...]"


def unseeded_randomness(tree: ast.Module) -> Iterator[str]:
    """Finds random numbers without a seed."""
    modules = _random_modules(tree)
    for node in calls(tree):
        function = node.func
        if isinstance(function, ast.Attribute):
            if _spelled(function.value) not in modules:
                continue
            name = function.attr
        elif isinstance(function, ast.Name) and function.id in modules:
            name = function.id
        else:
            continue
        seeds = [*node.args, *(keyword.value for keyword in node.keywords)]
        nones = [isinstance(s, ast.Constant) and s.value is None for s in seeds]
        if name not in SEEDED or all(nones):
            yield f"line {node.lineno}: {_spelled(function)}()"


def _spelled(node: ast.expr) -> str:
    """Returns a name with up to three dots, such as `np.random`; otherwise ''."""
    names: list[str] = []
    while isinstance(node, ast.Attribute) and len(names) < MOST_DOTS:
        names.append(node.attr)
        node = node.value
    if not isinstance(node, ast.Name):
        return ""
    return ".".join([node.id, *reversed(names)])


def _random_modules(tree: ast.Module) -> set[str]:
    """Returns the names of random number modules and functions in this file."""
    names = set()
    for each in imports_in(tree):
        numpy_random = (each.module, each.name) == ("numpy", "random")
        if each.module in {"random", "numpy.random"} or numpy_random:
            names.add(each.known_as)
        elif (each.module, each.name) == ("numpy", ""):
            names.add(f"{each.known_as}.random")
    return names


HYGIENE: dict[str, Callable[[ast.Module], Iterator[str]]] = {
    "forbidden_calls": forbidden_calls,
    "file_writes": file_writes,
    "sleeps": sleeps,
    "swallowed_errors": swallowed_errors,
    "runtime_errors": runtime_errors,
    "surface_indexing": surface_indexing,
    "unseeded_randomness": unseeded_randomness,
}
"""Finders of unstable patterns, by name."""


def hygiene_error(tree: ast.Module, pattern: str) -> str | None:
    """Names the lines with an unstable pattern; None without one."""
    uses = list(HYGIENE[pattern](tree))
    return f"{pattern.replace('_', ' ')}: {'; '.join(uses[:8])}" if uses else None
