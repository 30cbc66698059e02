"""What is told to the one who repairs."""

from tdac_agent.feedback import MAX_CHARS, render_feedback
from tdac_agent.report import Diagnosis, Failure
from tdac_agent.verification import verify

WALL = "def policy(obs):\n    return 1.0, 1.0\n"


def report_with(report, *failures):
    return report.model_copy(update={"failures": failures})


def test_feedback_tells_what_happened(small_task, warm):
    """The tests that failed, with figures and the diagnosis; no path, no address."""
    report = verify(WALL, small_task, profile="policy", judge=warm)
    text = render_feedback(report)
    assert text.startswith(f"{report.verdict.failed_tests} of ")
    assert "test_no_collisions" in text
    assert "nominal: collision in step" in text
    assert "/tmp" not in text
    assert "0x" not in text


def test_held_out_starts_are_told_by_name_only(small_task, warm):
    """Figures of a held-out start appear nowhere, whatever its test says."""
    report = verify(WALL, small_task, profile="policy", paper=True, judge=warm)
    told = "A start that is held out failed; nothing more is told of it."
    failure = Failure(
        test="own/test_gap.py::test_gap",
        group="user",
        message="only 1.25 px at (71, 83)",
        diagnosis=Diagnosis(cause="held out", text=told),
    )
    text = render_feedback(report_with(report, failure))
    assert "test_gap" in text
    assert "held out" in text
    assert "1.25" not in text
    assert "71" not in text


def test_long_messages_are_cut(small_task, warm):
    """A message of any length is bounded, and says how much was left out."""
    report = verify(WALL, small_task, profile="policy", paper=True, judge=warm)
    failure = Failure(test="a::b", group="unit", message="x" * 10_000)
    text = render_feedback(report_with(report, failure))
    assert len(text) < MAX_CHARS + 200
    assert "8500 characters left out" in text


def test_three_kinds_of_failure_in_full(small_task, warm):
    """What shares a message shares a paragraph; a fourth of a part is named only."""
    report = verify(WALL, small_task, profile="policy", paper=True, judge=warm)
    failures = [
        Failure(test=f"a::t{n}", group="unit", message=f"reason {n // 2}.")
        for n in range(10)
    ]
    driving = Failure(test="e::drive", group="end to end", message="it hit a wall")
    assert "it hit a wall" in render_feedback(report_with(report, *failures, driving))
    text = render_feedback(report_with(report, *failures))
    assert "a::t0, a::t1" in text
    assert text.count("reason 0.") == 1
    assert "reason 2." in text
    assert "reason 3." not in text
    assert text.endswith("Also failed: a::t6, a::t7, a::t8, a::t9")
