"""The archive of a search: candidates with their figures, and who is varied next."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, Protocol, TypeVar

import numpy as np


class Candidate(Protocol):
    """A controller that a model wrote."""

    @property
    def k(self) -> int:
        """Its iteration."""

    @property
    def j(self) -> int:
        """Its edit."""

    @property
    def source(self) -> str:
        """Its source."""

    @property
    def folder(self) -> Path:
        """Folder of its files."""


class Figures(Protocol):
    """How a candidate drove in the episodes of the search; higher is better."""

    @property
    def time(self) -> float:
        """Mean time score."""

    @property
    def values(self) -> tuple[float, ...]:
        """All figures."""

    @property
    def rank(self) -> tuple[float, ...]:
        """The figures that decide which member is best, the first one first."""

    @property
    def ranked(self) -> tuple[str, ...]:
        """Their names."""


C = TypeVar("C", bound=Candidate)


@dataclass(frozen=True, slots=True)
class Member(Generic[C]):
    """A candidate that drove in the episodes of the search.

    Attributes:
        candidate: The candidate.
        figures: Its figures.
        parent: The member that it is a variation of; None for a founder.
    """

    candidate: C
    figures: Figures
    parent: Member[C] | None = None

    @property
    def place(self) -> str:
        """Its name in texts."""
        return f"k={self.candidate.k} j={self.candidate.j}"

    def beats(self, other: Member[C]) -> bool:
        """Whether it is nowhere worse than another one, and better somewhere."""
        pairs = list(zip(self.figures.values, other.figures.values, strict=True))
        return all(a >= b for a, b in pairs) and any(a > b for a, b in pairs)


@dataclass(frozen=True, slots=True)
class Refused(Generic[C]):
    """A variation that did not become a member.

    Attributes:
        candidate: The candidate.
        parent: The member that it is a variation of.
        said: Why, in one line.
    """

    candidate: C
    parent: Member[C]
    said: str


@dataclass(slots=True)
class Archive(Generic[C]):
    """All members of a search, oldest first, and the variations that are none."""

    members: list[Member[C]] = field(default_factory=list)
    refused: list[Refused[C]] = field(default_factory=list)

    def front(self) -> list[Member[C]]:
        """The members that no other one beats (Pareto front), best first."""
        kept = [
            each
            for each in self.members
            if not any(other.beats(each) for other in self.members)
        ]
        return sorted(kept, key=lambda each: each.figures.rank, reverse=True)

    def parent(self, random: np.random.Generator) -> Member[C]:
        """A member of the front; each place further down is half as likely."""
        front = self.front()
        weights = 0.5 ** np.arange(len(front))
        return front[int(random.choice(len(front), p=weights / weights.sum()))]

    def best(self) -> Member[C]:
        """The best member; of equals, the oldest one."""
        return max(self.members, key=lambda each: each.figures.rank)

    @property
    def founders(self) -> list[Member[C]]:
        """The members that are no variations."""
        return [each for each in self.members if each.parent is None]

    @property
    def variations(self) -> int:
        """Number of members that are variations."""
        return len(self.members) - len(self.founders)

    def children(self, parent: Member[C]) -> list[Member[C]]:
        """The variations of a member that became members."""
        return [each for each in self.members if each.parent is parent]

    def refused_of(self, parent: Member[C]) -> list[Refused[C]]:
        """The variations of a member that did not become members."""
        return [each for each in self.refused if each.parent is parent]
