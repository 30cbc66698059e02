"""The words of verdicts, and what a confirmation showed."""

from __future__ import annotations

from tdac_agent.runs.run_record import Run
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.judge.confirming import ConfirmingTest

COLOURS = {
    "verified": "green",
    "passed": "cyan",
    "selected": "blue",
    "not verified": "red",
}
"""Colour of each word; green is for `verified` alone."""


def confirmed_text(report: EpisodeReport) -> str:
    """What a confirmation showed, such as `arrives ≥ 95 % (0 of 93 failed)`."""
    assert report.sequential is not None
    test = report.sequential.test
    assert isinstance(test, ConfirmingTest)
    failed = report.count - report.successes
    if report.passed:
        return f"arrives ≥ {100 * test.least:g} % ({failed} of {report.count} failed)"
    return (
        f"{failed} of {report.count} blind drives failed; at most "
        f"{test.most_failures} of {test.limit} may"
    )


def verified_text(report: EpisodeReport) -> str:
    """The verdict of a confirmation in one line, with what it does not cover."""
    text = f"{confirmed_text(report)}, sandbox {report.provenance.sandbox}"
    return f"{text}; not covered: {not_covered(report)}" if report.passed else text


def not_covered(report: EpisodeReport) -> str:
    """What the drives of a confirmation cannot show."""
    drove_with, missing = report.provenance.disturbance, ["other worlds"]
    if drove_with is not None:
        parts = {"delays": drove_with.delay, "unequal wheels": drove_with.wheel_gains}
        missing += [name for name, size in parts.items() if not size]
    return ", ".join([*missing, "a wrong pose", "other physics"])


def delivered_text(run: Run) -> str:
    """Where a run found its controller, and how much it tried for it."""
    confirmed = run.confirmations[-1] if run.verified else None
    at = run.tau if confirmed is None else confirmed.k
    return f"in iteration {at} ({tried_text(run)})"


def tried_text(run: Run) -> str:
    """How many candidates and confirmations a run needed."""
    tried = sum(each.valid and not each.unchanged for each in run.attempts)
    confirmed = len(run.confirmations)
    text = f"{tried} candidate{'' if tried == 1 else 's'}"
    if confirmed:
        text += f", {confirmed} confirmation{'' if confirmed == 1 else 's'}"
    return text
