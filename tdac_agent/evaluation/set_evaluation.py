"""`evaluation.json` of a task set: policies of any kind on the same worlds."""

from __future__ import annotations

from collections import Counter
from itertools import combinations
from typing import TYPE_CHECKING, Literal

from pydantic import ConfigDict, Field

from tdac_agent.evaluation.evaluation_report import PairedComparison
from tdac_agent.evaluation.robust_report import Interval
from tdac_agent.evaluation.set_report import SetReport
from tdac_agent.metrics.exact import sign_test
from tdac_agent.runs.selection_record import Scores
from tdac_agent.storage.printable_record import PrintableRecord

if TYPE_CHECKING:
    import pandas as pd


class _Record(PrintableRecord):
    model_config = ConfigDict(extra="forbid", frozen=True)


class SetPolicy(_Record):
    """A policy of the evaluation."""

    name: str
    kind: Literal["controller", "sb3"]
    knows: str = Field(description="What it may use beyond nothing: sensors, or + map.")
    wrappers: tuple[str, ...] = ()
    sha256: str = Field(description="Hash of its file.")


class SetRow(_Record):
    """One policy on the worlds. Scores are None if nothing was driven."""

    policy: str
    worlds: int
    successes: int
    interval: Interval | None
    scores: Scores | None
    by_generator: dict[str, Scores]
    hit: int = Field(description="Episodes that ended with a contact.")
    timeouts: int = Field(description="Episodes that ended at the horizon.")
    errors: int = Field(description="Errors of the policy, too much CPU time included.")
    causes: dict[str, int] = Field(description="Failures by cause.")
    told: tuple[str, ...] = Field(description="Up to three failures.")
    sandbox: str = Field(description="Sandbox tier; none if it needs no sandbox.")


class SetEvaluation(_Record):
    """Policies on the same worlds of a set, from world 0 on, by the same judge."""

    schema_version: Literal[1] = 1
    set: str
    set_sha256: str
    split: str
    worlds: int
    policies: tuple[SetPolicy, ...]
    versions: dict[str, str]
    rows: tuple[SetRow, ...]
    comparisons: tuple[PairedComparison, ...]
    reports: tuple[SetReport, ...] = Field(exclude=True)

    @property
    def all_crashed(self) -> bool:
        """Whether no policy drove a world without an error of its own."""
        return all(row.errors == row.worlds for row in self.rows)

    def to_frame(self) -> pd.DataFrame:
        """Tidy data with a row for each episode; lengths in px, for the e-puck in m."""
        import pandas as pd

        return pd.DataFrame(
            [
                {
                    "set": self.set,
                    "split": self.split,
                    "policy": policy.name,
                    "knows": policy.knows,
                    "success": episode.success,
                    **episode.model_dump(),
                }
                for policy, report in zip(self.policies, self.reports, strict=True)
                for episode in report.episodes
            ]
        )


def row_of(policy: SetPolicy, report: SetReport) -> SetRow:
    """The row of a policy."""
    outcomes = Counter(episode.outcome for episode in report.episodes)
    failed = report.worlds - report.successes
    hit, timeouts = outcomes["collision"], outcomes["out of time"]
    return SetRow(
        policy=policy.name,
        worlds=report.worlds,
        successes=report.successes,
        interval=report.interval,
        scores=report.scores,
        by_generator=report.by_generator,
        hit=hit,
        timeouts=timeouts,
        errors=failed - hit - timeouts,
        causes=report.causes,
        told=report.told,
        sandbox=report.provenance.sandbox,
    )


def comparisons_of(
    where: str, policies: tuple[SetPolicy, ...], reports: tuple[SetReport, ...]
) -> tuple[PairedComparison, ...]:
    """McNemar's exact test for all pairs of policies that drove.

    Args:
        where: Name of the set.
        policies: The policies.
        reports: The report of each.
    """
    driven = [
        (policy, [episode.success for episode in report.episodes])
        for policy, report in zip(policies, reports, strict=True)
        if report.episodes
    ]
    return tuple(
        _compared(where, *one, *other) for one, other in combinations(driven, 2)
    )


def _compared(
    where: str, one: SetPolicy, ours: list[bool], other: SetPolicy, theirs: list[bool]
) -> PairedComparison:
    table = Counter(zip(ours, theirs, strict=True))
    first, second = table[True, False], table[False, True]
    return PairedComparison(
        task=where,
        one=one.name,
        other=other.name,
        equal_information=one.knows if one.knows == other.knows else None,
        both=table[True, True],
        only_one=first,
        only_other=second,
        neither=table[False, False],
        p=sign_test(first, second),
    )
