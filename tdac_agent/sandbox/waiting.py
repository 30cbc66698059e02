"""How long a process was ready to run while the machine was busy with others.

Source: Linux, `Documentation/scheduler/sched-stats.rst`: time on a CPU, time in line
for one, both of the first thread and in ns. Where the kernel does not tell, nobody
stands in line.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

# A kernel updates the time on a CPU with each of its ticks, at least each 10 ms.
TICKS_SECONDS = 0.025


@dataclass(slots=True)
class Line:
    """A process's place among those that want a CPU; sleepers are not in line.

    Attributes:
        pid: Its id, or `thread-self` for the thread that asks.
    """

    pid: int | str

    def waited(self) -> float:
        """Seconds in line since it began, up to when it last got a CPU."""
        return self.times()[1]

    def times(self) -> tuple[float, float]:
        """Seconds on a CPU, and in line for one."""
        ran, waited = self._statistics()
        return ran / 1e9, waited / 1e9

    def stands(self) -> bool:
        """Whether it is ready to run, and gets no CPU; looks for some 25 ms."""
        before = self._statistics()
        if before == (0, 0) or not self._is_ready():
            return False
        time.sleep(TICKS_SECONDS)
        return self._is_ready() and self._statistics() == before

    def _statistics(self) -> tuple[int, int]:
        try:
            fields = Path(f"/proc/{self.pid}/schedstat").read_text().split()
            return int(fields[0]), int(fields[1])
        except (OSError, ValueError, IndexError):
            return 0, 0

    def _is_ready(self) -> bool:
        try:
            stat = Path(f"/proc/{self.pid}/stat").read_text()
        except OSError:
            return False
        return stat.rpartition(")")[2].split()[:1] == ["R"]
