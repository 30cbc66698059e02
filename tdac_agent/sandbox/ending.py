"""End a child and all its processes; report its resource usage and exit status."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import time
from dataclasses import dataclass

from tdac_agent.sandbox.waiting import usage_of_tree
from tdac_agent.sandbox.zygote import Forked

GRACE_SECONDS = 5.0


@dataclass(frozen=True, slots=True)
class ChildUsage:
    """Resource usage of a child, its output, and how it ended.

    Attributes:
        cpu_seconds: User and system time, s.
        max_rss_bytes: Peak resident memory.
        output_bytes: Size of all printed output, whether kept or not.
        output_head: Beginning of the printed text.
        output_tail: End of the printed text, if it does not fit into the head.
        status: Exit code, or minus the number of the signal that ended it.
        waited_seconds: Run-queue wait time, s.
    """

    cpu_seconds: float
    max_rss_bytes: int
    output_bytes: int
    output_head: str
    output_tail: str
    status: int
    waited_seconds: float = 0.0

    @property
    def printed(self) -> str:
        """The printed text that was kept; `[...]` stands for a gap."""
        kept = len(self.output_head.encode()) + len(self.output_tail.encode())
        gap = "\n[...]\n" if self.output_bytes > kept else ""
        return self.output_head + gap + self.output_tail


class ProcessEnd:
    """Ends one child, once; every call returns its usage.

    Args:
        forked: The child; its private folder is deleted too.
    """

    def __init__(self, forked: Forked) -> None:
        self._forked = forked
        self._usage: ChildUsage | None = None

    def __call__(self) -> ChildUsage:
        """Kill the process group, wait for it, and delete the folder."""
        if self._usage is None:
            # Kept if `_end` is interrupted, so that nothing is closed twice.
            self._usage = ChildUsage(0.0, 0, 0, "", "", -signal.SIGKILL)
            self._usage = _end(self._forked)
        return self._usage


def _end(forked: Forked) -> ChildUsage:
    channel = forked.channel
    try:
        cpu, rss = usage_of_tree(forked.pid)
        waited = forked.line.waited()
        # The leader is not reaped yet, so no other process can have its ID.
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(forked.pid, signal.SIGKILL)
        status, own_cpu, own_rss = forked.reap()
        channel.drain_until_end(time.monotonic() + GRACE_SECONDS)
    finally:
        channel.close()
        os.close(forked.lifeline)
        # A folder that cannot be removed must not prevent a verdict.
        with contextlib.suppress(OSError):
            forked.folder.remove()
    return ChildUsage(
        cpu_seconds=max(cpu, own_cpu),
        max_rss_bytes=max(rss, own_rss),
        output_bytes=channel.output_count,
        output_head=channel.output_head.decode("utf-8", "replace"),
        output_tail=channel.output_tail.decode("utf-8", "replace"),
        status=status,
        waited_seconds=waited,
    )


def has_ended(lifeline: int, seconds: float) -> bool:
    """Return whether a child ends within `seconds`, without reaping it.

    A child cannot close its end of the lifeline, unless seccomp is missing.
    """
    poll = select.poll()
    poll.register(lifeline, 0)  # reports an error once no reader is left
    return bool(poll.poll(seconds * 1000))
