"""The results of an evaluation: a row per policy and problem, and comparisons."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from statistics import fmean, median
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from tdac_agent.episodes.trajectory import Outcome
from tdac_agent.metrics.exact import sign_test
from tdac_agent.storage.printable_record import StrictRecord
from tdac_agent.tasks.units import Place
from tdac_agent.verification.episode_report import EpisodeReport, Interval
from tdac_agent.verification.judge.episode_row import EpisodeRow, Scores
from tdac_agent.verification.judge.policy_spec import Kind

if TYPE_CHECKING:
    import pandas as pd

MOST_REASONS = 3
_DIGITS = 6


class EvaluatedProblem(StrictRecord):
    """A task or a task set of the evaluation."""

    name: str
    called: str = Field("", description="Display name; with details unless bundled.")
    sha256: str
    dynamics: str = Field(
        "", description="The same with the code; empty before Ladder 1.0."
    )
    map_sha256: str | None = Field(None, description="Of the map or world of a task.")
    split: str | None = Field(None, description="Of a set.")
    unit: Place = Field(description="Unit of lengths.")


class EvaluatedPolicy(StrictRecord):
    """A policy of the evaluation."""

    name: str
    kind: Kind
    wrappers: tuple[str, ...] = ()
    sha256: str | None = Field(None, description="Hash of its file, if any.")


class PolicyRow(StrictRecord):
    """One policy on one problem. Medians over successes are None without a success."""

    task: str = Field(description="The task or the task set.")
    policy: str
    knows: str = Field(description="Information that it may use.")
    episodes: int = Field(description="0 if tests refused it on a set.")
    successes: int
    rate: float | None
    interval: Interval | None
    scores: Scores | None
    by_generator: dict[str, Scores] = Field(description="Empty on a task.")
    collided: int = Field(description="Episodes with a contact.")
    outcomes: dict[Outcome, int]
    causes: dict[str, int] = Field(description="Failures by cause.")
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
    smallest_gap: float | None = Field(
        None, description="Smallest gap between body and obstacles; 0 if touched."
    )
    too_close: int = Field(
        0, description="Successes with a smaller gap than the required one."
    )
    clearance_min: float | None = Field(
        description="Smallest gap at the ends of steps, on the lattice of pixels."
    )
    clearance_mean: float | None = Field(
        description="Mean over the episodes' mean gaps."
    )
    reasons: dict[str, int] = Field(description="Most frequent errors, counted.")
    told: tuple[str, ...] = Field(description="Up to three failures.")
    controller_sha256: str | None = None
    sandbox: str = Field(description="Sandbox tier; none if it needs no sandbox.")
    note: str | None = None


class PairedComparison(StrictRecord):
    """Two policies in the same episodes: exact McNemar test, two-sided.

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


class Timing(StrictRecord):
    """Wall time of the calls of a policy; differs between evaluations."""

    task: str
    policy: str
    calls: int
    median_ms: float
    p99_ms: float


@dataclass(frozen=True, slots=True)
class Result:
    """One policy on one problem, in the order of the episodes.

    Attributes:
        task: Name of the task or task set.
        policy: Name of the policy.
        knows: What it may use.
        report: What it did.
        note: What to say of it, if anything.
    """

    task: str
    policy: str
    knows: str
    report: EpisodeReport
    note: str | None = None

    @property
    def episodes(self) -> tuple[EpisodeRow, ...]:
        """Its episodes."""
        return self.report.episodes


class Evaluation(StrictRecord):
    """Policies in the same episodes of the same problems, by the same judge.

    The JSON form depends on the arguments only, not on wall times.
    """

    schema_version: Literal[2] = 2
    variation: str | None = Field(description="Of the starts of tasks.")
    seed: int | None = Field(description="Of the episodes of tasks.")
    episodes: int = Field(description="Episodes of each policy on each problem.")
    physics: str = Field("exact", description="What moved the robots.")
    tasks: tuple[EvaluatedProblem, ...]
    policies: tuple[EvaluatedPolicy, ...]
    rows: tuple[PolicyRow, ...]
    comparisons: tuple[PairedComparison, ...]
    versions: dict[str, str]
    results: tuple[Result, ...] = Field((), exclude=True)
    timings: tuple[Timing, ...] = Field((), exclude=True)

    @property
    def all_crashed(self) -> bool:
        """Whether each policy failed with an error of its own in every episode."""
        return all(row.outcomes.get("error", 0) == row.episodes for row in self.rows)

    def of(self, task: str) -> tuple[PolicyRow, ...]:
        """The rows of a problem."""
        return tuple(row for row in self.rows if row.task == task)

    def to_frame(self) -> pd.DataFrame:
        """Tidy data with a row for each episode; lengths in the unit of its task."""
        import pandas as pd

        return pd.DataFrame(self._episodes()).dropna(axis="columns", how="all")

    def _episodes(self) -> Iterator[dict[str, Any]]:
        about = {each.name: each for each in self.tasks}
        for result in self.results:
            own = about[result.task]
            for number, episode in enumerate(result.episodes):
                gap = episode.smallest_gap
                yield {
                    "task": result.task,
                    "split": own.split,
                    "policy": result.policy,
                    "knows": result.knows,
                    "unit": own.unit,
                    "episode": number,
                    "success": episode.success,
                    **episode.model_dump(exclude={"cpu_seconds", "smallest_gap"}),
                    "smallest_gap": gap and gap.gap,
                    "too_close": gap and episode.too_close,
                }

    def timing_frame(self) -> pd.DataFrame:
        """A row for each policy on each problem: call times, ms."""
        import pandas as pd

        return pd.DataFrame([timing.model_dump() for timing in self.timings])


def row_of(result: Result) -> PolicyRow:
    """The row for one policy on one problem."""
    episodes, report = result.episodes, result.report
    successes = [episode for episode in episodes if episode.success]
    reasons = Counter(e.error for e in episodes if e.error is not None)
    spl = sum(1.0 / max(e.path_ratio or 1.0, 1.0) for e in successes)
    gaps = [each.clearance_min for each in episodes if each.clearance_min is not None]
    exact = [each.smallest_gap.gap for each in episodes if each.smallest_gap]
    means = [e.clearance_mean for e in episodes if e.clearance_mean is not None]
    return PolicyRow(
        task=result.task,
        policy=result.policy,
        knows=result.knows,
        episodes=report.count,
        successes=report.successes,
        rate=report.rate,
        interval=report.interval,
        scores=report.scores,
        by_generator=report.by_generator,
        collided=sum(e.collisions > 0 or e.outcome == "collision" for e in episodes),
        outcomes=dict(Counter(e.outcome for e in episodes).most_common()),
        causes=report.causes,
        time_ratio=_median(e.time_ratio for e in successes),
        path_ratio=_median(e.path_ratio for e in successes),
        spl=round(spl / max(1, report.count), _DIGITS),
        smoothness=_median(e.smoothness for e in successes),
        smallest_gap=min(exact, default=None),
        too_close=report.too_close,
        clearance_min=min(gaps, default=None),
        clearance_mean=round(fmean(means), _DIGITS) if means else None,
        reasons=dict(reasons.most_common(MOST_REASONS)),
        told=report.told,
        controller_sha256=report.provenance.controller_sha256 or None,
        sandbox=report.provenance.sandbox,
        note=result.note,
    )


def _median(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return round(median(known), _DIGITS) if known else None


def comparisons_of(results: Sequence[Result]) -> tuple[PairedComparison, ...]:
    """Compares all pairs of policies that drove; those of equal information first."""
    pairs = [
        compare(one, other)
        for one, other in combinations(results, 2)
        if one.task == other.task and one.episodes and other.episodes
    ]
    return tuple(sorted(pairs, key=lambda pair: pair.equal_information is None))


def compare(one: Result, other: Result) -> PairedComparison:
    """Compares two policies.

    Raises:
        ValueError: The results are not of the same task and episodes.
    """
    numbers = [[episode.number for episode in r.episodes] for r in (one, other)]
    if one.task != other.task or numbers[0] != numbers[1]:
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
