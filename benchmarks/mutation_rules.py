"""Factories of mutation rules; each takes the form of the replacement text.

A rule examines one node and yields (node, new text) for every possible change.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator

from benchmarks.source import (
    MeanChange,
    Source,
    constant_key,
    is_call,
    is_pair,
    text_of,
)

Rule = Callable[[ast.AST, Source], Iterator[MeanChange]]

WHEELS = re.compile(r"left|right|turn|speed|forward|wheel|omega|steer|spin")
BODY = re.compile(r"radius|inflat|margin|clearance|padding|safety", re.IGNORECASE)


def _wheel_pairs(node: ast.AST) -> Iterator[tuple[ast.Tuple, str, str]]:
    value = node.value if isinstance(node, ast.Return) else None
    if is_pair(value) and WHEELS.search(text_of(value)):
        yield value, text_of(value.elts[0]), text_of(value.elts[1])


def wheels(form: str) -> Rule:
    """Changes returned wheel speeds `{a}, {b}`."""

    def rule(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
        for value, a, b in _wheel_pairs(node):
            yield value, form.format(a=f"({a})", b=f"({b})")

    return rule


def call(name: str, form: str, count: int = 2) -> Rule:
    """Changes calls of a function, given by its last name, with `count` arguments."""

    def rule(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
        if is_call(node, name, count):
            places = {f"a{k}": text_of(item) for k, item in enumerate(node.args)}
            func = text_of(node.func)
            yield node, form.format(call=text_of(node), f=func, **places)

    return rule


def item(key: str, form: str) -> Rule:
    """Changes reads of `obs[key]`."""

    def rule(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
        if constant_key(node) == key and isinstance(node.ctx, ast.Load):
            yield node, form.format(item=text_of(node), owner=text_of(node.value))

    return rule


def in_policy(*lines: str) -> Rule:
    """Inserts lines at the beginning of `policy`; `obs` stands for its argument."""

    def rule(node: ast.AST, source: Source) -> Iterator[MeanChange]:
        if not (isinstance(node, ast.FunctionDef) and node.name == "policy"):
            return
        first = next(s for s in node.body if not source.is_text(s))
        indent = "\n" + " " * first.col_offset
        obs = node.args.args[0].arg
        head = [re.sub(r"\bobs\b", obs, line) for line in lines]
        yield first, indent.join([*head, source.segment(first)])

    return rule


def margin(form: str, names: re.Pattern[str] = BODY) -> Rule:
    """Changes uses of the body's size and of margins."""

    def rule(node: ast.AST, source: Source) -> Iterator[MeanChange]:
        name = node.id if isinstance(node, ast.Name) else constant_key(node)
        name = node.attr if isinstance(node, ast.Attribute) else name
        if not name or not names.search(name) or source.is_called(node):
            return
        if isinstance(node.ctx, ast.Load):
            yield node, form.format(text_of(node))

    return rule


def never(pattern: re.Pattern[str], *, returns: bool = False) -> Rule:
    """Makes conditions that match a pattern always false."""

    def rule(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
        if isinstance(node, ast.If):
            fits = not returns or any(isinstance(s, ast.Return) for s in node.body)
        else:
            fits = isinstance(node, ast.IfExp)
        if fits and pattern.search(text_of(node.test)):
            yield node.test, "False"

    return rule


def constant(form: str) -> Rule:
    """Changes the module's constants."""

    def rule(node: ast.AST, source: Source) -> Iterator[MeanChange]:
        if node not in source.tree.body or not isinstance(node, ast.Assign):
            return
        name, value = text_of(node.targets[0]), node.value
        plain = isinstance(value, ast.Constant | ast.BinOp | ast.Subscript)
        text = isinstance(value, ast.Constant) and isinstance(value.value, str)
        if name.isupper() and plain and not text:
            yield value, form.format(f"({text_of(value)})")

    return rule


def heuristic(form: str) -> Rule:
    """Changes the heuristic that a search adds to the cost so far."""

    def rule(node: ast.AST, _source: Source) -> Iterator[MeanChange]:
        if is_call(node, "heappush", 2) and isinstance(node.args[1], ast.Tuple):
            first = node.args[1].elts[0]
            if isinstance(first, ast.BinOp) and isinstance(first.op, ast.Add):
                yield first.right, form.format(f"({text_of(first.right)})")

    return rule


def words(old: str, new: str) -> Rule:
    """Replaces a word in string constants other than docstrings."""

    def rule(node: ast.AST, source: Source) -> Iterator[MeanChange]:
        if not isinstance(node, ast.Constant) or not isinstance(node.value, str):
            return
        if re.search(rf"\b{old}\b", node.value) and not source.is_docstring(node):
            yield node, repr(re.sub(rf"\b{old}\b", new, node.value))

    return rule
