"""The time that a program takes for itself, and what used it up.

A program and the judge take turns. In its turns, a program computes, sleeps, or waits
for a CPU. It may compute and sleep for a given time each. Waiting is the machine's
doing: it counts for nothing, and ends the run as a failure of the machine in the end.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from tdac_agent.sandbox.channel import SOON_SECONDS, DeadlineError, StarvedError
from tdac_agent.sandbox.waiting import MOST_WAITED_SECONDS

Blame = Literal["computed", "slept", "machine"]


@dataclass(frozen=True, slots=True)
class Spent:
    """How a program spent its turns.

    Attributes:
        wall: Length of its turns, s.
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


def blame(spent: Spent, seconds: float) -> Blame | None:
    """Returns what used up `seconds`; None if there is time left.

    A program that is ready is not asleep, whatever the measured times are: the last
    wait in the queue is not counted yet, and the host of a virtual machine may have
    taken its CPU away.
    """
    if spent.ran >= seconds:
        return "computed"
    if spent.slept >= seconds and not spent.ready:
        return "slept"
    if spent.wall >= 2.0 * seconds + MOST_WAITED_SECONDS:
        return "machine"
    return None


def seconds_to_next_look(spent: Spent, seconds: float) -> float:
    """Returns how long no time can be used up; at least a moment."""
    return max(min(seconds - spent.ran, seconds - spent.slept), SOON_SECONDS / 5)


class OwnTime:
    """Limits the time that a program takes for itself.

    Args:
        seconds: Time that it may compute, and sleep.
        look: Returns its CPU time and the run-queue wait time since it exists, and
            whether it is ready. It is called only when time may be used up.
        judge_waited: Returns the run-queue wait time of the judge's thread, which must
            be the calling one. What it waits between the turns is not part of them.
    """

    def __init__(
        self,
        seconds: float,
        look: Callable[[], tuple[float, float, bool]],
        judge_waited: Callable[[], float],
    ) -> None:
        self._seconds, self._look, self._judge_waited = seconds, look, judge_waited
        self._judge_before, self._between = judge_waited(), 0.0
        self._ended, self._ended_cpu = time.monotonic(), time.thread_time()
        self._ran, self._waited, _ = look()
        self._wall, self._next_look = 0.0, seconds
        self._began, self._end = 0.0, math.inf

    def begin_turn(self, at_most: float) -> None:
        """Begins a turn that may last `at_most` seconds, whatever happens in it."""
        self._began = time.monotonic()
        self._end = self._began + at_most
        # Between two turns the judge computes, or waits: this is cheaper to look up.
        computed = time.thread_time() - self._ended_cpu
        self._between += max(0.0, self._began - self._ended - computed)

    def end_turn(self) -> float:
        """Ends the turn; returns its length, s."""
        self._ended, self._ended_cpu = time.monotonic(), time.thread_time()
        turn = self._ended - self._began
        self._wall += turn
        return turn

    def left(self) -> float:
        """Returns the seconds until the next call; at most 0 at the turn's end.

        Raises:
            DeadlineError: The time is used up.
            StarvedError: The machine gave the program too little of a CPU.
        """
        now = time.monotonic()
        wall = self._wall + now - self._began
        if wall >= self._next_look:
            self._next_look = wall + self._checked(wall)
        return min(self._next_look - wall, self._end - now)

    def _checked(self, wall: float) -> float:
        ran, waited, ready = self._look()
        judge = self._judge_waited() - self._judge_before - self._between
        waited = waited - self._waited + max(0.0, judge)
        spent = Spent(wall, ran - self._ran, waited, ready)
        cause = blame(spent, self._seconds)
        if cause == "machine":
            raise StarvedError
        if cause is not None:
            raise DeadlineError(busy=cause == "computed")
        return seconds_to_next_look(spent, self._seconds)
