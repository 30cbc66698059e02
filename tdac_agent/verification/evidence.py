"""What the verdict on a run's controller rests on, in a few words."""

from __future__ import annotations

from tdac_agent.runs.run_record import Run
from tdac_agent.verification.diagnosis.listed import list_tests
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.verify import report_in

MOST_NAMES = 4


def evidence_of(run: Run, confirmation: EpisodeReport | None) -> str:
    """Such as `41 of 41 tests, 93 of 93 blind drives arrive`; empty without a report.

    Args:
        run: A run on a task, with a controller that passed all tests.
        confirmation: Its confirmation, if it has one.
    """
    parts = []
    report = report_in(run.folder, {})
    if report is not None:
        tests = report.verdict
        parts.append(f"{tests.passed_tests} of {tests.expected} tests")
    if confirmation is not None:
        count = f"{confirmation.successes} of {confirmation.count}"
        parts.append(f"{count} blind drives arrive")
    elif report is not None:
        parts.append(f"sandbox {report.provenance.sandbox}")
    return ", ".join(parts)


def failed_last(run: Run) -> str:
    """What the last candidate of a run failed; empty if it failed nothing."""
    last = run.attempts[-1] if run.attempts else None
    if last is None or not last.failed_tests:
        return ""
    failed = last.failed_tests
    count = f"{len(failed)} test{'' if len(failed) == 1 else 's'}"
    return f"The last candidate failed {count}: {list_tests(failed, MOST_NAMES)}."
