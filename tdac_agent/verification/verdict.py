"""The words of verdicts, and what a confirmation showed."""

from __future__ import annotations

from typing import Literal

from tdac_agent.runs.run_record import Run
from tdac_agent.verification.diagnosis.gap import gap_figure, too_close_text
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.judge.confirming import ConfirmingTest

Word = Literal["verified", "passed", "not verified"]
COLOURS = {
    "verified": "green",
    "passed": "cyan",
    "selected": "blue",
    "not verified": "red",
}
"""Colour of each word; green is for `verified` alone."""

OTHER_PHYSICS = "other physics (floor, motors, battery)"
"""What no disturbance is like."""


def word_of(report: EpisodeReport) -> Word:
    """The verdict of a confirmation.

    What arrives, but in too many drives with less than the required gap, has passed.
    """
    if not report.passed:
        return "not verified"
    return (
        "verified" if report.too_close <= _test_of(report).most_failures else "passed"
    )


def is_verified(report: EpisodeReport) -> bool:
    """Whether a confirmation verifies its controller."""
    return word_of(report) == "verified"


def _test_of(report: EpisodeReport) -> ConfirmingTest:
    assert report.sequential is not None
    test = report.sequential.test
    assert isinstance(test, ConfirmingTest)
    return test


def confirmed_text(report: EpisodeReport) -> str:
    """What a confirmation showed, such as `arrives ≥ 95 % (0 of 93 failed)`."""
    test, failed = _test_of(report), report.count - report.successes
    if word_of(report) == "passed":
        assert report.close_gap is not None
        near = too_close_text(report.close_gap, report.provenance.units)
        return f"{report.too_close} of {report.count} blind drives came {near}"
    if report.passed:
        return f"arrives ≥ {100 * test.least:g} % ({failed} of {report.count} failed)"
    return (
        f"{failed} of {report.count} blind drives failed; at most "
        f"{test.most_failures} of {test.limit} may"
    )


def verified_text(report: EpisodeReport) -> str:
    """The verdict of a confirmation in one line, with what it does not cover."""
    text, gap = confirmed_text(report), report.smallest_gap
    if not is_verified(report):
        return text
    if gap is not None:
        units = report.provenance.units
        text += f", smallest gap {gap_figure(gap.gap, units)}"
        if report.too_close:
            text += (
                f" ({report.too_close} of {report.count} nearer than the required "
                f"{gap_figure(gap.required, units)})"
            )
    text += f", sandbox {report.provenance.sandbox}"
    return f"{text}; not covered: {not_covered(report)}"


def not_covered(report: EpisodeReport) -> str:
    """What the drives of a confirmation cannot show."""
    drove_with, missing = report.provenance.disturbance, ["other worlds"]
    if drove_with is not None:
        wheels = drove_with.wheel_gains or drove_with.wheel_radius_error
        sensed_late = drove_with.pose_delay or drove_with.scan_delay
        parts = {
            "noise of ranges": drove_with.range_noise,
            "slip": drove_with.wheel_slip,
            "late actions": drove_with.delay or drove_with.motor_lag,
            "late readings": sensed_late,
            "unequal wheels": wheels,
            "a wrong pose": drove_with.pose_noise and drove_with.heading_noise,
            "missing ranges": drove_with.range_dropout,
            "lost messages": drove_with.message_drop,
            "another axle": drove_with.axle_error,
        }
        missing += [name for name, size in parts.items() if not size]
    return ", ".join([*missing, OTHER_PHYSICS])


def delivered_text(run: Run) -> str:
    """Where a run found its controller, and how much it tried for it."""
    confirmed = [each.k for each in run.confirmations if each.passed]
    at = confirmed[-1] if run.verified and confirmed else run.tau
    return f"in iteration {at} ({tried_text(run)})"


def tried_text(run: Run) -> str:
    """How many candidates and confirmations a run needed."""
    tried = sum(each.valid and not each.unchanged for each in run.attempts)
    confirmed = len(run.confirmations)
    text = f"{tried} candidate{'' if tried == 1 else 's'}"
    if confirmed:
        text += f", {confirmed} confirmation{'' if confirmed == 1 else 's'}"
    return text
