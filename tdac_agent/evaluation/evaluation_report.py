"""The results of an evaluation: a row per policy and task, and comparisons."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import combinations
from statistics import fmean, median
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field

from tdac_agent.episodes.trajectory import Outcome
from tdac_agent.evaluation.robust_report import Interval, success_interval
from tdac_agent.metrics.exact import sign_test
from tdac_agent.storage.printable_record import PrintableRecord
from tdac_agent.tasks.units import Place
from tdac_agent.verification.diagnosis.measures import Measured
from tdac_agent.verification.judge.drivers import Kind

if TYPE_CHECKING:
    import pandas as pd

MOST_REASONS = 3
_DIGITS = 6


class _Record(PrintableRecord):
    model_config = ConfigDict(extra="forbid", frozen=True)


class EvaluatedTask(_Record):
    """A task of the evaluation."""

    name: str
    called: str = Field("", description="Display name; with details unless bundled.")
    task_sha256: str
    map_sha256: str
    unit: Place = Field(description="Unit of lengths.")
    body_radius: float


class EvaluatedPolicy(_Record):
    """A policy of the evaluation."""

    name: str
    kind: Kind
    knows: str = Field(description="Information that it may use.")
    wrappers: tuple[str, ...] = ()
    sha256: str | None = Field(None, description="Hash of its file, if any.")


class PolicyRow(_Record):
    """One policy on one task. Medians over successes are None without a success."""

    task: str
    policy: str
    knows: str
    episodes: int
    successes: int
    rate: float
    interval: Interval
    collided: int = Field(description="Episodes with a contact.")
    outcomes: dict[Outcome, int]
    time_ratio: float | None = Field(
        description="Median over successes: time / shortest path's time at full speed."
    )
    path_ratio: float | None = Field(
        description="Median over successes: length driven / shortest path's length."
    )
    spl: float = Field(
        description="Success weighted by path length (Anderson et al. 2018)."
    )
    smoothness: float | None = Field(
        description="Median over successes: spectral arc length of the speed (SPARC)."
    )
    clearance_min: float = Field(description="Smallest gap to the body; 0 if touched.")
    clearance_mean: float = Field(description="Mean over the episodes' mean gaps.")
    reasons: dict[str, int] = Field(description="Most frequent errors, counted.")
    controller_sha256: str | None = None
    sandbox: str = Field(description="Sandbox tier; none if it needs no sandbox.")
    note: str | None = None


class PairedComparison(_Record):
    """Two policies on the same seeds of a task: exact McNemar test, two-sided.

    Under the null hypothesis, either policy wins half of the episodes in which exactly
    one of them succeeds. The p-value is not corrected for multiple comparisons.
    """

    task: str
    one: str
    other: str
    equal_information: str | None = Field(
        description="Information that both may use; None if it differs."
    )
    both: int
    only_one: int
    only_other: int
    neither: int
    p: float


class Timing(_Record):
    """Wall time of the calls of a policy; differs between evaluations."""

    task: str
    policy: str
    calls: int
    median_ms: float
    p99_ms: float


class Result(_Record):
    """The episodes of one policy on one task, in the order of the seeds."""

    task: str
    policy: str
    knows: str
    episodes: tuple[Measured, ...]
    sandbox: str
    controller_sha256: str | None = None
    note: str | None = None


class Evaluation(_Record):
    """Policies on the same tasks and seeds, by the same judge.

    The JSON form depends on the arguments only, not on wall times.
    """

    schema_version: Literal[1] = 1
    variation: str
    seed: int
    episodes: int = Field(description="Episodes of each policy on each task.")
    tasks: tuple[EvaluatedTask, ...]
    policies: tuple[EvaluatedPolicy, ...]
    rows: tuple[PolicyRow, ...]
    comparisons: tuple[PairedComparison, ...]
    versions: dict[str, str]
    results: tuple[Result, ...] = Field(exclude=True)
    timings: tuple[Timing, ...] = Field(exclude=True)

    @property
    def all_crashed(self) -> bool:
        """Whether each policy failed with an error of its own in every episode."""
        return all(row.outcomes.get("error", 0) == row.episodes for row in self.rows)

    def to_frame(self) -> pd.DataFrame:
        """Tidy data with a row for each episode; lengths in the unit of its task."""
        import pandas as pd

        units = {task.name: task.unit for task in self.tasks}
        return pd.DataFrame(
            [
                {
                    "task": result.task,
                    "policy": result.policy,
                    "knows": result.knows,
                    "unit": units[result.task],
                    "episode": number,
                    "success": episode.success,
                    **episode.model_dump(),
                }
                for result in self.results
                for number, episode in enumerate(result.episodes)
            ]
        )

    def timing_frame(self) -> pd.DataFrame:
        """A row for each policy on each task: call times, ms."""
        import pandas as pd

        return pd.DataFrame([timing.model_dump() for timing in self.timings])


def row_of(result: Result) -> PolicyRow:
    """The row for one policy on one task."""
    episodes = result.episodes
    successes = [episode for episode in episodes if episode.success]
    reasons = Counter(e.error for e in episodes if e.error is not None)
    count = len(episodes)
    return PolicyRow(
        task=result.task,
        policy=result.policy,
        knows=result.knows,
        episodes=count,
        successes=len(successes),
        rate=len(successes) / count,
        interval=success_interval(len(successes), count),
        collided=sum(episode.collisions > 0 for episode in episodes),
        outcomes=dict(Counter(e.outcome for e in episodes).most_common()),
        time_ratio=_median(e.time_ratio for e in successes),
        path_ratio=_median(e.path_ratio for e in successes),
        spl=round(
            sum(1.0 / max(e.path_ratio or 1.0, 1.0) for e in successes) / count, 6
        ),
        smoothness=_median(e.smoothness for e in successes),
        clearance_min=min(e.clearance_min for e in episodes),
        clearance_mean=round(fmean(e.clearance_mean for e in episodes), _DIGITS),
        reasons=dict(reasons.most_common(MOST_REASONS)),
        controller_sha256=result.controller_sha256,
        sandbox=result.sandbox,
        note=result.note,
    )


def _median(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return round(median(known), _DIGITS) if known else None


def comparisons_of(results: Sequence[Result]) -> tuple[PairedComparison, ...]:
    """Compares all pairs of policies on each task; those of equal information first."""
    pairs = [
        compare(one, other)
        for one, other in combinations(results, 2)
        if one.task == other.task
    ]
    return tuple(sorted(pairs, key=lambda pair: pair.equal_information is None))


def compare(one: Result, other: Result) -> PairedComparison:
    """Compares two policies.

    Raises:
        ValueError: The results are not of the same task and seeds.
    """
    seeds = [[episode.seed for episode in r.episodes] for r in (one, other)]
    if one.task != other.task or seeds[0] != seeds[1]:
        raise ValueError(f"{one.policy} and {other.policy} drove different episodes")
    ours = [episode.success for episode in one.episodes]
    theirs = [episode.success for episode in other.episodes]
    table = Counter(zip(ours, theirs, strict=True))
    first, second = table[True, False], table[False, True]
    return PairedComparison(
        task=one.task,
        one=one.policy,
        other=other.policy,
        equal_information=one.knows if one.knows == other.knows else None,
        both=table[True, True],
        only_one=first,
        only_other=second,
        neither=table[False, False],
        p=sign_test(first, second),
    )


def timing_of(task: str, policy: str, calls: NDArray[np.float32]) -> Timing:
    """Median and 99th percentile of call times, which are given in s."""
    times = 1000.0 * np.asarray(calls, np.float64) if len(calls) else np.zeros(1)
    middle, late = np.percentile(times, (50, 99)).tolist()
    return Timing(
        task=task,
        policy=policy,
        calls=len(calls),
        median_ms=round(middle, 4),
        p99_ms=round(late, 4),
    )
