"""What a model is told about a controller that it shall improve."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

MOST_TRIED = 6
"""Most variations that are shown: the best and the latest ones."""
MOST_LINES = 12
"""Most changed lines that are shown of a variation."""


class Scores(Protocol):
    """Figures of a controller, each in [0, 1]."""

    @property
    def time(self) -> float:
        """Mean time score."""

    @property
    def path(self) -> float:
        """Mean path score."""

    @property
    def success(self) -> float:
        """Fraction of worlds whose goal was reached."""

    @property
    def worst(self) -> float:
        """Mean time score on the worst quarter of the worlds."""


def improve_text(
    *,
    worlds: int,
    figures: Scores,
    best: float,
    feedback: str | None,
    tried: Sequence[tuple[str, float]],
) -> str:
    """The figures of a controller, its failures, and what was tried with it.

    Args:
        worlds: Number of worlds that it drove on.
        figures: Its figures.
        best: The highest mean time score of all controllers on these worlds.
        feedback: How it failed; None if it never did.
        tried: Earlier variations: the unified diff, and how much higher the mean time
            score became.
    """
    lines = [
        f"On {worlds} worlds, the same for all controllers:",
        f"- mean time score (success weighted by time): {figures.time:.3f}; the best "
        f"controller so far has {best:.3f}",
        f"- on the worst quarter of the worlds: {figures.worst:.3f}",
        f"- mean path score (success weighted by length): {figures.path:.3f}",
        f"- goals reached: {figures.success:.3f}",
    ]
    if feedback is not None:
        lines += ["", "### What failed", feedback]
    if tried:
        lines += ["", "### What was tried with it"]
        for diff, change in _shown(tried):
            lines += [f"Mean time score {change:+.3f}:", "```diff", *_changes(diff)]
            lines += ["```"]
    return "\n".join(lines)


def _shown(tried: Sequence[tuple[str, float]]) -> list[tuple[str, float]]:
    """The best half and the latest ones, best first."""
    best = sorted(tried, key=lambda each: -each[1])[: MOST_TRIED // 2]
    latest = [each for each in tried if each not in best][-(MOST_TRIED // 2) :]
    return sorted([*best, *latest], key=lambda each: -each[1])


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
