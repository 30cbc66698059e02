"""What it says about a suite that the reference and bad controllers fared as they did.

What the reference fails cannot be done, or is not in the contract; a suite that a bad
controller passes does not test what it is for.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Literal

from pydantic import ConfigDict, Field

from tdac_agent.storage.printable_record import PrintableRecord
from tdac_agent.tasks.task_file import Profile
from tdac_agent.verification.diagnosis.report import OWN, Report
from tdac_agent.verification.suite.privileged import REFERENCE

CLOCK = frozenset({"call_ms_mean", "call_ms_p99"})


class _Record(PrintableRecord):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Row(_Record):
    """What came of one controller."""

    controller: str
    repeats: int = Field(description="Its verifications.")
    passed: int = Field(description="How many of them it passed.")
    failures: dict[str, str] = Field(description="Message of each test that failed.")
    disagreements: tuple[str, ...] = Field(description="Of the repeats.")
    seconds: float


class SuiteCheck(_Record):
    """Whether a suite proved itself on a task, with one seed, in one profile."""

    schema_version: Literal[1] = 1
    proven: bool
    task: str
    task_sha256: str
    suite: str
    suite_sha256: str
    profile: Profile
    seed: int
    sandbox: str = Field(description="Tier that held the controllers.")
    rows: tuple[Row, ...]
    problems: tuple[str, ...] = Field(description="What does not hold.")
    notes: tuple[str, ...] = Field(description="What a person should look at.")
    seconds: float


def row_of(name: str, reports: Sequence[Report]) -> Row:
    """What came of one controller's verifications."""
    failures: dict[str, str] = {}
    for report in reports:
        for failure in report.failures:
            failures.setdefault(failure.test, failure.message)
    return Row(
        controller=name,
        repeats=len(reports),
        passed=sum(report.passed for report in reports),
        failures=failures,
        disagreements=tuple(disagreements(reports)),
        seconds=round(sum(report.seconds for report in reports), 3),
    )


def disagreements(reports: Iterable[Report]) -> Iterator[str]:
    """Outcomes of tests and figures of episodes that are not the same in all reports.

    What the clock has a say in is left out.
    """
    facts = [_facts(report) for report in reports]
    for key in dict.fromkeys(key for known in facts for key in known):
        values = [known.get(key, "not there") for known in facts]
        if len(set(values)) > 1:
            yield f"{key} is {', '.join(values)}"


def _facts(report: Report) -> dict[str, str]:
    facts = dict(report.tests)
    for episode in report.episodes:
        for field, value in episode.model_dump(exclude=set(CLOCK)).items():
            facts[f"{field} of {episode.name}"] = str(value)
    return facts


def problems_of(row: Row) -> Iterator[str]:
    """What one controller shows to be wrong with a suite or a task."""
    if row.controller == REFERENCE and row.passed < row.repeats:
        for test, message in row.failures.items():
            yield f"the reference fails {test}: {message}"
    if row.controller != REFERENCE and row.passed:
        times = "" if row.repeats == 1 else f" in {row.passed} of {row.repeats} repeats"
        yield f"{row.controller} passes{times}: nothing that is tested needs more"
    for difference in row.disagreements:
        yield f"the repeats of {row.controller} disagree: {difference}"


def verdict_on_suite(
    reference: Report, rows: Sequence[Row], seconds: float
) -> SuiteCheck:
    """Reads the rows.

    Args:
        reference: A report on the reference: what was checked, and its tests.
        rows: One of each controller.
        seconds: How long it took.
    """
    about = reference.provenance
    problems = [problem for row in rows for problem in problems_of(row)]
    failed = {test for row in rows for test in row.failures}
    notes = [
        f"every bad controller passes {test}"
        for test in reference.tests
        if test.startswith(f"{OWN}/") and test not in failed
    ]
    return SuiteCheck(
        proven=not problems,
        task=about.task,
        task_sha256=about.task_sha256,
        suite=about.suite,
        suite_sha256=about.suite_sha256,
        profile=about.profile,
        seed=about.seed,
        sandbox=about.sandbox,
        rows=tuple(rows),
        problems=tuple(problems),
        notes=tuple(notes),
        seconds=round(seconds, 3),
    )
