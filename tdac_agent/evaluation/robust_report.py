"""`robust.json`: the success rate of a controller under disturbances."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Literal

from pydantic import ConfigDict, Field

from tdac_agent.episodes.trajectory import Outcome
from tdac_agent.metrics.exact import CONFIDENCE, exact_interval
from tdac_agent.storage.printable_record import PrintableRecord
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.units import Place
from tdac_agent.verification.judge.seeded import SeededEpisode
from tdac_agent.verification.judge.sequential import (
    Characteristics,
    Decision,
    SequentialTest,
)

WORST = 20


class _Record(PrintableRecord):
    model_config = ConfigDict(extra="forbid", frozen=True)


class RobustProvenance(_Record):
    """What the results apply to; together with a seed, it determines an episode."""

    task: str
    task_sha256: str
    unit: Place = Field("px", description="Unit of positions and lengths.")
    left_out: tuple[str, ...] = Field(
        (), description="Nodes of the world that may be solid and were ignored."
    )
    map_sha256: str = Field(description="Hash of the map or world.")
    params_sha256: str
    sensors_sha256: str
    controller_sha256: str
    disturbance: Disturbance
    first_seed: int
    sandbox: str = Field(description="Sandbox tier.")
    limits: dict[str, float] = Field(description="Limits of each episode.")
    warnings: tuple[str, ...] = ()
    versions: dict[str, str]


class Interval(_Record):
    """A confidence interval for the success rate.

    Exact (Clopper and Pearson 1934): its coverage is at least `confidence` at any rate.
    Where a world is driven several times, worlds are resampled.
    """

    low: float
    high: float
    confidence: float
    method: Literal["Clopper-Pearson", "bootstrap over worlds"] = "Clopper-Pearson"


class SequentialResult(_Record):
    """The decision of a sequential test, and its error rates."""

    decision: Decision
    test: SequentialTest
    refuse_at: float = Field(description="Success rate that the test should reject.")
    at_refused_rate: Characteristics
    at_accepted_rate: Characteristics


class RobustReport(_Record):
    """A robust verification: independent episodes, each with its own seed."""

    schema_version: Literal[1] = 1
    provenance: RobustProvenance
    episodes: int = Field(description="Episodes; with a test, up to its decision.")
    successes: int = Field(description="Goal reached, no contact, no error.")
    rate: float | None = Field(description="None with a test: it would be biased.")
    interval: Interval | None = Field(description="None with a test, likewise.")
    outcomes: dict[Outcome, int]
    time_outs: int = Field(
        description="Failures by time-out, which a busy machine may cause."
    )
    failed_seeds: tuple[int, ...]
    worst: tuple[SeededEpisode, ...] = Field(description="Worst episodes first.")
    sequential: SequentialResult | None = None
    child_cpu_seconds: float
    seconds: float

    @property
    def accepted(self) -> bool:
        """Whether the sequential test accepts; True if there was none."""
        return self.sequential is None or self.sequential.decision == "accepted"


def summarise(
    provenance: RobustProvenance,
    episodes: Sequence[SeededEpisode],
    test: SequentialTest | None,
    seconds: float,
) -> RobustReport:
    """Summarises episodes, which are in the order of their seeds."""
    failed = [episode.seed for episode in episodes if not episode.success]
    count, successes = len(episodes), len(episodes) - len(failed)
    return RobustReport(
        provenance=provenance,
        episodes=count,
        successes=successes,
        rate=None if test else successes / count,
        interval=None if test else success_interval(successes, count),
        outcomes=dict(Counter(e.outcome for e in episodes).most_common()),
        time_outs=sum(e.cause == "time-out" for e in episodes),
        failed_seeds=tuple(failed),
        worst=tuple(sorted(episodes, key=badness)[:WORST]),
        sequential=None if test is None else result_of(test, successes, len(failed)),
        child_cpu_seconds=round(sum(e.cpu_seconds for e in episodes), 3),
        seconds=round(seconds, 3),
    )


def success_interval(successes: int, episodes: int) -> Interval:
    """The exact interval of a success rate."""
    low, high = exact_interval(successes, episodes)
    return Interval(low=low, high=high, confidence=CONFIDENCE)


def badness(episode: SeededEpisode) -> tuple[bool, float, int]:
    """Sort key, worst first: failures by share of path left, then slow successes."""
    if episode.success:
        return True, -episode.steps, episode.seed
    return False, -episode.d_min / episode.d0, episode.seed


def result_of(test: SequentialTest, successes: int, failures: int) -> SequentialResult:
    """The decision of a test, with its error rates."""
    return SequentialResult(
        decision=test.decide(successes, failures),
        test=test,
        refuse_at=test.refuse_at,
        at_refused_rate=test.characteristics(test.refuse_at),
        at_accepted_rate=test.characteristics(test.accept_at),
    )


def decision_text(result: SequentialResult) -> str:
    """What a sequential test decided."""
    if result.decision == "accepted":
        return f"accepted at {percent(result.test.accept_at)}"
    if result.decision == "rejected":
        return f"rejected at {percent(result.test.accept_at)}"
    return "undecided, therefore not accepted,"


def percent(share: float) -> str:
    """A percentage with one decimal; with three if it would round to 0 or 100 %."""
    rounded = f"{100 * share:.1f}"
    if rounded in ("0.0", "100.0") and 0.0 < share < 1.0:
        rounded = f"{100 * share:.3f}"
    return f"{rounded} %"
