"""Limits the time that a program takes, without the time in which it waits for a CPU.

While the judge works, the clock of a program stands. While it runs, the program
computes, sleeps, or waits for a CPU. It may compute and sleep for a given time: in a
single call together, in an episode of its own for each. Waiting is the machine's
doing: it counts for nothing, and ends the run as a failure of the machine in the end.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from tdac_agent.sandbox.channel import DeadlineError, StarvedError
from tdac_agent.sandbox.waiting import MOST_WAITED_SECONDS, ProcessTimes, RunQueue

SOON_SECONDS = 0.25
"""Most answers come sooner; a process is measured only for later ones."""

Cause = Literal["computed", "slept", "machine"]


@dataclass(frozen=True, slots=True)
class TimeUsed:
    """How a program used its time.

    Attributes:
        wall: Time on its clock, s.
        ran: CPU time, s.
        waited: Run-queue wait time of the program and of the judge, s; 0 if the
            kernel does not tell.
        ready: Whether it runs or waits for a CPU now.
    """

    wall: float
    ran: float
    waited: float
    ready: bool

    @property
    def slept(self) -> float:
        """Time asleep, s."""
        return max(0.0, self.wall - self.ran - self.waited)

    def exceeds(self, seconds: float, together: bool = False) -> Cause | None:
        """Returns what used up `seconds`; None if there is time left.

        Args:
            seconds: The limit.
            together: Whether computing and sleeping count together.

        A program that is ready is not asleep, whatever the measured times are: the
        last wait in the queue is not counted yet, and the host of a virtual machine
        may have taken its CPU away.
        """
        slept = 0.0 if self.ready else self.slept
        if together and self.ran + slept >= seconds:
            return "computed" if self.ran >= slept else "slept"
        if self.ran >= seconds:
            return "computed"
        if slept >= seconds:
            return "slept"
        if self.wall >= 2.0 * seconds + MOST_WAITED_SECONDS:
            return "machine"
        return None

    def seconds_to_next_check(self, seconds: float, together: bool = False) -> float:
        """Returns how long no time can be used up; at least a moment."""
        used = self.ran + self.slept if together else max(self.ran, self.slept)
        return max(seconds - used, SOON_SECONDS / 5)


class TimeLimit:
    """Limits the time that a program takes; its clock stands at first.

    Args:
        seconds: Time that it may compute, and sleep.
        measure: Measures the program. It is called only when time may be used up.
        judge_waited: Returns the run-queue wait time of the judge's thread, which must
            be the calling one. What it waits while the clock stands does not count.
        together: Whether computing and sleeping count together.
    """

    def __init__(
        self,
        seconds: float,
        measure: Callable[[], ProcessTimes],
        judge_waited: Callable[[], float],
        *,
        together: bool = False,
    ) -> None:
        self._seconds, self._together = seconds, together
        self._measure, self._judge_waited = measure, judge_waited
        self._judge_before, self._between = judge_waited(), 0.0
        self._stopped, self._stopped_cpu = time.monotonic(), time.thread_time()
        self._before = measure()
        self._wall, self._next_check = 0.0, seconds
        self._began, self._end = 0.0, math.inf

    def start(self, at_most: float = math.inf) -> None:
        """Starts the clock, which may run for `at_most` seconds, whatever happens."""
        self._began = time.monotonic()
        self._end = self._began + at_most
        # While it stood, the judge computed, or waited: this is cheaper to look up.
        computed = time.thread_time() - self._stopped_cpu
        self._between += max(0.0, self._began - self._stopped - computed)

    def stop(self) -> float:
        """Stops the clock; returns for how long it ran, s."""
        self._stopped, self._stopped_cpu = time.monotonic(), time.thread_time()
        ran = self._stopped - self._began
        self._wall += ran
        return ran

    def left(self) -> float:
        """Returns the seconds until the next call; at most 0 at the end of `at_most`.

        Raises:
            DeadlineError: The time is used up.
            StarvedError: The machine gave the program too little of a CPU.
        """
        now = time.monotonic()
        wall = self._wall + now - self._began
        if wall >= self._next_check:
            used = self._used(wall)
            cause = used.exceeds(self._seconds, self._together)
            if cause == "machine":
                raise StarvedError
            if cause is not None:
                raise DeadlineError(busy=cause == "computed")
            wait = used.seconds_to_next_check(self._seconds, self._together)
            self._next_check = wall + wait
        return min(self._next_check - wall, self._end - now)

    def _used(self, wall: float) -> TimeUsed:
        now, before = self._measure(), self._before
        judge = self._judge_waited() - self._judge_before - self._between
        waited = now.waited - before.waited + max(0.0, judge)
        return TimeUsed(wall, now.ran - before.ran, waited, now.ready)


def limit_of_answer(seconds: float, process: RunQueue) -> Callable[[], float]:
    """Returns what says how many seconds are left for one answer of a process."""
    soon = time.monotonic() + min(seconds, SOON_SECONDS)
    limit: TimeLimit | None = None

    def left() -> float:
        nonlocal limit
        early = soon - time.monotonic()
        if early > 0.0 or seconds <= SOON_SECONDS:
            return early
        if limit is None:
            judge = RunQueue("thread-self").waited
            rest = seconds - SOON_SECONDS
            limit = TimeLimit(rest, process.measure, judge, together=True)
            limit.start()
        return limit.left()

    return left
