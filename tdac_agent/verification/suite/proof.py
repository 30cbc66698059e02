"""Verdict on a suite, from the results of the reference and of bad controllers.

A test that the reference fails is infeasible or not part of the contract. A suite that
a bad controller passes does not test enough.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Literal

from pydantic import Field

from tdac_agent.storage.printable_record import StrictRecord
from tdac_agent.tasks.task_file import Profile
from tdac_agent.verification.diagnosis.report import OWN, Report
from tdac_agent.verification.suite.privileged import REFERENCE

CLOCK = frozenset({"call_ms_mean", "call_ms_p99"})


class ProofRow(StrictRecord):
    """Results of one controller."""

    controller: str
    repeats: int = Field(description="Number of verifications.")
    passed: int = Field(description="Number of verifications that passed.")
    failures: dict[str, str] = Field(description="Message of each failed test.")
    disagreements: tuple[str, ...] = Field(description="Differences of the repeats.")
    seconds: float


class SuiteCheck(StrictRecord):
    """Verdict on a suite, for one task, seed and profile."""

    schema_version: Literal[1] = 1
    proven: bool
    task: str
    task_sha256: str
    suite: str
    suite_sha256: str
    profile: Profile
    seed: int
    sandbox: str = Field(description="Sandbox tier of the controllers.")
    rows: tuple[ProofRow, ...]
    problems: tuple[str, ...] = Field(description="Reasons why it is not proven.")
    notes: tuple[str, ...] = Field(description="Remarks that the user should check.")
    seconds: float


def row_of(name: str, reports: Sequence[Report]) -> ProofRow:
    """Summarises one controller's verifications."""
    failures: dict[str, str] = {}
    for report in reports:
        for failure in report.failures:
            failures.setdefault(failure.test, failure.message)
    return ProofRow(
        controller=name,
        repeats=len(reports),
        passed=sum(report.passed for report in reports),
        failures=failures,
        disagreements=tuple(disagreements(reports)),
        seconds=round(sum(report.seconds for report in reports), 3),
    )


def disagreements(reports: Iterable[Report]) -> Iterator[str]:
    """Describes test outcomes and episode figures that differ between reports.

    Figures that depend on the clock are left out.
    """
    facts = [_facts(report) for report in reports]
    for key in dict.fromkeys(key for known in facts for key in known):
        values = [known.get(key, "missing") for known in facts]
        if len(set(values)) > 1:
            yield f"{key} is {', '.join(values)}"


def _facts(report: Report) -> dict[str, str]:
    facts = dict(report.tests)
    for episode in report.episodes:
        for field, value in episode.model_dump(exclude=set(CLOCK)).items():
            facts[f"{field} of {episode.name}"] = str(value)
    return facts


def problems_of(row: ProofRow) -> Iterator[str]:
    """Describes the problems of suite and task that one controller's results show."""
    if row.controller == REFERENCE and row.passed < row.repeats:
        for test, message in row.failures.items():
            yield f"the reference fails {test}: {message}"
    if row.controller != REFERENCE and row.passed:
        times = "" if row.repeats == 1 else f" in {row.passed} of {row.repeats} repeats"
        yield f"{row.controller} passes{times}: the tests require no more than it does"
    for difference in row.disagreements:
        yield f"the repeats of {row.controller} disagree: {difference}"


def verdict_on_suite(
    reference: Report, rows: Sequence[ProofRow], seconds: float
) -> SuiteCheck:
    """Returns the verdict on a suite.

    Args:
        reference: A report on the reference; states suite, task and tests.
        rows: One row per controller.
        seconds: Duration of the check, s.
    """
    provenance = reference.provenance
    problems = [problem for row in rows for problem in problems_of(row)]
    failed = {test for row in rows for test in row.failures}
    notes = [
        f"every bad controller passes {test}"
        for test in reference.tests
        if test.startswith(f"{OWN}/") and test not in failed
    ]
    return SuiteCheck(
        proven=not problems,
        task=provenance.task,
        task_sha256=provenance.task_sha256,
        suite=provenance.suite,
        suite_sha256=provenance.suite_sha256,
        profile=provenance.profile,
        seed=provenance.seed,
        sandbox=provenance.sandbox,
        rows=tuple(rows),
        problems=tuple(problems),
        notes=tuple(notes),
        seconds=round(seconds, 3),
    )
