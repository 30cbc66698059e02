"""Only time on a CPU and time asleep are a program's own."""

from types import SimpleNamespace

import pytest

from tdac_agent.sandbox.channel import DeadlineError
from tdac_agent.sandbox.time_limit import TimeLimit, TimeUsed, limit_of_answer
from tdac_agent.sandbox.waiting import MOST_WAITED_SECONDS, ProcessTimes, RunQueue

ASLEEP = ProcessTimes(ran=0.0, waited=0.0, ready=False)
LAST = 2 * 8 + MOST_WAITED_SECONDS


@pytest.mark.parametrize(
    ("used", "cause"),
    [
        (TimeUsed(wall=7.9, ran=7.9, waited=0.0, ready=True), None),
        (TimeUsed(wall=8.0, ran=8.0, waited=0.0, ready=True), "computed"),
        (TimeUsed(wall=90.0, ran=8.0, waited=82.0, ready=True), "computed"),
        (TimeUsed(wall=40.0, ran=1.3, waited=38.7, ready=True), None),
        (TimeUsed(wall=40.0, ran=1.3, waited=38.7, ready=False), None),
        (TimeUsed(wall=9.0, ran=1.0, waited=0.0, ready=False), "slept"),
        (TimeUsed(wall=14.0, ran=7.0, waited=0.0, ready=False), None),
        (TimeUsed(wall=99.0, ran=1.0, waited=90.0, ready=False), "slept"),
        (TimeUsed(wall=LAST, ran=1.0, waited=LAST - 1, ready=True), "machine"),
        (TimeUsed(wall=LAST, ran=1.0, waited=0.0, ready=True), "machine"),
        (TimeUsed(wall=LAST, ran=1.0, waited=0.0, ready=False), "slept"),
        (TimeUsed(wall=LAST, ran=8.0, waited=LAST - 8, ready=True), "computed"),
    ],
)
def test_what_used_up_eight_seconds(used, cause):
    """Waiting for a CPU is never the program's fault, and in the end the machine's.

    Without run-queue statistics, a program that is ready is not taken to be asleep.
    """
    assert used.exceeds(8.0) == cause


def test_the_next_check_is_not_before_time_can_be_used_up():
    """Looking costs time, so that it is done only when it can change something."""
    used = TimeUsed(wall=20.0, ran=3.0, waited=15.0, ready=False)
    assert used.seconds_to_next_check(8.0) == 5.0
    used = TimeUsed(wall=20.0, ran=3.0, waited=10.0, ready=False)
    assert used.seconds_to_next_check(8.0) == 1.0
    assert 0.0 < used.seconds_to_next_check(3.0) < 1.0


def test_what_the_judge_waits_while_the_clock_stands_is_no_excuse(monkeypatch):
    """A program that does nothing in its time is late, however busy the judge is."""
    now, judge = [0.0], [0.0]
    clock = SimpleNamespace(monotonic=lambda: now[0], thread_time=lambda: 0.0)
    monkeypatch.setattr("tdac_agent.sandbox.time_limit.time", clock)
    limit = TimeLimit(8.0, lambda: ASLEEP, lambda: judge[0])
    for _ in range(7):
        limit.start(60.0)
        now[0] += 1.0
        assert limit.left() > 0.0
        limit.stop()
        now[0] += 5.0
        judge[0] += 5.0
    limit.start(60.0)
    now[0] += 1.0
    with pytest.raises(DeadlineError):
        limit.left()


def test_what_the_judge_waits_while_the_clock_runs_is_not_the_programs():
    """An answer may be there that the judge has no CPU to read."""
    judge = [0.0]
    limit = TimeLimit(1e-9, lambda: ASLEEP, lambda: judge[0])
    limit.start(60.0)
    judge[0] += 10.0
    assert limit.left() > 0.0


@pytest.mark.parametrize("seconds", [0.1, 8.0])
def test_a_process_is_measured_only_if_its_answer_is_not_soon_there(
    monkeypatch, seconds
):
    """Measuring takes longer than most answers; then it may take what is left."""
    now = [0.0]
    clock = SimpleNamespace(monotonic=lambda: now[0], thread_time=lambda: 0.0)
    monkeypatch.setattr("tdac_agent.sandbox.time_limit.time", clock)
    left = limit_of_answer(seconds, RunQueue(0))  # no such process: it sleeps
    assert left() == min(seconds, 0.25)
    now[0] = 0.25
    assert left() == (seconds - 0.25 if seconds > 0.25 else pytest.approx(-0.15))
    now[0] = seconds + 5.0  # what this thread waits for a CPU meanwhile is not counted
    if seconds > 0.25:
        with pytest.raises(DeadlineError):
            left()
