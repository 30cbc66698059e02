"""Properties of a Python source: does it parse, what does it define, is it whole?"""

from __future__ import annotations

import ast
import re
import warnings
from collections.abc import Iterator
from typing import TypeGuard

from tdac_agent.verification.suite.contract import top_level_names

UNPARSABLE = (SyntaxError, ValueError, RecursionError, MemoryError)
_CODE = r"(?:code|file|program|functions?|helpers?|methods?|class(?:es)?|imports?|body)"
_GONE = (
    r"(?:unchanged|omitted|elided|no changes?|rest(?: of\b|\W*$)|as before"
    r"|same as (?:before|above|previous)|remain\w* (?:the same|as)"
    rf"|(?:existing|previous|other|remaining|your|keep\b.{{0,20}}) {_CODE}"
    rf"|{_CODE} (?:goes? )?here)\b"
)
_PLACEHOLDERS = [
    # An ellipsis at the start or the end, and what it stands for: "# ... unchanged".
    rf"\W*?(?:\.\.\.|…).*\b{_GONE}",
    rf"\W*(?:the )?{_GONE}.*(?:\.\.\.|…)\W*$",
    # Without one: "# rest of the code is the same", "# code omitted for brevity".
    rf"\W*(?:the )?(?:rest|remainder|remaining|other|existing|previous)\b.{{0,40}}"
    rf"\b{_CODE}\b.*(?:unchanged|same|as before|omitted|here|above)\b",
    rf"\W*\b{_CODE}\b.{{0,40}}\b(?:omitted|elided|remains? (?:unchanged|the same))\b",
    rf"\W*(?:{_CODE} |(?:the )?rest (?:is )?)?unchanged\W*$",
    rf"\W*(?:keep )?(?:the )?(?:rest of|existing) (?:the |your |this )?{_CODE}\W*$",
    r"\W*(?:same as before|omitted(?: for brevity)?)\W*$",
]
_PLACEHOLDER = re.compile("|".join(_PLACEHOLDERS), re.IGNORECASE)
_COMMENT = re.compile(r"^[ \t]*(?:(?:\.\.\.|pass)[ \t]*)?#(.{1,200})", re.MULTILINE)


def parse(source: str) -> ast.Module:
    """Returns the syntax tree, without warnings about the code.

    Raises:
        SyntaxError, ValueError, RecursionError, MemoryError: It does not parse.
    """
    with warnings.catch_warnings(action="ignore"):
        return ast.parse(source)


def why_broken(source: str) -> str:
    """Says in one line why a text is not a Python source."""
    try:
        parse(source)
    except SyntaxError as error:
        line = (error.text or "").strip()[:80]
        return f"{error.msg} (line {error.lineno}: {line!r})"
    except UNPARSABLE as error:
        return str(error).partition("\n")[0] or type(error).__name__
    return "it contains no statement"


def same_code(one: str, other: str) -> bool:
    """Whether two texts are the same program, apart from comments and layout."""
    try:
        return ast.dump(parse(one)) == ast.dump(parse(other))
    except UNPARSABLE:
        return one == other


def defined_names(tree: ast.Module) -> set[str]:
    """Returns the names that a file defines at its top level.

    `policy` counts only as a plain function, as the contract demands.
    """
    try:
        names = top_level_names(tree)
    except RecursionError:
        return set()
    plain = isinstance(names.get("policy"), ast.FunctionDef)
    return set(names) - (set() if plain else {"policy"})


def quotes(part: ast.Module, whole: ast.Module) -> bool:
    """Whether every statement of one file also stands in the other one."""
    try:
        known = {ast.dump(node) for node in whole.body}
        return all(ast.dump(node) in known for node in part.body)
    except RecursionError:
        return False


def left_out(source: str, tree: ast.Module | None) -> str | None:
    """Returns the line that stands for code which was left out; None if there is none.

    That is a comment such as "# ... unchanged ...", or `...` as a statement.

    Args:
        source: The source.
        tree: Its syntax tree, None if it does not parse.
    """
    for match in _COMMENT.finditer(source):
        if _PLACEHOLDER.match(match[1]):
            return match[0].strip()[:80]
    for statement in _ellipses(tree) if tree is not None else ():
        return f"line {statement.lineno}: ..."
    return None


def _ellipses(tree: ast.Module) -> Iterator[ast.stmt]:
    """Yields the statements `...` of the file and its functions.

    Those of classes with a base and of decorated functions may have a purpose.
    """
    bodies: list[ast.Module | ast.FunctionDef | ast.ClassDef] = [tree]
    while bodies:
        body = bodies.pop()
        for node in body.body:
            if _is_plain(node):
                bodies.append(node)
            elif not isinstance(body, ast.ClassDef) and _is_ellipsis(node):
                yield node


def _is_plain(node: ast.stmt) -> TypeGuard[ast.FunctionDef | ast.ClassDef]:
    if isinstance(node, ast.ClassDef):
        return not node.bases
    return isinstance(node, ast.FunctionDef) and not node.decorator_list


def _is_ellipsis(node: ast.stmt) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and node.value.value is ...
    )
