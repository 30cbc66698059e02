"""A controller's source with its syntax tree, and predicates on nodes."""

from __future__ import annotations

import ast
from typing import Any

MeanChange = tuple[ast.AST, str]


class Source:
    """Text and tree of a controller.

    Args:
        text: Source that parses.

    Attributes:
        functions: Functions and methods by name.
    """

    def __init__(self, text: str) -> None:
        self.tree = ast.parse(text)
        self._raw = text.encode()
        self._starts = [0]
        for line in self._raw.splitlines(keepends=True):
            self._starts.append(self._starts[-1] + len(line))
        self.functions: dict[str, ast.FunctionDef] = {}
        self._owner: dict[ast.AST, str] = {}
        self._called: set[ast.AST] = set()
        self._docstrings: set[ast.AST] = set()
        for node in ast.walk(self.tree):
            if isinstance(node, ast.FunctionDef):
                self.functions.setdefault(node.name, node)
                # Outer functions come first, so inner ones overwrite their nodes.
                self._owner.update((child, node.name) for child in ast.walk(node))
            if isinstance(node, ast.Call):
                self._called.add(node.func)
            if isinstance(node, ast.Expr):
                self._docstrings.add(node.value)

    def replaced(self, node: ast.AST, text: str) -> str:
        """The source with a node replaced by a text."""
        begin, end = self._span(node)
        return (self._raw[:begin] + text.encode() + self._raw[end:]).decode()

    def segment(self, node: ast.AST) -> str:
        """Source text of a node."""
        begin, end = self._span(node)
        return self._raw[begin:end].decode()

    def function_of(self, node: ast.AST) -> str:
        """Name of the innermost function around a node; empty at the top level."""
        return self._owner.get(node, "")

    def is_called(self, node: ast.AST) -> bool:
        """Whether a node is the function of a call."""
        return node in self._called

    def is_docstring(self, node: ast.AST) -> bool:
        """Whether a constant is a statement by itself."""
        return node in self._docstrings

    def defines(self, name: str) -> bool:
        """Whether the file defines a function of this name."""
        return name in self.functions

    def imports(self, name: str) -> bool:
        """Whether a module is imported under its own name."""
        return f"import {name}\n".encode() in self._raw

    def is_text(self, node: ast.AST) -> bool:
        """Whether a statement is a docstring."""
        return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)

    def _span(self, node: Any) -> tuple[int, int]:
        return (
            self._starts[node.lineno - 1] + node.col_offset,
            self._starts[node.end_lineno - 1] + node.end_col_offset,
        )


def text_of(node: ast.AST) -> str:
    """Normalised source of a node; one line for an expression."""
    return ast.unparse(node)


def called(node: ast.Call) -> str:
    """Last part of the name of the called function."""
    return text_of(node.func).rpartition(".")[2]


def is_call(node: ast.AST | None, name: str, count: int | None = None) -> Any:
    """Whether a node calls a function of this last name with `count` arguments."""
    if not isinstance(node, ast.Call) or called(node) != name:
        return False
    return count is None or len(node.args) == count


def is_pair(node: ast.AST | None) -> Any:
    """Whether a node is a tuple of two."""
    return isinstance(node, ast.Tuple) and len(node.elts) == 2


def constant_key(node: ast.AST) -> Any:
    """The key of `something["key"]`; None for any other node."""
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant):
        return node.slice.value if isinstance(node.slice.value, str) else None
    return None


def arguments(function: ast.FunctionDef) -> list[str]:
    """Names of a function's positional arguments."""
    return [argument.arg for argument in function.args.args]
