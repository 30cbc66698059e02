"""A compiled loop over many rows, on several threads."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.int64]

# Rows for which a further thread pays.
_LEAST = 64


class Slices:
    """Threads among which the rows of a loop are divided.

    The caller's thread takes the first slice. A process that was forked has threads of
    its own. Where they cannot be started, the caller's does all.

    Args:
        threads: How many work at a time; by default as many as there are cores.
    """

    def __init__(self, threads: int | None = None) -> None:
        self._threads = threads or _cores()
        self._executor: ThreadPoolExecutor | None = None
        self._process = os.getpid()

    def run(self, loop: Callable[[Rows], object], rows: Rows) -> None:
        """Calls a loop on all rows, some at a time; returns when all of it is done.

        Args:
            loop: Takes numbers of rows, and releases the GIL.
            rows: Their numbers, in any order, none of them twice.
        """
        count = min(self._threads, -(-len(rows) // _LEAST))
        executor = self._at_work() if count > 1 else None
        if executor is None:
            loop(rows)
            return
        own, *others = np.array_split(rows, count)
        try:
            given = [executor.submit(loop, each) for each in others]
            loop(own)
            for each in given:
                each.result()
        except BaseException:
            # Nobody may see, or change, rows that are still being worked on.
            self.close(wait=True)
            raise

    def close(self, *, wait: bool = False) -> None:
        """Ends the threads; the next call starts them again."""
        executor, self._executor = self._executor, None
        if executor is not None and self._process == os.getpid():
            executor.shutdown(wait=wait)

    def _at_work(self) -> ThreadPoolExecutor | None:
        # Threads do not outlive a fork.
        if self._executor is None or self._process != os.getpid():
            self._process = os.getpid()
            self._executor = self._started()
        return self._executor

    def _started(self) -> ThreadPoolExecutor | None:
        """Threads that are there, so that no call fails half-way for want of one."""
        executor = ThreadPoolExecutor(self._threads - 1, "tdac-rows")
        there = threading.Barrier(self._threads)
        try:
            for _ in range(self._threads - 1):
                executor.submit(there.wait)
        except (OSError, RuntimeError) as error:
            there.abort()
            executor.shutdown()
            told = f"1 thread instead of {self._threads}: {error}"
            warnings.warn(told, RuntimeWarning, stacklevel=6)
            self._threads = 1
            return None
        there.wait()
        return executor


def _cores() -> int:
    """How many this process may use; elsewhere than on Linux, how many there are."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
