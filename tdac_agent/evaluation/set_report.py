"""`set.json`: how a controller does on worlds of a task set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from statistics import fmean

from pydantic import ConfigDict, Field

from tdac_agent.evaluation.robust_report import (
    Interval,
    SequentialResult,
    result_of,
    success_interval,
)
from tdac_agent.storage.printable_record import PrintableRecord
from tdac_agent.verification.judge.sequential import SequentialTest
from tdac_agent.verification.judge.set_job import WorldEpisode

MOST_TOLD = 3
"""Failures whose diagnosis is reported."""


class _Record(PrintableRecord):
    model_config = ConfigDict(extra="forbid", frozen=True)


class SetProvenance(_Record):
    """What the results apply to."""

    set: str
    set_sha256: str
    split: str
    salt_sha256: str | None = Field(description="None for a public salt.")
    controller_sha256: str
    sandbox: str = Field(description="Sandbox tier.")
    limits: dict[str, float] = Field(description="Limits of each episode.")
    versions: dict[str, str]


class Scores(_Record):
    """Means over a fixed number of worlds, each in [0, 1]."""

    success: float
    time: float = Field(description="Success weighted by completion time, SCT.")
    path: float = Field(description="Success weighted by path length, SPL.")
    barn: float = Field(description="The metric of BARN, at most 0.5.")


class SetReport(_Record):
    """Episodes on consecutive worlds of a set."""

    schema_version: int = 1
    provenance: SetProvenance
    worlds: int = Field(description="Episodes; with a test, up to its decision.")
    successes: int
    interval: Interval | None = Field(description="None with a test: it is biased.")
    scores: Scores | None = Field(description="None with a test, likewise.")
    by_generator: dict[str, Scores] = Field(description="Empty with a test.")
    causes: dict[str, int] = Field(description="Failures by cause.")
    told: tuple[str, ...] = Field(description="Diagnoses; empty for hidden worlds.")
    episodes: tuple[WorldEpisode, ...] = Field(description="Empty for hidden worlds.")
    sequential: SequentialResult | None = None
    child_cpu_seconds: float
    seconds: float

    @property
    def passed(self) -> bool:
        """Whether the sequential test accepts; True if there was none."""
        return self.sequential is None or self.sequential.decision == "accepted"


def summarise(
    provenance: SetProvenance,
    episodes: Sequence[WorldEpisode],
    test: SequentialTest | None,
    seconds: float,
    *,
    told: bool,
) -> SetReport:
    """Summarises episodes.

    Args:
        provenance: What they apply to.
        episodes: The episodes, in the order of worlds.
        test: The sequential test that may have stopped them.
        seconds: Wall time, s.
        told: Whether single worlds may be reported.
    """
    failed = [episode for episode in episodes if not episode.success]
    successes = len(episodes) - len(failed)
    groups: dict[str, list[WorldEpisode]] = {}
    for episode in episodes:
        groups.setdefault(episode.generator, []).append(episode)
    texts = [each.text or f"world {each.index}: {each.error}" for each in failed]
    return SetReport(
        provenance=provenance,
        worlds=len(episodes),
        successes=successes,
        interval=None if test else success_interval(successes, len(episodes)),
        scores=None if test else scores_of(episodes),
        by_generator=(
            {} if test else {name: scores_of(group) for name, group in groups.items()}
        ),
        causes=dict(Counter(str(e.cause or e.outcome) for e in failed).most_common()),
        told=tuple(texts[:MOST_TOLD]) if told else (),
        episodes=tuple(episodes) if told else (),
        sequential=None if test is None else result_of(test, successes, len(failed)),
        child_cpu_seconds=round(sum(e.cpu_seconds for e in episodes), 3),
        seconds=round(seconds, 3),
    )


def scores_of(episodes: Sequence[WorldEpisode]) -> Scores:
    """The mean scores of some episodes."""
    return Scores(
        success=fmean(e.success for e in episodes),
        time=fmean(e.time_score for e in episodes),
        path=fmean(e.path_score for e in episodes),
        barn=fmean(e.barn_score for e in episodes),
    )
