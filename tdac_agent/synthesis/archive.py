"""The archive of a search: candidates with their figures, and who is varied next."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tdac_agent.synthesis.candidates import Candidate, Figures


@dataclass(frozen=True, slots=True)
class Member:
    """A candidate that drove in the episodes of the search.

    Attributes:
        candidate: The candidate.
        figures: Its figures.
        parent: The member that it is a variation of; None for a founder.
    """

    candidate: Candidate
    figures: Figures
    parent: Member | None = None


@dataclass(frozen=True, slots=True)
class Refused:
    """A variation that did not become a member.

    Attributes:
        candidate: The candidate.
        parent: The member that it is a variation of.
        said: Why, in one line.
    """

    candidate: Candidate
    parent: Member
    said: str


@dataclass(slots=True)
class Archive:
    """All members of a search, oldest first, and the variations that are none."""

    members: list[Member] = field(default_factory=list)
    refused: list[Refused] = field(default_factory=list)

    def front(self) -> list[Member]:
        """The members that no other one beats (Pareto front), best first."""
        kept = [
            each
            for each in self.members
            if not any(one.figures.beats(each.figures) for one in self.members)
        ]
        return sorted(kept, key=lambda each: each.figures.rank, reverse=True)

    def parent(self, random: np.random.Generator) -> Member:
        """A member of the front; each place further down is half as likely."""
        front = self.front()
        weights = 0.5 ** np.arange(len(front))
        return front[int(random.choice(len(front), p=weights / weights.sum()))]

    def best(self) -> Member:
        """The best member; of equals, the oldest one."""
        return max(self.members, key=lambda each: each.figures.rank)

    @property
    def founders(self) -> list[Member]:
        """The members that are no variations."""
        return [each for each in self.members if each.parent is None]

    @property
    def base(self) -> Candidate:
        """The best founder: what the search has to improve."""
        return max(self.founders, key=lambda each: each.figures.rank).candidate

    @property
    def variations(self) -> int:
        """Number of members that are variations."""
        return len(self.members) - len(self.founders)

    def finalists(self, number: int) -> list[Candidate]:
        """The candidates for the selection, oldest first: the best founder is one.

        Args:
            number: Most others.
        """
        best = [each.candidate for each in self.front()[:number]]
        chosen = best if any(self.base is each for each in best) else [self.base, *best]
        return sorted(chosen, key=lambda each: (each.k, each.j))

    def children(self, parent: Member) -> list[Member]:
        """The variations of a member that became members."""
        return [each for each in self.members if each.parent is parent]

    def refused_of(self, parent: Member) -> list[Refused]:
        """The variations of a member that did not become members."""
        return [each for each in self.refused if each.parent is parent]
