"""Run-queue statistics: how long a process was ready to run but had no CPU.

Source: Linux, `Documentation/scheduler/sched-stats.rst`: run-queue wait time of the
first thread, in ns. If it cannot be read, it is 0.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

MOST_WAITED_SECONDS = 300.0
# Part of its length that a verification's processes must have waited for a CPU that
# others used, if the machine is to blame.
STARVED_SHARE = 0.1


def machine_is_to_blame(elapsed: float, waited: float, siblings: float) -> bool:
    """Returns whether work that took too long did so because of other work.

    Args:
        elapsed: Time that it took, s.
        waited: Time that its processes waited for a CPU, s, all together.
        siblings: The most that they can have waited for each other, s, so that no
            controller makes the machine look busy.
    """
    return waited - siblings >= STARVED_SHARE * elapsed


class ProcessTimes(NamedTuple):
    """A process at some time.

    Attributes:
        ran: CPU time of it and its descendants, s; in steps of 10 ms.
        waited: Run-queue wait time, s.
        ready: Whether it runs or waits for a CPU.
    """

    ran: float
    waited: float
    ready: bool


@dataclass(slots=True)
class RunQueue:
    """Run-queue statistics of a process; time asleep does not count.

    Attributes:
        pid: Process ID, or `thread-self` for the calling thread.
    """

    pid: int | str

    def waited(self) -> float:
        """Returns the total run-queue wait time, s, until it last got a CPU."""
        try:
            # raw read: of the kernel
            # raw read: of the kernel
            fields = Path(f"/proc/{self.pid}/schedstat").read_text().split()
            return int(fields[1]) / 1e9
        except (OSError, ValueError, IndexError):
            return 0.0

    def is_ready(self) -> bool:
        """Whether it runs or waits for a CPU."""
        try:
            stat = Path(f"/proc/{self.pid}/stat").read_text()  # raw read: of the kernel
        except OSError:
            return False
        return stat.rpartition(")")[2].split()[:1] == ["R"]

    def measure(self) -> ProcessTimes:
        """Returns all of it at once."""
        ran, _ = usage_of_tree(self.pid)
        return ProcessTimes(ran, self.waited(), self.is_ready())


def usage_of_tree(pid: int | str) -> tuple[float, int]:
    """Return CPU seconds and peak resident bytes of a process and its descendants."""
    cpu, rss = 0.0, 0
    pids = [pid]
    while pids:
        folder = Path(f"/proc/{pids.pop()}")
        try:
            # raw read: of the kernel
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
            # raw read: of the kernel
            peak = (folder / "status").read_text().partition("VmHWM:")[2].split()
            children = [
                int(child)
                for task in (folder / "task").iterdir()
                # raw read: of the kernel
                for child in (task / "children").read_text().split()
            ]
        except (OSError, ValueError):
            continue
        cpu += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
        rss = max(rss, int(peak[0]) * 1024 if peak else 0)
        pids += children
    return cpu, rss
