"""Counters in memory that a process shares with its forks."""

from __future__ import annotations

import mmap


def shared_counters(count: int) -> memoryview[int]:
    """Returns `count` integers, initially 0, that this process and later forks share.

    The kernel keeps this memory as long as a process refers to it. The memory of
    `multiprocessing.RawValue` and `RawArray` is reused as soon as the process that
    made it drops it, even while forks still write to it.
    """
    return memoryview(mmap.mmap(-1, max(1, 4 * count))).cast("i")
