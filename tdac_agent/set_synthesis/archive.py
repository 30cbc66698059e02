"""The archive of a search: candidates with their figures, and who is varied next."""

from __future__ import annotations

from dataclasses import astuple, dataclass, field
from statistics import fmean

import numpy as np

from tdac_agent.evaluation.set_report import SetReport
from tdac_agent.set_synthesis.trials import Candidate

WORST = 4
"""The worst n-th of the worlds stands for robustness."""


@dataclass(frozen=True, slots=True)
class Figures:
    """How a candidate drove on the worlds of the search; higher is better, in [0, 1].

    Attributes:
        time: Mean time score.
        path: Mean path score.
        success: Fraction of worlds whose goal was reached.
        worst: Mean time score on the worst quarter of the worlds.
    """

    time: float
    path: float
    success: float
    worst: float

    @classmethod
    def of(cls, report: SetReport) -> Figures:
        """The figures of a report with episodes."""
        episodes = report.episodes
        times = sorted(each.time_score for each in episodes)
        worst = times[: max(1, len(times) // WORST)]
        return cls(
            fmean(times),
            fmean(each.path_score for each in episodes),
            fmean(each.success for each in episodes),
            fmean(worst),
        )

    def beats(self, other: Figures) -> bool:
        """Whether it is nowhere worse, and better somewhere."""
        pairs = list(zip(astuple(self), astuple(other), strict=True))
        return all(a >= b for a, b in pairs) and any(a > b for a, b in pairs)


@dataclass(frozen=True, slots=True)
class Member:
    """A candidate that drove on the worlds of the search.

    Attributes:
        candidate: The candidate.
        report: How it drove on them.
        figures: Its figures.
        parent: The member that it is a variation of; None for a founder.
    """

    candidate: Candidate
    report: SetReport
    figures: Figures
    parent: Member | None = None

    @property
    def place(self) -> str:
        """Its name in texts."""
        return f"k={self.candidate.k} j={self.candidate.j}"


@dataclass(slots=True)
class Archive:
    """All members of a search, oldest first."""

    members: list[Member] = field(default_factory=list)

    def front(self) -> list[Member]:
        """The members that no other one beats (Pareto front), best time score first."""
        kept = [
            each
            for each in self.members
            if not any(other.figures.beats(each.figures) for other in self.members)
        ]
        return sorted(kept, key=lambda each: -each.figures.time)

    def parent(self, random: np.random.Generator) -> Member:
        """A member of the front; each place further down is half as likely."""
        front = self.front()
        weights = 0.5 ** np.arange(len(front))
        return front[int(random.choice(len(front), p=weights / weights.sum()))]

    def best(self) -> Member:
        """The member with the highest mean time score; of equals, the oldest one."""
        return max(self.members, key=lambda each: each.figures.time)

    @property
    def variations(self) -> int:
        """Number of members that are variations."""
        return sum(each.parent is not None for each in self.members)

    def children(self, parent: Member) -> list[Member]:
        """The variations of a member so far."""
        return [each for each in self.members if each.parent is parent]
