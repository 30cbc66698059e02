"""Who is to blame for an answer that is late: the controller, or the machine."""

import os

import pytest

from tdac_agent.sandbox.channel import Channel, DeadlineError
from tdac_agent.sandbox.inner.wire import HEADER
from tdac_agent.sandbox.waiting import machine_is_to_blame


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


def no_time():
    """A deadline that has passed."""
    raise DeadlineError(busy=False)


@pytest.fixture
def ends():
    """A channel, and the descriptors of the child's side of it."""
    (theirs, requests), (answers, to), (output, printed) = (os.pipe() for _ in range(3))
    channel = Channel(requests, answers, output, 1 << 16, 1000)
    yield channel, to, printed
    channel.close()
    for descriptor in (theirs, to, printed):
        os.close(descriptor)


def test_an_answer_that_is_there_is_read(ends):
    """However late the judge itself gets a CPU; but once, so that none trickles in."""
    channel, to, _ = ends
    os.write(to, HEADER.pack(2, 32, 7) + b"ok")
    assert channel.receive(no_time) == (32, 7, b"ok")
    os.write(to, b"\0")
    with pytest.raises(DeadlineError):
        channel.receive(no_time)


@pytest.mark.parametrize("deadline", [lambda: 0.0, no_time])
def test_a_long_answer_is_read_to_its_end(ends, deadline):
    """All of it is there, although one read does not take it."""
    channel, to, _ = ends
    answer = bytes(10_000)
    os.write(to, HEADER.pack(len(answer), 32, 7) + answer)
    assert channel.receive(deadline) == (32, 7, answer)
    with pytest.raises(DeadlineError):
        channel.receive(deadline)


def test_what_is_printed_is_no_answer(ends):
    """A controller that prints for ever is late nevertheless."""
    channel, _, printed = ends
    os.write(printed, b"still at it\n")
    with pytest.raises(DeadlineError):
        channel.receive(no_time)
