"""Only time on a CPU and time asleep are a program's own."""

from types import SimpleNamespace

import pytest

from tdac_agent.sandbox.channel import DeadlineError
from tdac_agent.sandbox.own_time import OwnTime, Spent, blame, seconds_to_next_look
from tdac_agent.sandbox.waiting import MOST_WAITED_SECONDS

LAST = 2 * 8 + MOST_WAITED_SECONDS


@pytest.mark.parametrize(
    ("spent", "cause"),
    [
        (Spent(wall=7.9, ran=7.9, waited=0.0, ready=True), None),
        (Spent(wall=8.0, ran=8.0, waited=0.0, ready=True), "computed"),
        (Spent(wall=90.0, ran=8.0, waited=82.0, ready=True), "computed"),
        (Spent(wall=40.0, ran=1.3, waited=38.7, ready=True), None),
        (Spent(wall=40.0, ran=1.3, waited=38.7, ready=False), None),
        (Spent(wall=9.0, ran=1.0, waited=0.0, ready=False), "slept"),
        (Spent(wall=14.0, ran=7.0, waited=0.0, ready=False), None),
        (Spent(wall=99.0, ran=1.0, waited=90.0, ready=False), "slept"),
        (Spent(wall=LAST, ran=1.0, waited=LAST - 1, ready=True), "machine"),
        (Spent(wall=LAST, ran=1.0, waited=0.0, ready=True), "machine"),
        (Spent(wall=LAST, ran=1.0, waited=0.0, ready=False), "slept"),
        (Spent(wall=LAST, ran=8.0, waited=LAST - 8, ready=True), "computed"),
    ],
)
def test_what_used_up_eight_seconds(spent, cause):
    """Waiting for a CPU is never the program's fault, and in the end the machine's.

    Without run-queue statistics, a program that is ready is not taken to be asleep.
    """
    assert blame(spent, 8.0) == cause


def test_the_next_look_is_not_before_time_can_be_used_up():
    """Looking costs time, so that it is done only when it can change something."""
    spent = Spent(wall=20.0, ran=3.0, waited=15.0, ready=False)
    assert seconds_to_next_look(spent, 8.0) == 5.0
    spent = Spent(wall=20.0, ran=3.0, waited=10.0, ready=False)
    assert seconds_to_next_look(spent, 8.0) == 1.0
    assert 0.0 < seconds_to_next_look(spent, 3.0) < 1.0


def test_what_the_judge_waits_between_the_turns_is_no_excuse(monkeypatch):
    """A program that does nothing in its turns is late, however busy the judge is."""
    now, judge = [0.0], [0.0]
    clock = SimpleNamespace(monotonic=lambda: now[0], thread_time=lambda: 0.0)
    monkeypatch.setattr("tdac_agent.sandbox.own_time.time", clock)
    own = OwnTime(8.0, lambda: (0.0, 0.0, False), lambda: judge[0])
    for _ in range(7):
        own.begin_turn(60.0)
        now[0] += 1.0
        assert own.left() > 0.0
        own.end_turn()
        now[0] += 5.0
        judge[0] += 5.0
    own.begin_turn(60.0)
    now[0] += 1.0
    with pytest.raises(DeadlineError):
        own.left()


def test_what_the_judge_waits_in_a_turn_is_not_the_programs():
    """An answer may be there that the judge has no CPU to read."""
    judge = [0.0]
    own = OwnTime(1e-9, lambda: (0.0, 0.0, False), lambda: judge[0])
    own.begin_turn(60.0)
    judge[0] += 10.0
    assert own.left() > 0.0
