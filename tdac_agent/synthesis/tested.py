"""What came of a suite of tests: on a task, or the user's own on a task set."""

from __future__ import annotations

from tdac_agent.prompting.feedback import feedback_of
from tdac_agent.synthesis.candidates import (
    Candidate,
    Explored,
    Result,
    ToldEpisode,
)
from tdac_agent.verification.diagnosis.report import Report
from tdac_envs.core.intake import RECORD_BYTES, parse_json, read_file

REPORT_FILE = "report.json"
NOT_RUN = "not run"


def suite_result(report: Report) -> Result:
    """The result of a candidate whose tests are all in a report."""
    failure, verdict = feedback_of(report), report.verdict
    summary = f"{verdict.passed_tests} of {verdict.expected} tests passed"
    if not report.passed:
        summary = f"{len(report.failures)} of {verdict.expected} tests failed"
        if verdict.passed_tests == 0:
            summary += f", the first because {report.failures[0].message}"
    return Result(
        report.passed,
        (float(report.passed), -len(report.failures)),
        failure,
        summary,
        unfit="" if report.passed else summary,
        failed=failure.failed,
        seed=report.provenance.seed,
        episodes=tuple(
            ToldEpisode(each.name, each.outcome, each.steps, each.smallest_gap)
            for each in report.episodes
            if not each.held_out and each.outcome != NOT_RUN
        ),
    )


def failed_tests(report: Report) -> Explored:
    """What came of a variation that failed tests, so that it drove no further."""
    failure = feedback_of(report)
    return Explored(
        None,
        failure.line,
        failed=failure.failed,
        drove=any(each.outcome != NOT_RUN for each in report.episodes),
        seed=report.provenance.seed,
    )


def recorded_report(candidate: Candidate) -> Report:
    """The report in the folder of a candidate.

    Raises:
        OSError: There is none.
        ValueError: It is damaged.
    """
    content = parse_json(read_file(candidate.folder / REPORT_FILE, RECORD_BYTES))
    return Report.model_validate(content)
