"""Who is to blame for an answer that is late: the controller, or the machine."""

import os
import time

import pytest

from tdac_agent.sandbox.channel import Channel, DeadlineError
from tdac_agent.sandbox.inner.wire import HEADER
from tdac_agent.sandbox.waiting import (
    MOST_WAITED_SECONDS,
    RunQueue,
    machine_is_to_blame,
    standing,
)


@pytest.mark.parametrize(
    ("limit", "elapsed", "waited", "expected"),
    [
        (10.0, 9.0, 0.0, "in time"),
        (10.0, 11.0, 0.0, "too late"),  # it computed or slept
        (10.0, 11.0, 2.0, "in time"),
        (10.0, 60.0, 51.0, "in time"),
        (10.0, 60.0, 49.0, "too late"),
        (10.0, 309.0, 300.0, "in time"),
        (10.0, 310.0, 301.0, "starved"),
        (10.0, 311.5, 301.0, "too late"),  # it used its time nevertheless
    ],
)
def test_only_its_own_time_makes_a_controller_late(limit, elapsed, waited, expected):
    """Waiting for a CPU never does; after five minutes, the machine is at fault."""
    assert MOST_WAITED_SECONDS == 300.0
    assert standing(limit, elapsed, waited) == expected


@pytest.mark.parametrize(
    ("elapsed", "waited", "siblings", "expected"),
    [
        (600.0, 0.0, 5.0, False),  # it slept
        (600.0, 80.0, 30.0, False),  # it slept on a busy machine
        (600.0, 360.0, 360.0, False),  # its own episodes waited for each other
        (600.0, 510.0, 220.0, True),
        (600.0, 1500.0, 300.0, True),
    ],
)
def test_a_verification_is_not_failed_by_other_work(
    elapsed, waited, siblings, expected
):
    """Nor can a controller's own work pass for other work."""
    assert machine_is_to_blame(elapsed, waited, siblings) == expected


@pytest.fixture
def ends():
    """A channel, and the descriptors of the child's side of it."""
    (theirs, requests), (answers, to), (output, printed) = (os.pipe() for _ in range(3))
    channel = Channel(requests, answers, output, 1 << 16, 1000, RunQueue(os.getpid()))
    yield channel, to, printed
    channel.close()
    for descriptor in (theirs, to, printed):
        os.close(descriptor)


def test_an_answer_that_is_there_is_read(ends):
    """However late the judge itself gets a CPU; but once, so that none trickles in."""
    channel, to, _ = ends
    passed = time.monotonic() - 5.0
    os.write(to, HEADER.pack(2, 32, 7) + b"ok")
    assert channel.receive(passed) == (32, 7, b"ok")
    os.write(to, b"\0")
    with pytest.raises(DeadlineError):
        channel.receive(passed)


def no_time():
    """A deadline that has passed, as a function."""
    raise DeadlineError(busy=False)


@pytest.mark.parametrize("deadline", [-5.0, lambda: 0.0, no_time])
def test_a_long_answer_is_read_to_its_end(ends, deadline):
    """All of it is there, although one read does not take it."""
    channel, to, _ = ends
    passed = deadline if callable(deadline) else time.monotonic() + deadline
    answer = bytes(10_000)
    os.write(to, HEADER.pack(len(answer), 32, 7) + answer)
    assert channel.receive(passed) == (32, 7, answer)
    with pytest.raises(DeadlineError):
        channel.receive(passed)


def test_what_is_printed_is_no_answer(ends):
    """A controller that prints for ever is late nevertheless."""
    channel, _, printed = ends
    os.write(printed, b"still at it\n")
    with pytest.raises(DeadlineError):
        channel.receive(time.monotonic() - 5.0)
