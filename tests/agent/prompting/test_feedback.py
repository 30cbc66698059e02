"""What is told to the one who repairs."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from script import AHEAD

from tdac_agent.prompting.feedback import (
    MAX_CHARS,
    choose,
    cut,
    feedback_of,
    group_failures,
    render_feedback,
)
from tdac_agent.verification.diagnosis.report import GROUPS, Diagnosis, Failure
from tdac_agent.verification.verify import verify


def report_with(report, *failures):
    return report.model_copy(update={"failures": failures})


def test_feedback_tells_what_happened(small_task, warm):
    """The tests that failed, with figures and the diagnosis; no path, no address."""
    report = verify(AHEAD, small_task, profile="policy", judge=warm)
    text = render_feedback(report)
    assert text.startswith(f"{report.verdict.failed_tests} of ")
    assert "test_no_collisions" in text
    assert "nominal: collision in step" in text
    assert "/tmp" not in text
    assert "0x" not in text


def test_held_out_starts_are_told_by_name_only(small_task, warm):
    """Figures of a held-out start appear nowhere, whatever its test says."""
    report = verify(AHEAD, small_task, profile="policy", paper=True, judge=warm)
    told = "A held-out start failed; its details are not disclosed."
    failure = Failure(
        test="own/test_gap.py::test_gap",
        group="user",
        message="only 1.25 px at (71, 83)",
        diagnosis=Diagnosis(cause="held out", text=told),
    )
    text = render_feedback(report_with(report, failure))
    assert "test_gap" in text
    assert "held-out" in text
    assert "1.25" not in text
    assert "71" not in text


def test_long_messages_are_cut(small_task, warm):
    """A message of any length is bounded, and says how much was left out."""
    report = verify(AHEAD, small_task, profile="policy", paper=True, judge=warm)
    failure = Failure(test="a::b", group="unit", message="x" * 10_000)
    text = render_feedback(report_with(report, failure))
    assert len(text) < MAX_CHARS + 200
    assert "8500 characters left out" in text


def test_at_most_three_causes_in_full(small_task, warm):
    """What shares a cause shares a paragraph; each part of the suite has its say."""
    report = verify(AHEAD, small_task, profile="policy", paper=True, judge=warm)
    failures = [
        Failure(test=f"a::t{n}", group="unit", message=f"reason {n // 2}.")
        for n in range(10)
    ]
    driving = Failure(test="e::drive", group="end to end", message="it hit a wall")
    text = render_feedback(report_with(report, *failures, driving))
    full, _, lines = text.partition("Also failed:\n")
    assert "it hit a wall" in full
    assert "reason 1." in full
    assert "reason 2." not in full
    assert "- a::t4, a::t5: reason 2.\n" in lines
    text = render_feedback(report_with(report, *failures))
    assert "1. a::t0, a::t1\n   reason 0." in text
    assert "3. a::t4, a::t5\n   reason 2." in text
    assert text.endswith(
        "Also failed:\n- a::t6, a::t7: reason 3.\n- a::t8, a::t9: reason 4."
    )


def test_every_cause_is_told(small_task, warm):
    """Beside those in full each has a line of its own; of very many, the names."""
    report = verify(AHEAD, small_task, profile="policy", paper=True, judge=warm)
    failures = [
        Failure(test=f"a::t{n}", group="unit", message=f"reason {n}\n{'y' * 999}.")
        for n in range(8)
    ]
    text = render_feedback(report_with(report, *failures))
    *_, last = text.partition("Also failed:\n")
    lines = last.splitlines()
    assert [line[:17] for line in lines] == [
        f"- a::t{n}: reason {n}" for n in range(3, 8)
    ]
    assert all(len(line) < 300 for line in lines)
    many = [Failure(test=f"b::t{n}", group="unit", message=f"{n}") for n in range(30)]
    text = render_feedback(report_with(report, *many))
    assert "\n- b::t11: 11\n" in text
    assert text.endswith("\n- and " + ", ".join(f"b::t{n}" for n in range(12, 30)))


SAME = {
    "missing names": [
        "missing constants: LOOKAHEAD",
        "missing at the top level: plan_path",
        "no `def main()` at the top level",
        "AttributeError at N_RAYS: module 'controller' has no attribute 'N_RAYS'",
    ],
    "syntax": [
        "the source does not parse: '(' was never closed (line 1)",
        "SyntaxError at import (line 1): '(' was never closed",
    ],
    "KeyError: 'a'": [
        "KeyError at policy (line 2): 'a'",
        "KeyError at run_episode (line 2): 'a'",
    ],
    "is_occupied": ["is_occupied(0, 0) is a str", "is_occupied(-1, 0) is False"],
}


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("cause", SAME)
def test_failures_with_one_root_are_one_group(small_task, warm, cause):
    """One mistake that fails tests in many ways is told once, whatever the part."""
    report = verify(AHEAD, small_task, profile="policy", paper=True, judge=warm)
    groups = ("static", "unit", "end to end", "user")
    failures = [
        Failure(test=f"t{n}", group=groups[n], message=message)
        for n, message in enumerate(SAME[cause])
    ]
    other = Failure(test="z", group="unit", message="KeyError at policy (line 2): 'b'")
    found, _ = group_failures(report_with(report, *failures, other))
    assert [group.cause for group in found] == [cause, "KeyError: 'b'"]
    assert found[0].members == tuple(failures)


def test_a_broken_file_is_one_cause(small_task, warm):
    """A file that does not parse fails everything, and is told in a few lines."""
    report = verify("def policy(obs:\n    pass\n", small_task, judge=warm)
    assert report.verdict.failed_tests == report.verdict.expected
    text = render_feedback(report)
    assert len(text) < 1500
    assert "\n2. " not in text
    assert "'(' was never closed (line 1)" in text


def test_an_attempt_in_one_line(small_task, warm):
    """How many tests, what happened, with figures."""
    report = verify(AHEAD, small_task, profile="policy", judge=warm)
    line = feedback_of(report).line
    failed, expected = report.verdict.failed_tests, report.verdict.expected
    assert line.startswith(f"{failed} of {expected} tests failed: nominal: ")
    figures = report.failures[0].diagnosis
    assert f"collision in step {figures.step} at ({figures.x:.4g}, " in line
    assert f"with {figures.d_min:.4g} of {figures.d0:.4g} px left at best" in line
    assert "\n" not in line


messages = st.text(max_size=20) | st.text(max_size=5000) | st.just("not run, since x")
causes = st.sampled_from([None, "held out", "collision", "error"])


@st.composite
def failures(draw):
    """Failures of any kind; whatever is held out has a secret for its message."""
    found = []
    for n in range(draw(st.integers(1, 12))):
        cause, message = draw(causes), draw(messages)
        diagnosis = cause and Diagnosis(cause=cause, text=draw(st.text(max_size=3000)))
        if cause == "held out":
            message = f"{message} 71.25 px"
            diagnosis = Diagnosis(cause="held out", text="nothing more is told")
        group = draw(st.sampled_from(GROUPS))
        found.append(
            Failure(test=f"t{n}", group=group, message=message, diagnosis=diagnosis)
        )
    return found


@pytest.fixture(scope="module")
def any_report(small_task, warm):
    return verify(AHEAD, small_task, profile="policy", paper=True, judge=warm)


@pytest.mark.slow
@settings(deadline=None)
@given(failed=failures())
def test_whatever_failed_is_told_within_bounds(any_report, failed):
    """Each test is named or counted, no secret is told, and the length is bounded."""
    report = report_with(any_report, *failed)
    text = render_feedback(report)
    assert "71.25" not in text
    assert "71.25" not in feedback_of(report).line
    assert len(text) <= 3 * (2 * 5 * (MAX_CHARS + 60)) + 1000
    groups, not_run = group_failures(report)
    told = [f for group in groups for f in group.members] + not_run
    assert sorted(f.test for f in told) == sorted(f.test for f in failed)
    assert len(choose(groups)) == min(len(groups), 3)


@given(st.text(max_size=400), st.integers(2, 100))
def test_a_cut_text_says_how_much_was_cut(text, limit):
    """Head and tail are those of the text, and the number is that of the rest."""
    short = cut(text, limit)
    if len(text) <= limit:
        assert short == text
        return
    count = len(text) - 2 * (limit // 2)
    mark = f" … {count} characters left out … "
    assert short == text[: limit // 2] + mark + text[-(limit // 2) :]
