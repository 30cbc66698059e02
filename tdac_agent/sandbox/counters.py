"""Counters in memory that a process shares with its later forks."""

from __future__ import annotations

import mmap


def shared_counters(count: int) -> memoryview[int]:
    """Returns `count` integers, 0 at first, that this process and its forks share.

    The kernel keeps the memory for as long as one of them refers to it. That of
    `multiprocessing.RawValue` and `RawArray` is used for the next value as soon as the
    process that made it has dropped it, even while its forks still write to it.
    """
    return memoryview(mmap.mmap(-1, max(1, 4 * count))).cast("i")
