"""Run-queue statistics: how long a process was ready to run but had no CPU.

Source: Linux, `Documentation/scheduler/sched-stats.rst`: time on a CPU and run-queue
wait time, both of the first thread and in ns. If they cannot be read, both are 0.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

# The kernel updates the time on a CPU at each tick, at least every 10 ms.
TICKS_SECONDS = 0.025


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
            fields = Path(f"/proc/{self.pid}/schedstat").read_text().split()
            return int(fields[0]), int(fields[1])
        except (OSError, ValueError, IndexError):
            return 0, 0

    def is_ready(self) -> bool:
        """Whether it runs or waits for a CPU."""
        try:
            stat = Path(f"/proc/{self.pid}/stat").read_text()
        except OSError:
            return False
        return stat.rpartition(")")[2].split()[:1] == ["R"]
