"""An end to what the judge's own process does about a controller."""

from __future__ import annotations

import signal
import time
from collections.abc import Generator
from contextlib import contextmanager

from tdac_agent.sandbox import ControllerFault

# A test may catch the first error.
AGAIN_SECONDS = 1.0


@contextmanager
def time_limit(deadline: float, reason: str) -> Generator[None]:
    """Ends what the main thread does at a deadline, be it in the middle of a message.

    Values that a controller chose may take long to compare or to print.

    Args:
        deadline: By `time.monotonic`.
        reason: What the error says.

    Raises:
        ControllerFault: At the deadline, or at once where that is over.
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
        # Once more, since the first time may itself have been interrupted.
        active = False
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
