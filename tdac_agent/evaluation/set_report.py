"""`set.json`: how a controller does on worlds of a task set."""

from __future__ import annotations

import contextlib
import math
from collections import Counter
from collections.abc import Sequence
from statistics import fmean

import numpy as np
from pydantic import ConfigDict, Field

from tdac_agent.evaluation.robust_report import (
    Interval,
    SequentialResult,
    result_of,
    success_interval,
)
from tdac_agent.metrics.exact import CONFIDENCE
from tdac_agent.metrics.rates import rate_of_runs
from tdac_agent.runs.selection_record import Scores
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.storage.printable_record import PrintableRecord
from tdac_agent.tasks.provenance import versions
from tdac_agent.verification.judge.sequential import SequentialTest
from tdac_agent.verification.judge.set_checks import Checks
from tdac_agent.verification.judge.set_job import WorldEpisode
from tdac_agent.verification.suite.contract import (
    ParseError,
    parse_source,
    reads_clock,
)
from tdac_envs.ladder.set_file import CpuSpec
from tdac_envs.ladder.task_sets import TaskSet

LEAST_GROUP = 5
"""Least number of hidden worlds of a generator whose scores reveal no single world."""
MOST_TOLD = 3
"""Failures whose diagnosis is reported."""
TOUCHED = {
    "wall": "with a wall",
    "mover": "with a mover",
    "mover_standing": "with a mover while the robot stood",
}
"""How the failures of each contact are told apart."""


class _Record(PrintableRecord):
    model_config = ConfigDict(extra="forbid", frozen=True)


class SetProvenance(_Record):
    """What the results apply to."""

    set: str
    set_sha256: str
    split: str
    salt_sha256: str | None = Field(
        description="None for a public salt. For a hidden folder, the hash of its "
        "worlds."
    )
    controller_sha256: str
    sandbox: str = Field(description="Sandbox tier.")
    limits: dict[str, float] = Field(description="Limits of each episode.")
    versions: dict[str, str]

    @classmethod
    def unconfined(
        cls, tasks: TaskSet, split: str, salt: bytes | None, sha256: str
    ) -> SetProvenance:
        """That of episodes in which no code of strangers runs: without a sandbox."""
        return cls(
            set=tasks.name,
            set_sha256=tasks.sha256,
            split=split,
            salt_sha256=None if salt is None else sha256_of(salt),
            controller_sha256=sha256,
            sandbox="none",
            limits={},
            versions=dict(versions()),
        )


class HiddenCount(_Record):
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


class SetReport(_Record):
    """Episodes on consecutive worlds of a set."""

    schema_version: int = 1
    provenance: SetProvenance
    tests: dict[str, str] = Field(
        default_factory=dict,
        description="Static and contract tests: `passed` or `failed`. If one failed, "
        "no episode was driven, and `told` has a line for each that failed.",
    )
    worlds: int = Field(description="Episodes; with a test, up to its decision.")
    successes: int
    interval: Interval | None = Field(description="None with a test: it is biased.")
    scores: Scores | None = Field(description="None with a test, likewise.")
    by_generator: dict[str, Scores] = Field(description="Empty with a test.")
    causes: dict[str, int] = Field(description="Failures by cause.")
    told: tuple[str, ...] = Field(
        description="Diagnoses, in the frame that the controller observes; none of "
        "hidden worlds."
    )
    episodes: tuple[WorldEpisode, ...] = Field(description="Empty for hidden worlds.")
    sequential: SequentialResult | None = None
    child_cpu_seconds: float
    seconds: float
    clock_dependent: str | None = Field(
        None,
        description="Why a slower or busier machine may give other results; None for "
        "a controller that reads no clock and used at most half of its CPU budget.",
    )
    hidden: HiddenCount | None = Field(None, description="Only of hidden worlds.")

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


def summarise(
    provenance: SetProvenance,
    episodes: Sequence[WorldEpisode],
    test: SequentialTest | None,
    seconds: float,
    *,
    per_world: bool,
    different: int | None = None,
    checks: Checks | None = None,
    clock_dependent: str | None = None,
) -> SetReport:
    """Summarises episodes.

    Args:
        provenance: What they apply to.
        episodes: The episodes, in the order of worlds.
        test: The sequential test that may have stopped them.
        seconds: Wall time, s.
        per_world: Whether single worlds may be reported.
        different: Number of different worlds, if each is driven several times.
        checks: The static and contract tests. If one failed, there are no episodes.
        clock_dependent: See `clock_dependence`.
    """
    checks = checks or Checks(results={})
    if checks.failures:
        test = None
    failed = [episode for episode in episodes if not episode.success]
    successes = len(episodes) - len(failed)
    groups: dict[str, list[WorldEpisode]] = {}
    for episode in episodes:
        groups.setdefault(episode.generator, []).append(episode)
    if not per_world:
        groups = {name: own for name, own in groups.items() if len(own) >= LEAST_GROUP}
    scored = test is None and bool(episodes)
    texts = [each.text or f"world {each.index}: {each.error}" for each in failed]
    return SetReport(
        provenance=provenance,
        tests=checks.outcomes,
        worlds=len(episodes),
        successes=successes,
        interval=_interval(episodes, different) if scored else None,
        scores=scores_of(episodes) if scored else None,
        by_generator=(
            {name: scores_of(group) for name, group in groups.items()} if scored else {}
        ),
        causes=dict(Counter(cause_of(episode) for episode in failed).most_common()),
        told=checks.failures or (tuple(texts[:MOST_TOLD]) if per_world else ()),
        episodes=tuple(episodes) if per_world else (),
        sequential=None if test is None else result_of(test, successes, len(failed)),
        child_cpu_seconds=round(sum(e.cpu_seconds for e in episodes), 3),
        seconds=round(seconds, 3),
        clock_dependent=clock_dependent,
    )


def _interval(
    episodes: Sequence[WorldEpisode], different: int | None
) -> Interval | None:
    """The interval of the success rate; its unit is the world."""
    successes = sum(episode.success for episode in episodes)
    if different is None or len(episodes) <= different:
        return success_interval(successes, len(episodes))
    passed, tried = np.zeros(different, int), np.zeros(different, int)
    for episode in episodes:
        passed[episode.index % different] += episode.success
        tried[episode.index % different] += 1
    if ((passed == 0) | (passed == tried)).all():
        return success_interval(int((passed > 0).sum()), different)
    rate = rate_of_runs(passed, tried)
    if math.isnan(rate.low):
        return None
    ends = {"low": rate.low, "high": rate.high, "confidence": CONFIDENCE}
    return Interval(**ends, method="bootstrap over worlds")


def cause_of(episode: WorldEpisode) -> str:
    """Why an episode failed, with what the robot touched."""
    cause = str(episode.cause or episode.outcome)
    return f"{cause} {TOUCHED[episode.contact]}" if episode.contact else cause


def clock_dependence(
    source: bytes, episodes: Sequence[WorldEpisode], budget: CpuSpec
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


def scores_of(episodes: Sequence[WorldEpisode]) -> Scores:
    """The mean scores of some episodes."""
    return Scores(
        success=fmean(e.success for e in episodes),
        time=fmean(e.time_score for e in episodes),
        path=fmean(e.path_score for e in episodes),
        barn=fmean(e.barn_score for e in episodes),
    )
