"""Run-queue statistics: how long a process was ready to run but had no CPU.

Source: Linux, `Documentation/scheduler/sched-stats.rst`: time on a CPU and run-queue
wait time, both of the first thread and in ns. If they cannot be read, both are 0.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

# The kernel updates the time on a CPU at each tick, at least every 10 ms.
TICKS_SECONDS = 0.025
MOST_WAITED_SECONDS = 300.0
# Part of its length that a verification's processes must have waited for a CPU that
# others used, if the machine is to blame.
STARVED_SHARE = 0.1

Standing = Literal["in time", "too late", "starved"]


def standing(limit: float, elapsed: float, waited: float) -> Standing:
    """Returns how a controller stands that has not answered yet.

    Time on a CPU and time asleep count against its limit, time in a run queue does not.

    Args:
        limit: Time that it may take, s.
        elapsed: Time since it was asked, s.
        waited: Time that it, or the judge, was ready to run but had no CPU, s.

    Returns:
        `starved` if the machine is to blame: it is still in time, but has waited longer
        than anybody should wait for it.
    """
    if elapsed - waited >= limit:
        return "too late"
    return "starved" if waited > MOST_WAITED_SECONDS else "in time"


def machine_is_to_blame(elapsed: float, waited: float, siblings: float) -> bool:
    """Returns whether work that took too long did so because of other work.

    Args:
        elapsed: Time that it took, s.
        waited: Time that its processes waited for a CPU, s, all together.
        siblings: The most that they can have waited for each other, s, so that no
            controller makes the machine look busy.
    """
    return waited - siblings >= STARVED_SHARE * elapsed


@dataclass(slots=True)
class RunQueue:
    """Run-queue statistics of a process; time asleep does not count.

    Attributes:
        pid: Process ID, or `thread-self` for the calling thread.
    """

    pid: int | str

    def waited(self) -> float:
        """Returns the total run-queue wait time, s, until it last got a CPU."""
        return self.times()[1]

    def times(self) -> tuple[float, float]:
        """Returns the total time on a CPU and the total run-queue wait time, s."""
        ran, waited = self._statistics()
        return ran / 1e9, waited / 1e9

    def stands(self) -> bool:
        """Whether it is ready to run but gets no CPU; takes about 25 ms."""
        before = self._statistics()
        if before == (0, 0) or not self.is_ready():
            return False
        time.sleep(TICKS_SECONDS)
        return self.is_ready() and self._statistics() == before

    def _statistics(self) -> tuple[int, int]:
        try:
            # raw read: of the kernel
            fields = Path(f"/proc/{self.pid}/schedstat").read_text().split()
            return int(fields[0]), int(fields[1])
        except (OSError, ValueError, IndexError):
            return 0, 0

    def is_ready(self) -> bool:
        """Whether it runs or waits for a CPU."""
        try:
            stat = Path(f"/proc/{self.pid}/stat").read_text()  # raw read: of the kernel
        except OSError:
            return False
        return stat.rpartition(")")[2].split()[:1] == ["R"]
