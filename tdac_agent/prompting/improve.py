"""What a model is told about a controller that it shall improve."""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter
from typing import NamedTuple

MOST_TRIED = 6
"""Most variations that are shown: the best and the latest ones."""
MOST_LINES = 12
"""Most changed lines that are shown of a variation."""


class Tried(NamedTuple):
    """An earlier variation of the controller.

    Attributes:
        diff: Its unified diff.
        rank: Its figures, the most important one first; empty if it has none.
        result: What came of it.
    """

    diff: str
    rank: tuple[float, ...]
    result: str


def improve_text(drives: Sequence[str], tried: Sequence[Tried]) -> str:
    """How a controller drives, and what was tried with it.

    Args:
        drives: How it drives, in lines.
        tried: Earlier variations, oldest first.
    """
    lines = list(drives)
    if tried:
        lines += ["", "### What was tried with it"]
        for each in _shown(tried):
            lines += [f"{each.result}:", "```diff", *_changes(each.diff), "```"]
    return "\n".join(lines)


def _shown(tried: Sequence[Tried]) -> list[Tried]:
    """The best half and the latest ones, best first."""
    by_rank = sorted(tried, key=attrgetter("rank"), reverse=True)
    best = by_rank[: MOST_TRIED // 2]
    latest = [each for each in tried if each not in best][-(MOST_TRIED // 2) :]
    return sorted([*best, *latest], key=attrgetter("rank"), reverse=True)


def _changes(diff: str) -> list[str]:
    """The changed lines of a unified diff, of bounded number."""
    changed = [
        line
        for line in diff.splitlines()
        if line[:1] in {"+", "-"} and not line.startswith(("+++", "---"))
    ]
    if len(changed) > MOST_LINES:
        rest = len(changed) - MOST_LINES
        return [*changed[:MOST_LINES], f"(and {rest} more changed lines)"]
    return changed or ["(no line)"]
