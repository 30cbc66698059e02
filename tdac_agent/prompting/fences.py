"""Fenced blocks of a Markdown text, and the Python sources in them."""

from __future__ import annotations

import ast
import re
import sys
from typing import NamedTuple

from tdac_agent.prompting.python_source import UNPARSABLE, parse

MAX_INNER_FENCES = 20
_PYTHON = re.compile(r"(?:i?py(?:thon)?[\d.]*|[\w./-]*\.py)")
MARKDOWN = frozenset({"markdown", "md"})
# Text in these languages may parse as Python, but is never the file.
OTHER = frozenset({"bash", "console", "diff", "json", "output", "sh", "shell", "text"})
OTHER |= frozenset({"csv", "html", "ini", "js", "toml", "txt", "xml", "yaml", "yml"})
OTHER |= frozenset({"c", "cpp", "cmake", "dockerfile", "go", "java", "javascript"})
OTHER |= frozenset({"latex", "log", "lua", "make", "math", "matlab", "mermaid"})
OTHER |= frozenset({"patch", "plaintext", "pseudo", "pseudocode", "pycon", "rust"})
OTHER |= frozenset({"jsonc", "jsonl", "sql", "tex", "tool_code", "ts", "typescript"})
_FENCE = re.compile(r"[ \t]*+(`{3,}+|~{3,}+)([^`]*)\Z")
_FILE_NAME = re.compile(r"[\w./-]*\w\.py:?")


class Fence(NamedTuple):
    """A line of three or more backticks or tildes, with the text after them."""

    line: int
    run: str
    info: str

    @property
    def language(self) -> str:
        """Its label in lower case, e.g. `python` of "```Python title=x.py"."""
        return re.split(r"[\s:,={}]", self.info.lstrip("{."), maxsplit=1)[0].lower()

    @property
    def is_python(self) -> bool:
        """Whether it is labelled as Python, or with the name of a Python file."""
        return _PYTHON.fullmatch(self.language) is not None

    @property
    def is_other(self) -> bool:
        """Whether it is labelled as text in another language."""
        return self.language in OTHER

    @property
    def may_wrap(self) -> bool:
        """Whether it may enclose a whole answer, including other fences."""
        return self.language in MARKDOWN or (len(self.run) > 3 and not self.info)

    def closes(self, opening: Fence) -> bool:
        """Whether it is alone on its line and at least as long as the opening fence."""
        return not self.info and self.run.startswith(opening.run)

    def closes_with_text(self, opening: Fence) -> bool:
        """Whether it would close the block but for text behind it: "```<end_code>"."""
        is_label = self.is_python or self.is_other or self.language in MARKDOWN
        return bool(self.info) and not is_label and self.run.startswith(opening.run)


class Block(NamedTuple):
    """Lines between two fences.

    Attributes:
        opening: Its first fence.
        length: Lines to its last fence.
        text: Its lines, without their common indentation.
        tree: Its syntax tree; None if it is not Python.
    """

    opening: Fence
    length: int
    text: str
    tree: ast.Module | None


def find_fences(lines: list[str]) -> list[Fence]:
    """Returns the fences, in linear time for any text."""
    matches = ((number, _FENCE.match(line)) for number, line in enumerate(lines))
    return [Fence(n, match[1], match[2].strip()) for n, match in matches if match]


def find_blocks(lines: list[str], fences: list[Fence]) -> list[Block]:
    """Returns consecutive blocks; none if the last one is not closed.

    A fence inside a string does not end a block if the longer block parses. A fence
    with text behind it ends one if the shorter block parses, and no longer one does.
    """
    blocks: list[Block] = []
    wrapped = after_code = False
    index = 0
    while index < len(fences):
        opening = fences[index]
        if _is_doubled(lines, fences, index):
            wrapped = True
            index += 1
            continue
        closing, block = _block(lines, fences, index)
        if block is None:
            # An extra fence after code ends a fence around the whole answer, or is a
            # stray fence; any other one opens a block that is not closed.
            at_end = wrapped or not any(map(str.strip, lines[opening.line + 1 :]))
            if opening.info or not after_code or not at_end:
                return []
            index += 1
            continue
        if block.tree is None and opening.may_wrap and not wrapped:
            wrapped = True
            index += 1
            continue
        blocks.append(block)
        if not opening.is_other:
            after_code = block.tree is not None
        index = closing + 1
    return blocks


def fenced_blocks(text: str, languages: frozenset[str]) -> list[str]:
    """Returns the blocks in some languages; the first closing fence ends one.

    The text has the line ends of `plain_text`.
    """
    lines = text.split("\n")
    blocks: list[str] = []
    opening: Fence | None = None
    for fence in find_fences(lines):
        if opening is None:
            opening = fence
        elif fence.closes(opening) or fence.closes_with_text(opening):
            if opening.language in languages:
                blocks.append("\n".join(lines[opening.line + 1 : fence.line]))
            opening = None
    return blocks


def _is_doubled(lines: list[str], fences: list[Fence], index: int) -> bool:
    """Whether the next fence opens the block again, after comments at most."""
    opening, following = fences[index], fences[index + 1 : index + 2]
    if not following or not following[0].is_python:
        return False
    if opening.info and not opening.is_python:
        return False
    between = map(str.strip, lines[opening.line + 1 : following[0].line])
    return all(not s or s[0] == "#" or _FILE_NAME.fullmatch(s) for s in between)


def _block(
    lines: list[str], fences: list[Fence], index: int
) -> tuple[int, Block | None]:
    """Returns the block that a fence opens and the number of its closing fence."""
    opening = fences[index]
    closings = _closings(fences, index)
    ragged = [
        number
        for number in range(index + 1, min(index + MAX_INNER_FENCES, len(fences)))
        if fences[number].closes_with_text(opening)
    ]
    if opening.is_other:
        closing, tree = min([*closings[:1], *ragged[:1]], default=0), None
    else:
        closing, tree = _longest(lines, fences, index, closings)
        for number in ragged if tree is None else ():
            tree = _tree(source_of(lines[opening.line + 1 : fences[number].line]))[0]
            if tree is not None:
                closing = number
                break
    if not closing:
        return 0, None
    last = fences[closing].line
    text = source_of(lines[opening.line + 1 : last])
    return closing, Block(opening, last - opening.line, text, tree)


def _closings(fences: list[Fence], index: int) -> list[int]:
    """Returns the nearby fences that may close a fence, or the first one beyond."""
    near = index + 2 + MAX_INNER_FENCES
    closings: list[int] = []
    for number in range(index + 1, len(fences)):
        if number >= near and closings:
            break
        if fences[number].closes(fences[index]):
            closings.append(number)
    return closings


def _longest(
    lines: list[str], fences: list[Fence], index: int, closings: list[int]
) -> tuple[int, ast.Module | None]:
    """Returns the last fence with which the block parses, or the first one and None."""
    first = fences[index].line + 1
    broken = sys.maxsize
    for closing in reversed(closings):
        last = fences[closing].line
        # A shorter block that contains the error of a longer one fails, too.
        if broken > last - first:
            tree, broken = _tree(source_of(lines[first:last]))
            if tree is not None:
                return closing, tree
    return (closings or [0])[0], None


def source_of(lines: list[str]) -> str:
    """Joins lines, without the indentation of the first one that is not blank.

    If that one is only the name of the file, it becomes empty.
    """
    at = next((n for n, line in enumerate(lines) if line.strip()), None)
    if at is not None:
        text = lines[at]
        margin = text[: len(text) - len(text.lstrip(" \t"))]
        lines = [line.removeprefix(margin) for line in lines]
        if _FILE_NAME.fullmatch(lines[at].strip()):
            lines[at] = ""
    return "".join(f"{line}\n" for line in lines)


def _tree(source: str) -> tuple[ast.Module | None, int]:
    """Returns the syntax tree, or None and the line of the first syntax error."""
    try:
        tree = parse(source)
    except SyntaxError as error:
        return None, error.lineno or sys.maxsize
    except UNPARSABLE:
        return None, sys.maxsize
    return (tree, 0) if tree.body else (None, sys.maxsize)
