"""`report.json` of a run on a task set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from pydantic import AliasChoices, ConfigDict, Field

from tdac_agent.storage.printable_record import StrictRecord, read_record
from tdac_agent.verification.judge.episode_row import Scores

SELECTION_FILE = "report.json"
HIDDEN_FILE = "hidden.json"
"""Report on the selected controller on hidden worlds: sums alone."""


def asked_text(kind: str, parents: Sequence[tuple[int, int]]) -> str:
    """What a candidate was asked for: `first answer`, `repair of 3`, `informed`."""
    names = " and ".join(f"{k}.{j}" if j else f"{k}" for k, j in parents)
    word = {"fresh": "first question", "given": "given"}.get(kind, kind)
    return f"{word} of {names}" if names else word


def losses_text(before: Mapping[str, float], after: Mapping[str, float]) -> str:
    """How the losses by cause changed: `failure 0.100 -> 0.030, detour …`."""
    parts = [
        f"{name} {before[name]:.3f} -> {after.get(name, 0.0):.3f}"
        for name in before
        if max(before[name], after.get(name, 0.0)) >= 0.001
    ]
    return ", ".join(parts)


class CandidateFigures(StrictRecord):
    """How a candidate drove, in numbers of worlds of `dev`."""

    k: int
    j: int
    controller_sha256: str
    feedback_worlds: int
    feedback_reached: int
    validation_worlds: int
    validation_reached: int
    validation_time: float | None = Field(
        description="Mean time score; None without validation worlds."
    )
    improve_time: float | None = Field(
        None, description="Mean time score in the pool of a race, if it drove there."
    )
    asked: str = Field("", description="Kind of the question that it answers.")
    parents: tuple[tuple[int, int], ...] = Field(
        (), description="(k, j) of the candidates that the question was about."
    )
    pool_worlds: int = Field(0, description="Worlds of the pool that it drove on.")
    pool_reached: int = 0
    lost: dict[str, float] = Field(
        {}, description="Mean shares of the score that it lost there, by cause."
    )


class Improvement(StrictRecord):
    """The selected controller beside what it improves, on worlds that decided nothing.

    Both drove on the same worlds. The interval is that of a paired bootstrap over
    worlds, with 95 % confidence.
    """

    variations: int = Field(description="Number of variations that drove.")
    k: int = Field(description="Iteration of the best candidate before the search.")
    j: int = Field(description="Its edit.")
    worlds: int = Field(description="0 if this candidate was selected.")
    before: float | None = Field(None, description="Its mean time score.")
    after: float | None = Field(None, description="That of the selected one.")
    low: float | None = Field(None, description="Lower end of the difference.")
    high: float | None = Field(None, description="Upper end of the difference.")
    p: float | None = Field(
        None,
        description="p-value of no difference; not below what so few worlds can show.",
    )
    lost_before: dict[str, float] = Field(
        {}, description="Mean shares of the score that the first one lost, by cause."
    )
    lost_after: dict[str, float] = Field({}, description="Those of the selected one.")
    reached_before: int | None = Field(
        None, description="Number of worlds in which the first one reached the goal."
    )
    reached_after: int | None = Field(None, description="That of the selected one.")


class Selection(StrictRecord):
    """`report.json` of a run on a task set: what was selected, and from what.

    The figures of the selected candidate are optimistic: it was chosen by them.
    """

    schema_version: int = 1
    set: str
    set_sha256: str
    dynamics: str = Field(
        "", description="Hash of the set with its code; empty before Ladder 1.0."
    )
    split: str = "dev"
    first_feedback: int = Field(description="Number of the first feedback world.")
    first_validation: int = Field(description="Number of the first validation world.")
    episodes: int = Field(description="Limit of simulated episodes of the loop.")
    feedback_used: int
    validation_used: int
    search: str = Field("", description="`paper` or `race`.")
    improve: int = Field(0, description="Limit of further episodes.")
    improve_used: int = Field(0, description="By variations and by the comparison.")
    candidates: tuple[CandidateFigures, ...]
    k: int = Field(description="Iteration of the selected candidate.")
    j: int = Field(description="Its edit.")
    controller_sha256: str
    optimistic: Scores | None = Field(
        description="Its scores on validation worlds; None without any."
    )
    improvement: Improvement | None = Field(
        None, description="None without a search for improvements."
    )
    stopped: str = Field("", description="What ended the writing early.")

    @property
    def used(self) -> int:
        """Number of simulated episodes on `dev`."""
        return self.feedback_used + self.validation_used + self.improve_used


def read_selection(folder: Path) -> Selection | None:
    """What a run selected; None if there is no readable record."""
    return read_record(Selection, folder, SELECTION_FILE)


class HiddenCounts(StrictRecord):
    """How often the selected controller reached the goal on hidden worlds."""

    model_config = ConfigDict(extra="ignore")

    count: int = Field(validation_alias=AliasChoices("count", "worlds"))
    successes: int


def read_hidden(folder: Path) -> HiddenCounts | None:
    """The counts of a run on hidden worlds; None if there is no readable record."""
    return read_record(HiddenCounts, folder, HIDDEN_FILE)
