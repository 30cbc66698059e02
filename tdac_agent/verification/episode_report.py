"""`episodes.json`: how a policy does in many episodes of a task or a task set."""

from __future__ import annotations

import contextlib
import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import AliasChoices, ConfigDict, Field, model_validator

from tdac_agent.metrics.exact import CONFIDENCE, exact_interval
from tdac_agent.metrics.rates import rate_of_runs
from tdac_agent.storage.printable_record import StrictRecord
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.units import Frame, Place, Units, units_in
from tdac_agent.verification.decision import SequentialResult, result_of
from tdac_agent.verification.diagnosis.gap import (
    Gap,
    closest,
    gap_text,
    too_close_text,
)
from tdac_agent.verification.judge.confirming import EndingTest
from tdac_agent.verification.judge.episode_row import EpisodeRow, Scores, scores_of
from tdac_agent.verification.judge.set_checks import Checks
from tdac_agent.verification.suite.contract import (
    ParseError,
    parse_source,
    reads_clock,
)

if TYPE_CHECKING:
    from tdac_envs.ladder.set_limits import CpuSpec

LEAST_GROUP = 5
"""Least number of hidden worlds of a generator whose scores reveal no single world."""
MOST_TOLD = 3
"""Failures whose diagnosis is reported."""
WORST = 20
TOUCHED = {
    "wall": "with a wall",
    "mover": "with a mover",
    "mover_standing": "with a mover while the robot stood",
}
"""How the failures of each contact are told apart."""


class EpisodeProvenance(StrictRecord):
    """What the results apply to; with a number, it determines an episode."""

    model_config = ConfigDict(populate_by_name=True)
    name: str = Field(
        validation_alias=AliasChoices("name", "set", "task"),
        description="Name of the task or the task set.",
    )
    sha256: str = Field(
        validation_alias=AliasChoices("sha256", "set_sha256", "task_sha256"),
        description="Its hash.",
    )
    dynamics: str = Field(
        "",
        description="Hash of all that decides what happens in an episode, code "
        "included; empty before Ladder 1.0.",
    )
    split: str | None = Field(None, description="Split of the worlds of a set.")
    salt_sha256: str | None = Field(
        None,
        description="None for a public salt. For a hidden folder, the hash of its "
        "worlds.",
    )
    first: int = Field(
        0,
        validation_alias=AliasChoices("first", "first_seed"),
        description="Number of the first episode: a seed, or that of a world.",
    )
    disturbance: Disturbance | None = Field(
        None, description="Of a task; a set has its own."
    )
    variation: str | None = Field(None, description="Of start and goal of a task.")
    physics: str = Field("exact", description="What moved the robot.")
    unit: Place = Field("px", description="Unit of positions and lengths.")
    frame: Frame | None = Field(
        None, description="Of a map, where lengths are printed in metres."
    )
    left_out: tuple[str, ...] = Field(
        (), description="Nodes of the world that may be solid and were ignored."
    )
    map_sha256: str = Field("", description="Hash of the map or world of a task.")
    params_sha256: str = ""
    sensors_sha256: str = ""
    controller_sha256: str
    sandbox: str = Field(description="Sandbox tier; `none` without foreign code.")
    limits: dict[str, float] = Field(description="Limits of each episode.")
    warnings: tuple[str, ...] = ()
    versions: dict[str, str]

    @property
    def units(self) -> Units:
        """Units in which figures are printed."""
        return units_in(self.unit, self.frame)


class Interval(StrictRecord):
    """A confidence interval for the success rate.

    Exact (Clopper and Pearson 1934): its coverage is at least `confidence` at any rate.
    Where a world is driven several times, worlds are resampled.
    """

    low: float
    high: float
    confidence: float
    method: Literal["Clopper-Pearson", "bootstrap over worlds"] = "Clopper-Pearson"


class HiddenCount(StrictRecord):
    """What the ledger says about a hidden evaluation."""

    number: int = Field(description="Its number among those of this controller, set.")
    count: int = Field(description="How many there are so far.")
    lineage: int | None = Field(
        None,
        description="How many there are so far of controllers that the same run wrote; "
        "None if no run wrote this one.",
    )
    recorded: str | None = Field(
        None, description="When it was driven, if it was not driven anew (UTC)."
    )


class EpisodeReport(StrictRecord):
    """Independent episodes of a task, by seed, or on worlds of a set, by index."""

    model_config = ConfigDict(populate_by_name=True)
    schema_version: int = 2
    provenance: EpisodeProvenance
    tests: dict[str, str] = Field(
        default_factory=dict,
        description="Static and contract tests on a set: `passed` or `failed`. If one "
        "failed, no episode was driven, and `told` has a line for each that failed.",
    )
    count: int = Field(
        validation_alias=AliasChoices("count", "worlds"),
        description="Number of episodes; with a test, up to its decision.",
    )
    successes: int = Field(description="Goal reached, no contact, no error.")
    interval: Interval | None = Field(
        None, description="Of the success rate; None with a test: it is biased."
    )
    scores: Scores | None = Field(None, description="None with a test, likewise.")
    by_generator: dict[str, Scores] = Field(
        default_factory=dict, description="On a set; empty with a test."
    )
    causes: dict[str, int] = Field(
        default_factory=dict, description="Failures by cause."
    )
    told: tuple[str, ...] = Field(
        (),
        description="Diagnoses, in the frame that the controller observes; none of "
        "hidden worlds.",
    )
    episodes: tuple[EpisodeRow, ...] = Field((), description="Empty for hidden worlds.")
    smallest_gap: Gap | None = Field(
        None, description="Of all episodes; of hidden worlds without its place."
    )
    closest: int | None = Field(
        None, description="Number of the episode with it; None for hidden worlds."
    )
    too_close: int = Field(
        0, description="Episodes that reached the goal but came too close."
    )
    close_gap: Gap | None = Field(
        None, description="Smallest gap that was too close in one of these."
    )
    sequential: SequentialResult | None = None
    child_cpu_seconds: float
    seconds: float
    clock_dependent: str | None = Field(
        None,
        description="Why a slower or busier machine may give other results; None for "
        "a controller that reads no clock and used at most half of its CPU budget.",
    )
    hidden: HiddenCount | None = Field(None, description="Only of hidden worlds.")

    @model_validator(mode="before")
    @classmethod
    def _of_version_1(cls, values: Any) -> Any:
        """Reads `robust.json` of version 1, which had the worst episodes alone."""
        if not isinstance(values, dict) or "failed_seeds" not in values:
            return values
        gone = {"rate", "outcomes", "time_outs", "failed_seeds", "worst", "episodes"}
        kept = {name: each for name, each in values.items() if name not in gone}
        count, worst = values.get("episodes"), values.get("worst")
        return {**kept, "count": count, "episodes": worst}

    @property
    def refused(self) -> bool:
        """Whether a static or contract test failed, so that nothing was driven."""
        return "failed" in self.tests.values()

    @property
    def passed(self) -> bool:
        """Whether the tests and the sequential test accept; True if there was none."""
        if self.refused:
            return False
        return self.sequential is None or self.sequential.decision == "accepted"

    @property
    def rate(self) -> float | None:
        """The success rate; None with a sequential test: it would be biased."""
        return None if self.scores is None else self.scores.success

    @property
    def failures(self) -> tuple[EpisodeRow, ...]:
        """The episodes that failed."""
        return tuple(each for each in self.episodes if not each.success)

    @property
    def outcomes(self) -> dict[str, int]:
        """Number of episodes by outcome."""
        return dict(Counter(each.outcome for each in self.episodes).most_common())

    @property
    def time_outs(self) -> int:
        """Failures by time-out, which a busy machine may cause."""
        return self.causes.get("time-out", 0)

    def gap_lines(self, units: Units, closest: str = "") -> list[str]:
        """What the episodes say of their gaps; nothing if none is on record.

        The place is told on a task alone: worlds of a set have other coordinates than
        a controller observes.

        Args:
            units: Units of the texts.
            closest: Name of the closest episode; by default its seed or its world.
        """
        gap, on_set = self.smallest_gap, self.provenance.split is not None
        if gap is None:
            return []
        text = f"smallest gap: {gap_text(gap, units, placed=not on_set)}"
        if self.closest is not None:
            number = f"{'world' if on_set else 'seed'} {self.closest}"
            text += f", {closest or number}"
        if self.close_gap is None:
            return [text]
        near = too_close_text(self.close_gap, units, placed=not on_set)
        return [text, f"{self.too_close} of the successes came {near}"]

    @property
    def worst(self) -> tuple[EpisodeRow, ...]:
        """The worst episodes, the worst first."""
        return tuple(sorted(self.episodes, key=badness)[:WORST])


def summarise(
    provenance: EpisodeProvenance,
    episodes: Sequence[EpisodeRow],
    test: EndingTest | None,
    seconds: float,
    *,
    told: bool = True,
    different: int | None = None,
    checks: Checks | None = None,
    clock_dependent: str | None = None,
) -> EpisodeReport:
    """Summarises episodes.

    Args:
        provenance: What they apply to.
        episodes: The episodes, in the order of their numbers.
        test: The test that may have stopped them.
        seconds: Wall time, s.
        told: Whether single episodes may be reported.
        different: Number of different worlds, if each is driven several times.
        checks: The static and contract tests. If one failed, there are no episodes.
        clock_dependent: See `clock_dependence`.
    """
    checks = checks or Checks(results={})
    if checks.failures:
        test = None
    failed = [episode for episode in episodes if not episode.success]
    successes = len(episodes) - len(failed)
    groups: dict[str, list[EpisodeRow]] = {}
    for episode in episodes:
        if episode.generator is not None:
            groups.setdefault(episode.generator, []).append(episode)
    if not told:
        groups = {name: own for name, own in groups.items() if len(own) >= LEAST_GROUP}
    scored = test is None and bool(episodes)
    near = closest((each.number, each.smallest_gap) for each in episodes)
    close = [each for each in episodes if each.too_close]
    tightest = closest((each.number, each.close_gap) for each in close)
    texts = [each.text or f"{named(each)}: {each.error}" for each in failed]
    return EpisodeReport(
        provenance=provenance,
        tests=checks.outcomes,
        count=len(episodes),
        successes=successes,
        interval=_interval(episodes, different) if scored else None,
        scores=scores_of(episodes) if scored else None,
        by_generator=(
            {name: scores_of(group) for name, group in groups.items()} if scored else {}
        ),
        causes=dict(Counter(cause_of(episode) for episode in failed).most_common()),
        told=checks.failures or (tuple(texts[:MOST_TOLD]) if told else ()),
        episodes=tuple(episodes) if told else (),
        smallest_gap=None if near is None else near[1],
        closest=near[0] if near is not None and told else None,
        too_close=len(close),
        close_gap=None if tightest is None else tightest[1],
        sequential=None if test is None else result_of(test, episodes),
        child_cpu_seconds=round(sum(e.cpu_seconds for e in episodes), 3),
        seconds=round(seconds, 3),
        clock_dependent=clock_dependent,
    )


def named(episode: EpisodeRow) -> str:
    """Name of an episode in texts."""
    if episode.seed is not None:
        return f"seed {episode.seed}"
    return f"world {episode.index}"


def _interval(episodes: Sequence[EpisodeRow], different: int | None) -> Interval | None:
    """The interval of the success rate; its unit is the world."""
    successes = sum(episode.success for episode in episodes)
    if different is None or len(episodes) <= different:
        return success_interval(successes, len(episodes))
    passed, tried = np.zeros(different, int), np.zeros(different, int)
    for episode in episodes:
        passed[episode.number % different] += episode.success
        tried[episode.number % different] += 1
    if ((passed == 0) | (passed == tried)).all():
        return success_interval(int((passed > 0).sum()), different)
    rate = rate_of_runs(passed, tried)
    if math.isnan(rate.low):
        return None
    ends = {"low": rate.low, "high": rate.high, "confidence": CONFIDENCE}
    return Interval(**ends, method="bootstrap over worlds")


def success_interval(successes: int, episodes: int) -> Interval:
    """The exact interval of a success rate."""
    low, high = exact_interval(successes, episodes)
    return Interval(low=low, high=high, confidence=CONFIDENCE)


def badness(episode: EpisodeRow) -> tuple[bool, float, int]:
    """Sort key, worst first: failures by share of path left, then slow successes."""
    if episode.success or not episode.d0:
        return episode.success, -episode.steps, episode.number
    return False, -(episode.d_min or 0.0) / episode.d0, episode.number


def cause_of(episode: EpisodeRow) -> str:
    """Why an episode failed, with what the robot touched."""
    cause = str(episode.cause or episode.outcome)
    return f"{cause} {TOUCHED[episode.contact]}" if episode.contact else cause


def clock_dependence(
    source: bytes, episodes: Sequence[EpisodeRow], budget: CpuSpec
) -> str | None:
    """Why a slower or busier machine may give other results; None if it may not."""
    with contextlib.suppress(ParseError):
        if reads_clock(parse_source(source)):
            return "it reads the clock"
    used = [e.cpu_seconds / (budget.start + budget.of_steps(e.steps)) for e in episodes]
    over = sum(share > 0.5 for share in used)
    if over == 0:
        return None
    return f"in {over} of {len(used)} episodes it used over half of its CPU budget"
