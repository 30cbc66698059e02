"""The archive of a race: candidates with their figures, and who is asked about."""

from __future__ import annotations

from dataclasses import dataclass, field

from tdac_agent.synthesis.candidates import Candidate, Figures


@dataclass(frozen=True, slots=True, eq=False)
class Member:
    """A candidate that drove in the pool.

    Attributes:
        candidate: The candidate.
        figures: Its figures.
        parent: The member that it was to improve; None if it was not about one.
        kind: The kind of question that it answers; empty for a candidate of the loop.
        founder: Whether the race began with it.
    """

    candidate: Candidate
    figures: Figures
    parent: Member | None = None
    kind: str = ""
    founder: bool = False


@dataclass(frozen=True, slots=True)
class Refused:
    """A candidate that did not drive.

    Attributes:
        candidate: The candidate.
        parent: The member that it was to improve.
        said: Why, in one line.
    """

    candidate: Candidate
    parent: Member | None
    said: str


@dataclass(slots=True)
class Archive:
    """All members of a race, oldest first, and the candidates that are none.

    Attributes:
        members: Those that drove in all episodes of the pool.
        dropped: Those that were clearly worse before its end.
        refused: Those that did not drive.
        replaced: Members that one of their children beats.
    """

    members: list[Member] = field(default_factory=list)
    dropped: list[Member] = field(default_factory=list)
    refused: list[Refused] = field(default_factory=list)
    replaced: list[Member] = field(default_factory=list)

    @property
    def live(self) -> list[Member]:
        """Members that no child beats, best first; of equals, the older one."""
        kept = [each for each in self.members if each not in self.replaced]
        return sorted(kept, key=lambda each: each.figures.rank, reverse=True)

    @property
    def top(self) -> Member | None:
        """The best member; None without any."""
        return self.best() if self.members else None

    def best(self) -> Member:
        """The best member; of equals, the oldest one."""
        return max(self.members, key=lambda each: each.figures.rank)

    def replace(self, parents: tuple[Member, ...]) -> None:
        """Notes that a child beats what it was to improve."""
        self.replaced += [each for each in parents[:1] if each not in self.replaced]

    @property
    def founders(self) -> list[Member]:
        """The members that the race began with."""
        return [each for each in self.members if each.founder]

    @property
    def base(self) -> Candidate:
        """The best founder: what the race has to improve; the oldest without any."""
        known = self.founders or self.members[:1]
        return max(known, key=lambda each: each.figures.rank).candidate

    @property
    def variations(self) -> int:
        """Number of candidates that drove and that the race did not begin with."""
        return len(self.members) + len(self.dropped) - len(self.founders)

    def finalists(self, number: int) -> list[Candidate]:
        """The candidates for the selection, oldest first: the best founder is one.

        Args:
            number: Most others.
        """
        ranked = sorted(self.members, key=lambda each: each.figures.rank, reverse=True)
        best = [each.candidate for each in ranked[:number]]
        chosen = best if any(self.base is each for each in best) else [self.base, *best]
        return sorted(chosen, key=lambda each: (each.k, each.j))

    def children(self, parent: Member) -> list[Member]:
        """The answers to questions about a member, if they drove."""
        found = [*self.members, *self.dropped]
        return [each for each in found if each.parent is parent]

    def refused_of(self, parent: Member) -> list[Refused]:
        """The answers to questions about a member that did not drive."""
        return [each for each in self.refused if each.parent is parent]
