"""A time limit for work on a controller in the judge's own process."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import NamedTuple

from tdac_agent.sandbox import ControllerFault

# A test may catch the error, so it is raised again at this interval.
AGAIN_SECONDS = 1.0


class Clock(NamedTuple):
    """A clock that interrupts: its time, its timer, and the timer's signal."""

    time: Callable[[], float]
    timer: int
    signal: int


WALL = Clock(time.monotonic, signal.ITIMER_REAL, signal.SIGALRM)
CPU = Clock(time.process_time, signal.ITIMER_PROF, signal.SIGPROF)


@contextmanager
def time_limit(deadline: float, reason: str, clock: Clock = WALL) -> Generator[None]:
    """Interrupts the main thread at a deadline, even while it formats a message.

    Values that a controller chose may take long to compare or to print.

    Args:
        deadline: The deadline, by the time of the clock.
        reason: Message of the error.
        clock: `WALL`, or `CPU` for the time that this process computes.

    Raises:
        ControllerFault: At the deadline, or at once if it has passed.
    """
    left = deadline - clock.time()
    if left <= 0.0:
        raise ControllerFault(reason, "the verification")
    active = True

    def stop(*_: object) -> None:
        if active:
            signal.setitimer(clock.timer, AGAIN_SECONDS)
            raise ControllerFault(reason, "the verification")

    before = signal.signal(clock.signal, stop)
    try:
        try:
            signal.setitimer(clock.timer, left)
            yield
        finally:
            active = False
    finally:
        # Again, since the signal may have interrupted the first assignment.
        active = False
        signal.setitimer(clock.timer, 0.0)
        signal.signal(clock.signal, before)
