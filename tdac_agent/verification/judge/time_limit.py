"""A time limit for work on a controller in the judge's own process."""

from __future__ import annotations

import signal
import time
from collections.abc import Generator
from contextlib import contextmanager

from tdac_agent.sandbox import ControllerFault

# A test may catch the error, so it is raised again at this interval.
AGAIN_SECONDS = 1.0


@contextmanager
def time_limit(deadline: float, reason: str) -> Generator[None]:
    """Interrupts the main thread at a deadline, even while it formats a message.

    Values that a controller chose may take long to compare or to print.

    Args:
        deadline: The deadline, by `time.monotonic`.
        reason: Message of the error.

    Raises:
        ControllerFault: At the deadline, or at once if it has passed.
    """
    left = deadline - time.monotonic()
    if left <= 0.0:
        raise ControllerFault(reason, "the verification")
    active = True

    def stop(*_: object) -> None:
        if active:
            signal.setitimer(signal.ITIMER_REAL, AGAIN_SECONDS)
            raise ControllerFault(reason, "the verification")

    before = signal.signal(signal.SIGALRM, stop)
    try:
        try:
            signal.setitimer(signal.ITIMER_REAL, left)
            yield
        finally:
            active = False
    finally:
        # Again, since the signal may have interrupted the first assignment.
        active = False
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
