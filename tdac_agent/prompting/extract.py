"""Extraction of the controller's source from a model's answer."""

from __future__ import annotations

import ast
import sys
import warnings
from typing import NamedTuple

MAX_INNER_FENCES = 20
PYTHON = frozenset({"python", "py", "python3"})
MARKDOWN = frozenset({"markdown", "md"})
# Text in these languages may parse as Python, but is never the file.
OTHER = frozenset({"bash", "console", "diff", "json", "output", "sh", "shell", "text"})
OTHER |= frozenset({"csv", "html", "ini", "js", "toml", "txt", "xml", "yaml", "yml"})


class _Fence(NamedTuple):
    """A line of three or more backticks or tildes, with the text after them."""

    line: int
    run: str
    info: str

    @property
    def language(self) -> str:
        return self.info.partition(" ")[0].strip("{}.").lower()

    @property
    def may_wrap(self) -> bool:
        """Whether it may enclose a whole answer, including other fences."""
        return self.language in MARKDOWN or (len(self.run) > 3 and not self.info)

    def closes(self, opening: _Fence) -> bool:
        """Whether it is alone on its line and at least as long as the opening fence."""
        return not self.info and self.run.startswith(opening.run)


class _Block(NamedTuple):
    """Lines between two fences; `source` is None if they are not Python."""

    opening: _Fence
    length: int
    source: str | None


class Answer(NamedTuple):
    """The file in an answer, or a description of the problem for the model."""

    source: str | None
    problem: str = ""


def extract_source(text: str) -> str | None:
    """Returns the fenced Python block with the largest syntax tree, or None.

    A fence inside a string does not end a block if the longer block parses. Returns
    None if the file appears to be truncated or broken, even if an example in or beside
    it parses, and if two blocks may be the file: the model must be asked again.
    """
    return read_answer(text).source


def read_answer(text: str, must_define: str | None = None) -> Answer:
    """Returns the file in an answer; see `extract_source`.

    Args:
        text: The answer.
        must_define: Name of a function that the file must define.
    """
    lines = text.replace("\r\n", "\n").split("\n")
    fences = _fences(lines)
    blocks = _blocks(lines, fences)
    sizes = {block: _tree_size(block.source) for block in blocks if block.source}
    best = max(sizes, key=lambda block: (sizes[block], block.length), default=None)
    if best is None or any(_overshadows(block, best) for block in blocks):
        return Answer(None, _problem(lines, fences, blocks))
    if any(_rivals(block, best, sizes) for block in sizes):
        return Answer(None, "it has two blocks that may be the file; give only one")
    source = best.source or ""
    if must_define is not None and must_define not in _functions(source):
        lacks = f"has no `def {must_define}` at its top level, so it is not the file"
        return Answer(None, f"its block of Python {lacks}")
    return Answer(source)


def same_code(one: str, other: str) -> bool:
    """Whether two texts are the same program, apart from comments and layout."""
    try:
        with warnings.catch_warnings(action="ignore"):
            return ast.dump(ast.parse(one)) == ast.dump(ast.parse(other))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return one == other


def fenced_blocks(text: str, languages: frozenset[str]) -> list[str]:
    """Returns the fenced blocks in some languages; the first closing fence ends one."""
    lines = text.replace("\r\n", "\n").split("\n")
    found: list[str] = []
    opening: _Fence | None = None
    for fence in _fences(lines):
        if opening is None:
            opening = fence
        elif fence.closes(opening):
            if opening.language in languages:
                found.append("\n".join(lines[opening.line + 1 : fence.line]))
            opening = None
    return found


def _tree_size(source: str) -> int:
    with warnings.catch_warnings(action="ignore"):
        return sum(1 for _ in ast.walk(ast.parse(source)))


def _functions(source: str) -> set[str]:
    with warnings.catch_warnings(action="ignore"):
        body = ast.parse(source).body
    return {node.name for node in body if isinstance(node, ast.FunctionDef)}


def _rivals(block: _Block, best: _Block, sizes: dict[_Block, int]) -> bool:
    """Whether another block may equally be the file: comparable size, and `policy`.

    The longer of two files may be one that the model discarded.
    """
    if block is best or block.source == best.source or 2 * sizes[block] < sizes[best]:
        return False
    return "policy" in _functions(block.source or "") & _functions(best.source or "")


def _problem(lines: list[str], fences: list[_Fence], blocks: list[_Block]) -> str:
    if not fences:
        return "it has no fenced block"
    broken = [b for b in blocks if b.source is None and b.opening.language not in OTHER]
    if not blocks:
        return "its last fenced block has no end"
    if not broken:
        return "it has no fenced block of Python"
    worst = max(broken, key=lambda block: block.length)
    first = worst.opening.line + 1
    source = _source(lines[first : worst.opening.line + worst.length])
    return f"its block is not Python: {_why_broken(source)}"


def _why_broken(source: str) -> str:
    try:
        with warnings.catch_warnings(action="ignore"):
            ast.parse(source)
    except SyntaxError as error:
        line = (error.text or "").strip()[:80]
        return f"{error.msg} (line {error.lineno}: {line!r})"
    except (ValueError, RecursionError, MemoryError) as error:
        return str(error).partition("\n")[0] or type(error).__name__
    return "it contains no statement"


def _overshadows(broken: _Block, best: _Block) -> bool:
    """Whether a block that does not parse is more likely the file than the best one.

    A broken block before the best one may contain it inside a string. If the best block
    has a language label, the file would have one, too.
    """
    if broken.source is not None or broken.opening.language in OTHER:
        return False
    labelled = broken.opening.language in PYTHON
    before = best.opening.line - broken.opening.line
    if before < 0:
        return labelled and broken.length >= best.length
    if not best.opening.info:
        return labelled or before >= best.length
    return labelled and before >= best.length


def _fences(lines: list[str]) -> list[_Fence]:
    """Returns the fences, in linear time for any answer."""
    found = []
    for number, line in enumerate(lines):
        text = line.lstrip(" \t")
        sign = text[:1]
        if sign and sign in "`~":
            info = text.lstrip(sign)
            run = text[: len(text) - len(info)]
            if len(run) >= 3 and "`" not in info:
                found.append(_Fence(number, run, info.strip()))
    return found


def _blocks(lines: list[str], fences: list[_Fence]) -> list[_Block]:
    """Returns consecutive blocks; none if the last one is not closed."""
    blocks = []
    wrapped = after_code = False
    index = 0
    while index < len(fences):
        opening = fences[index]
        closings = _closings(fences, index)
        if not closings:
            # An extra fence after code ends a fence around the whole answer, or is a
            # stray fence; any other one opens a block that is not closed.
            at_end = wrapped or not any(map(str.strip, lines[opening.line + 1 :]))
            if opening.info or not after_code or not at_end:
                return []
            index += 1
            continue
        closing, source = closings[0], None
        if opening.language not in OTHER:
            closing, source = _longest(lines, fences, index, closings)
        if source is None and opening.may_wrap and not wrapped:
            wrapped = True
            index += 1
            continue
        blocks.append(_Block(opening, fences[closing].line - opening.line, source))
        if opening.language not in OTHER:
            after_code = source is not None
        index = closing + 1
    return blocks


def _closings(fences: list[_Fence], index: int) -> list[int]:
    """Returns the nearby fences that may close a fence, or the first one beyond."""
    near = index + 2 + MAX_INNER_FENCES
    found: list[int] = []
    for number in range(index + 1, len(fences)):
        if number >= near and found:
            break
        if fences[number].closes(fences[index]):
            found.append(number)
    return found


def _longest(
    lines: list[str], fences: list[_Fence], index: int, closings: list[int]
) -> tuple[int, str | None]:
    """Returns the last fence with which the block parses, or the first one and None."""
    first = fences[index].line + 1
    broken = sys.maxsize
    for closing in reversed(closings):
        last = fences[closing].line
        # A shorter block that contains the error of a longer one fails, too.
        if broken > last - first:
            source = _source(lines[first:last])
            broken = _broken_line(source)
            if not broken:
                return closing, source
    return closings[0], None


def _source(lines: list[str]) -> str:
    """Joins lines, without the indentation of the first one that is not blank."""
    text = next((line for line in lines if line.strip()), "")
    margin = text[: len(text) - len(text.lstrip(" \t"))]
    return "".join(f"{line.removeprefix(margin)}\n" for line in lines)


def _broken_line(source: str) -> int:
    """Returns the line of the first syntax error; 0 if the text parses."""
    try:
        with warnings.catch_warnings(action="ignore"):
            return 0 if ast.parse(source).body else sys.maxsize
    except SyntaxError as error:
        return error.lineno or sys.maxsize
    except (ValueError, RecursionError, MemoryError):
        return sys.maxsize
