"""`bench.json`: what came out for all entrants on all sets."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from tdac_agent.metrics.paired import Estimate
from tdac_agent.storage.printable_record import StrictRecord
from tdac_envs.ladder.frozen import dynamics_of, ladder_of
from tdac_envs.physics.moved import EXACT

Kind = Literal["builtin", "planner", "controller", "learned", "baseline", "privileged"]
"""What an entrant is."""


class Interval(StrictRecord):
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, found: Estimate) -> Interval:
        """The same as a record."""
        return cls(value=found.value, low=found.low, high=found.high)


class BenchSet(StrictRecord):
    """The worlds of a set, the same for all entrants."""

    name: str
    sha256: str
    dynamics: str = Field(
        "", description="Hash of the set with its code; empty before Ladder 1.0."
    )
    split: str
    worlds: int
    salt_sha256: str | None = Field(description="Of hidden worlds.")
    physics: str = Field(EXACT, description="What moved the robots.")

    @property
    def driven_on(self) -> str:
        """Its dynamics, also of results of before; see `dynamics_of`."""
        return dynamics_of(self.name, self.sha256, self.dynamics)

    @property
    def ladder(self) -> str:
        """To which ladder the results belong, in words; see `ladder_of`."""
        return ladder_of(self.name, self.sha256, self.dynamics)

    @property
    def which(self) -> str:
        """The worlds in words; of a task, its starts."""
        last = self.worlds - 1
        other = "" if self.physics == EXACT else f", moved by {self.physics}"
        if self.split == "jitter":
            return f"jittered starts 0 to {last}{other}"
        return f"worlds 0 to {last} of {self.split}{other}"


class BenchFile(StrictRecord):
    """A file of an entrant: one, or one for each seed of a training."""

    sha256: str
    hidden: int | None = Field(
        None, description="Hidden evaluations of this file on the set so far."
    )


class BenchRow(StrictRecord):
    """An entrant on a set. Figures are None if it did not drive."""

    set: str
    entrant: str
    kind: Kind | None = None
    knows: str | None = Field(None, description="What it may use.")
    tuned: bool | None = Field(
        None, description="Whether its constants were tuned for this set."
    )
    steps: int | None = Field(
        None, description="Training steps, up to what was saved, of all its seeds."
    )
    trained_here: bool | None = Field(
        None,
        description="Whether a learned policy records that it was trained on this set.",
    )
    files: tuple[BenchFile, ...] = ()
    problem: str | None = Field(None, description="Why it did not drive.")
    worlds: int = 0
    success: Interval | None = Field(
        None,
        description="Share of episodes that reached the goal; exact interval (Clopper "
        "and Pearson), with several seeds a bootstrap.",
    )
    time: Interval | None = Field(
        None,
        description="Mean time score (SCT), bootstrap; without a success, the "
        "upper end is that of `success`.",
    )
    path: float | None = Field(None, description="Mean path score (SPL).")
    barn: float | None = Field(None, description="Mean score of BARN, at most 0.5.")
    causes: dict[str, int] = Field({}, description="Failures by cause.")
    contacts: dict[str, int] = Field({}, description="Contacts by what was touched.")
    late: int = Field(0, description="Episodes that ended at the horizon.")
    errors: int = Field(0, description="Its own errors, too much CPU time included.")
    clock_dependent: str | None = None


class BenchOverall(StrictRecord):
    """An entrant over all sets, each with equal weight; only if it drove on all."""

    entrant: str
    time: Interval
    middle: float = Field(description="Interquartile mean of the time score.")
    success: float


class BenchPair(StrictRecord):
    """Two entrants on the same worlds of a set, or over all sets."""

    set: str | None = Field(description="None: over all sets.")
    one: str
    other: str
    ahead: Interval = Field(description="Mean time score of one minus that of other.")
    p: float = Field(description="Of the time score, by bootstrap.")
    p_holm: float = Field(description="Adjusted for all pairs of the table, by Holm.")
    better: float | None = Field(
        None, description="Share of worlds on which one scores more; a tie is half."
    )
    only_one: int | None = Field(None, description="Worlds that only one reached.")
    only_other: int | None = None
    p_success: float | None = Field(
        None, description="McNemar's exact test; None with several seeds."
    )


class Bench(StrictRecord):
    """Entrants on the same worlds of task sets, by the same judge."""

    schema_version: Literal[1] = 1
    versions: dict[str, str]
    sets: tuple[BenchSet, ...]
    entrants: tuple[str, ...]
    rows: tuple[BenchRow, ...]
    overall: tuple[BenchOverall, ...] = ()
    pairs: tuple[BenchPair, ...] = ()

    def of_set(self, name: str) -> tuple[BenchRow, ...]:
        """The rows of a set, the best time score first.

        At the end are those that did not drive, and the privileged ones.

        Args:
            name: Name of the set.
        """
        rows = [row for row in self.rows if row.set == name]
        return tuple(sorted(rows, key=_place))


def _place(row: BenchRow) -> tuple[bool, bool, float]:
    score = 0.0 if row.time is None else row.time.value
    return row.kind == "privileged", row.time is None, -score
