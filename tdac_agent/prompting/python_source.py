"""Properties of a Python source: does it parse, what does it define, is it whole?"""

from __future__ import annotations

import ast
import io
import re
import tokenize
import warnings
from collections.abc import Collection, Iterator
from contextlib import suppress

from tdac_agent.verification.suite.contract import top_level_names

UNPARSABLE = (SyntaxError, ValueError, RecursionError, MemoryError)
_BODIES = (ast.stmt, ast.excepthandler, ast.match_case)
_CODE = r"(?:code|file|program|functions?|helpers?|methods?|class(?:es)?|imports?|body)"
_GONE = (
    r"(?:unchanged|omitted|elided|no changes?|rest(?: of\b|\W*$)|as before"
    r"|same as (?:before|above|previous)|remain\w* (?:the same|as)"
    rf"|(?:existing|previous|other|remaining|your|keep\b.{{0,20}}) {_CODE}"
    rf"|{_CODE} (?:goes? )?here)\b"
)
_PLACEHOLDERS = [
    # An ellipsis at the start or the end, and what it stands for: "# ... unchanged".
    rf"(?>\W*?(?:\.\.\.|…)).*\b{_GONE}",
    rf"\W*(?:the )?{_GONE}.*(?:\.\.\.|…)\W*$",
    # Without one: "# rest of the code is the same", "# code omitted for brevity".
    rf"\W*(?:the )?(?:rest|remainder|remaining|other|existing|previous)\b.{{0,40}}"
    rf"\b{_CODE}\b.*(?:unchanged|same|as before|omitted|here|above)\b",
    rf"\W*\b{_CODE}\b.{{0,40}}\b(?:omitted|elided|remains? (?:unchanged|the same))\b",
    rf"\W*(?:{_CODE} |(?:the )?rest (?:is )?)unchanged\W*$",
]
# In a whole file these are headings or remarks: "# existing code", "pass  # unchanged".
_HEADINGS = [
    rf"\W*(?:keep )?(?:the )?(?:rest of|existing) (?:the |your |this )?{_CODE}\W*$",
    r"\W*(?:unchanged|same as before|omitted(?: for brevity)?)\W*$",
]
_PLACEHOLDER = re.compile("|".join(_PLACEHOLDERS), re.IGNORECASE)
_HEADING = re.compile("|".join(_HEADINGS), re.IGNORECASE)
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


def left_out(source: str, contract: Collection[str] = ()) -> str | None:
    """Returns the line that stands for code which was left out; None if there is none.

    That is a comment such as "# ... unchanged ...", or `...` as a statement.

    Args:
        source: The source, which need not parse.
        contract: Names that a whole file defines. A comment such as "# existing code"
            says nothing about such a file, unless a function of it does nothing.
    """
    try:
        tree = parse(source)
    except UNPARSABLE:
        tree = None
    whole = _is_whole(tree, contract)
    # The lines that look like comments in the place of code.
    matches = [
        match
        for match in _COMMENT.finditer(source)
        if _PLACEHOLDER.match(match[1]) or (not whole and _HEADING.match(match[1]))
    ]
    if matches and tree is not None:
        comments = _comments(source)
        matches = [match for match in matches if match[1].strip() in comments]
    if matches:
        return matches[0][0].strip()[:80]
    ellipsis = None if tree is None else next(_ellipses(tree), None)
    return None if ellipsis is None else f"line {ellipsis.lineno}: ..."


def _comments(source: str) -> set[str]:
    """Returns the beginnings of the comments, without lines of strings."""
    comments = set()
    with suppress(tokenize.TokenError, SyntaxError):
        for token in tokenize.generate_tokens(io.StringIO(source).readline):
            if token.type == tokenize.COMMENT:
                comments.add(token.string[1:201].strip())
    return comments


def _is_whole(tree: ast.Module | None, contract: Collection[str]) -> bool:
    """Whether a file defines all names, and each of its functions does something."""
    if tree is None or not contract or not defined_names(tree).issuperset(contract):
        return False
    return not any(
        isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and all(map(_does_nothing, node.body))
        for node in ast.walk(tree)
    )


def _does_nothing(node: ast.stmt) -> bool:
    return isinstance(node, ast.Pass) or isinstance(_constant_of(node), str)


def _ellipses(tree: ast.Module) -> Iterator[ast.stmt]:
    """Yields the statements `...` of the file, in all bodies that it has.

    Those of classes with a base and of decorated functions may have a purpose.
    """
    bodies: list[ast.AST] = [tree]
    while bodies:
        body = bodies.pop()
        for node in ast.iter_child_nodes(body):
            if isinstance(node, ast.stmt) and _constant_of(node) is ...:
                if not isinstance(body, ast.ClassDef):
                    yield node
            elif isinstance(node, _BODIES) and not _may_be_stub(node):
                bodies.append(node)


def _may_be_stub(node: ast.AST) -> bool:
    if isinstance(node, ast.ClassDef):
        return bool(node.bases)
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        return bool(node.decorator_list)
    return False


def _constant_of(node: ast.AST) -> object:
    """Returns the constant that is the whole statement; None for other statements."""
    match node:
        case ast.Expr(value=ast.Constant(value=constant)):
            return constant
    return None
