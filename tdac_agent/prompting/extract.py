"""Extraction of the controller's source from a model's answer.

The answer is read in five steps: terminal codes and thinking are removed
(`plain_answer`), its fenced blocks are found (`fences`), one of them is chosen, and it
is checked that nothing is left out (`python_source`). A truncated or ambiguous answer
gives no file, but the reason, with which the model is asked again.
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Collection
from typing import NamedTuple

from tdac_agent.prompting.fences import (
    Block,
    find_blocks,
    find_fences,
    source_of,
)
from tdac_agent.prompting.plain_answer import plain_text, readings, without_thinking
from tdac_agent.prompting.python_source import (
    UNPARSABLE,
    defined_names,
    left_out,
    parse,
    quotes,
    same_code,
    why_broken,
)

POLICY = "policy"
MAX_FENCES = 2000
_NO_FENCE = "it has no fenced block"
_POLICY = re.compile(r"^[ \t]*def policy\b", re.MULTILINE)
_DIFF = re.compile(r"^(?:@@ -|diff --git |<<<<<<< |\+\+\+ \S|\*\*\* Begin Patch)", re.M)
_TOOL = re.compile(
    r"<(?:tool_call|function_calls?|invoke|tool_use|antml:invoke)\b|\[TOOL_CALLS\]"
    r"|<\|tool_calls?_begin\|>|<｜tool▁calls?▁begin｜>"
)


class Answer(NamedTuple):
    """The file in an answer, or a description of the problem for the model."""

    source: str | None
    problem: str = ""


class _File(NamedTuple):
    """A block that is Python, and how well it fits.

    Attributes:
        whole: Whether it defines everything that the contract demands.
        size: Number of nodes of its syntax tree.
        length: Number of its lines.
        block: The block.
        tree: Its syntax tree.
        names: Names that it defines.
    """

    whole: bool
    size: int
    length: int
    block: Block
    tree: ast.Module
    names: set[str]


def extract_source(text: str) -> str | None:
    """Returns the fenced Python block with the largest syntax tree, or None.

    See `read_answer`; the block need not define anything.
    """
    return read_answer(text).source


def read_answer(
    text: str, contract: Collection[str] = (), *, ended: bool = False
) -> Answer:
    """Returns the file in an answer.

    Of several blocks, the file is the largest one that defines everything in the
    contract, or else the largest one that defines `policy`. Two different versions are
    ambiguous: the later one may be a correction, or an alternative that was discarded.
    So the model is asked which one it means.

    Args:
        text: The answer.
        contract: Names that the file must define at its top level. If they include
            `policy`, a file without it is refused, and an answer without any fence can
            be the file.
        ended: Whether the answer is known to be complete. If it is not, an answer
            without a fence is the file only if its last line has an end.
    """
    spoken = without_thinking(plain_text(text))
    if spoken is None:
        return Answer(None, "its thinking has no end, so the answer itself is missing")
    if not spoken.strip():
        empty = "nothing follows its thinking" if text.strip() else "it is empty"
        return Answer(None, empty)
    for reading in readings(spoken):
        answer = _read(reading, frozenset(contract), ended=ended)
        if answer.source is not None:
            break
    return answer


def _read(text: str, contract: frozenset[str], *, ended: bool) -> Answer:
    """Reads one reading of an answer without thinking."""
    bare = _bare_file(text, contract) if contract else None
    if bare is not None:
        cut = Answer(None, f"{_NO_FENCE}, and its last line may be cut")
        return _checked(bare, contract) if ended or text[-1] == "\n" else cut
    lines = text.split("\n")
    fences = find_fences(lines)
    if len(fences) > MAX_FENCES:
        return Answer(None, f"it has {len(fences)} fences, more than {MAX_FENCES}")
    blocks = find_blocks(lines, fences)
    files = [_file(block, block.tree, contract) for block in blocks if block.tree]
    if POLICY in contract:
        files = [file for file in files if POLICY in file.names] or files
    best = max(files, key=lambda file: file[:3], default=None)
    if best is None or any(_overshadows(block, best) for block in blocks):
        return Answer(None, _problem(text, blocks))
    if POLICY in contract and POLICY not in best.names:
        lacks = "has no `def policy` at its top level, so it is not the file"
        return Answer(None, f"its block of Python {lacks}")
    if any(_rivals(file, best) for file in files):
        return Answer(None, "it has two blocks that may be the file; give only one")
    return _checked(best.block.text, contract)


def _bare_file(text: str, contract: frozenset[str]) -> str | None:
    """Returns an answer that is only the file, without a fence; None if it is not.

    Nothing marks its end, so it must define everything that the contract demands.
    """
    source = source_of(text.strip("\n").split("\n"))
    try:
        return source if contract <= defined_names(parse(source)) else None
    except UNPARSABLE:
        return None


def _file(block: Block, tree: ast.Module, contract: frozenset[str]) -> _File:
    names = defined_names(tree)
    size = sum(1 for _ in ast.walk(tree))
    return _File(contract <= names, size, block.length, block, tree, names)


def _checked(source: str, contract: frozenset[str]) -> Answer:
    """The file, unless it leaves something out."""
    gap = left_out(source, contract)
    return Answer(source) if gap is None else Answer(None, _incomplete(gap))


def _incomplete(gap: str) -> str:
    return f"it leaves out code ({gap!r}), which nobody fills in; give the whole file"


def _rivals(file: _File, best: _File) -> bool:
    """Whether another block may equally be the file: as whole, of comparable size.

    The same program twice, or a quotation from the file, is no other file.
    """
    if file is best or file.whole != best.whole or 2 * file.size < best.size:
        return False
    if POLICY not in file.names & best.names or quotes(file.tree, best.tree):
        return False
    return not same_code(file.block.text, best.block.text)


def _overshadows(broken: Block, best: _File) -> bool:
    """Whether a block that does not parse is more likely the file than the best one.

    A broken block before the best one may contain it inside a string. If the best block
    has a language label, the file would have one, too. A broken block after a best one
    that defines `policy` must define it, too.
    """
    if broken.tree is not None or broken.opening.is_other:
        return False
    labelled = broken.opening.is_python
    before = best.block.opening.line - broken.opening.line
    if before < 0:
        likely = POLICY not in best.names or _POLICY.search(broken.text)
        return labelled and broken.length >= best.length and bool(likely)
    if not best.block.opening.info:
        return labelled or before >= best.length
    return labelled and before >= best.length


def _problem(text: str, blocks: list[Block]) -> str:
    """Says why an answer has no file."""
    broken = [b for b in blocks if b.tree is None and not b.opening.is_other]
    worst = max(broken, key=lambda block: block.length, default=None)
    gap = None if worst is None else left_out(worst.text)
    if gap is not None:
        return _incomplete(gap)
    if _DIFF.search(text):
        return "it is a change (a diff), not a file; give the whole file"
    if worst is not None:
        return f"its block is not Python: {why_broken(worst.text)}"
    if _TOOL.search(text):
        return "it calls a tool, and there is none; write the file into the answer"
    return _without_python(text, blocks)


def _without_python(text: str, blocks: list[Block]) -> str:
    if blocks:
        return "it has no fenced block of Python"
    if find_fences(text.split("\n")):
        return "its last fenced block has no end (a line that is only the fence)"
    return "it is JSON, without a fenced block" if _is_json(text) else _NO_FENCE


def _is_json(text: str) -> bool:
    try:
        return isinstance(json.loads(text), dict | list)
    except (ValueError, RecursionError):
        return False
