"""`improvement.json` of a run on a task: what variations of its controller brought."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from tdac_agent.storage.printable_record import StrictRecord, read_record
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.units import Place

IMPROVEMENT_FILE = "improvement.json"
NOT_SHOWN = "no improvement is shown"
"""What is said if no difference is shown."""
MOST_P = 0.05
"""Most p-value of a difference that is shown, beside an interval above 0: with few
episodes, the interval is too narrow."""


def is_shown(low: float, p: float | None) -> bool:
    """Whether a difference is shown to be an improvement.

    Args:
        low: Lower end of its interval.
        p: Its p-value; None if it is not on record.
    """
    return low > 0.0 and (p is None or p <= MOST_P)


def drive_text(time: float, reached: int, count: int) -> str:
    """How a candidate drove, in one line.

    Args:
        time: Its mean time score.
        reached: Number of disturbed episodes that reached the goal.
        count: Their number.
    """
    return f"time score {time:.3f}; {goals_text(reached, count)}"


def goals_text(reached: int, count: int) -> str:
    """How many disturbed episodes reached the goal."""
    return f"the goal reached in {reached} of {count} disturbed episodes"


class MemberFigures(StrictRecord):
    """A candidate that passed, in the disturbed episodes of the search."""

    k: int
    j: int
    parent: tuple[int, int] | None = Field(
        description="(k, j) of the candidate that it varies."
    )
    controller_sha256: str
    robustness: float = Field(description="Share of episodes that reached the goal.")
    time: float = Field(description="Mean time score.")
    nominal: float = Field(description="Time score of the nominal episode.")
    clearance: float = Field(
        description="Mean of the least gaps between body and obstacles; an episode "
        "that fails counts as 0."
    )


class PairedChange(StrictRecord):
    """Means of both controllers in the same episodes, and their difference.

    The interval is that of a paired bootstrap over episodes, with 95 % confidence.
    """

    before: float = Field(description="Of the first controller that passed.")
    after: float = Field(description="Of the selected one.")
    low: float = Field(description="Lower end of the difference.")
    high: float = Field(description="Upper end of the difference.")
    p: float = Field(
        description="p-value of no difference; not below what so few episodes can show."
    )

    @property
    def shown(self) -> bool:
        """Whether an improvement is shown."""
        return is_shown(self.low, self.p)

    @property
    def told(self) -> str:
        """Means and difference, as text."""
        change = self.after - self.before
        return (
            f"{self.before:.3f} -> {self.after:.3f}, {change:+.3f} "
            f"(95 % interval {self.low:+.3f} to {self.high:+.3f})"
        )


class TaskImprovement(StrictRecord):
    """The search for a better controller, after the first that passed."""

    schema_version: int = 1
    unit: Place = Field(description="Unit of the clearance.")
    disturbance: Disturbance
    first_seed: int = Field(description="Of the episodes of the search.")
    block: int = Field(description="Their number, the same for all candidates.")
    improve: int = Field(description="Limit of disturbed episodes.")
    used: int
    asked: int = Field(description="Number of variations that were answered.")
    members: tuple[MemberFigures, ...] = Field(description="Oldest first.")
    founders: int = Field(
        0,
        description="Members that the search began with; 0 in records of earlier "
        "versions, where only the others have a parent.",
    )
    first: tuple[int, int] = Field(description="(k, j) of the first that passed.")
    k: int = Field(description="Iteration of the selected candidate.")
    j: int = Field(description="Its edit.")
    controller_sha256: str
    first_comparison: int = Field(description="Seed of its first episode.")
    episodes: int = Field(
        description="Episodes of the comparison, which decided nothing; 0 if the first "
        "candidate that passed was selected."
    )
    lost_before: dict[str, float] = Field(
        {}, description="Mean shares of the score that the first one lost, by cause."
    )
    lost_after: dict[str, float] = Field({}, description="Those of the selected one.")
    robustness: PairedChange | None = None
    time: PairedChange | None = None
    stopped: str = Field("", description="What ended the search early.")

    @property
    def selected(self) -> tuple[int, int]:
        """(k, j) of the selected candidate."""
        return self.k, self.j

    def text_of(self, k: int, j: int) -> str:
        """How a candidate drove that the search began with; empty for any other."""
        for each in self._begun:
            if (each.k, each.j) == (k, j):
                reached = round(each.robustness * self.block)
                return drive_text(each.time, reached, self.block)
        return ""

    @property
    def _begun(self) -> tuple[MemberFigures, ...]:
        """The members that the search began with."""
        if self.founders:
            return self.members[: self.founders]
        return tuple(each for each in self.members if each.parent is None)

    @property
    def told(self) -> str:
        """What the search brought, in one line."""
        varied = len(self.members) - len(self._begun)
        about = f"{self.asked} variation{'' if self.asked == 1 else 's'}"
        about = f"improving: {about}, {varied} of them passed"
        first, selected = (
            "k={} j={}".format(*one) for one in (self.first, self.selected)
        )
        if self.robustness is None or self.time is None:
            return f"{about}; none was better than {first}, which stays"
        shown = self.robustness.shown or self.time.shown
        return (
            f"{about}; {selected} was selected instead of {first}; in "
            f"{self.episodes} other disturbed episodes: goals reached "
            f"{self.robustness.told}; time score {self.time.told}"
            f"{'' if shown else f'; {NOT_SHOWN}'}"
        )


def read_improvement(folder: Path) -> TaskImprovement | None:
    """What the search of a run brought; None if there is no readable record."""
    return read_record(TaskImprovement, folder, IMPROVEMENT_FILE)
