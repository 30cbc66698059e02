"""Runs a compiled loop over many rows on several threads."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.int64]

# With fewer rows per thread, another thread does not pay off.
_LEAST = 64


class Slices:
    """A pool of threads that share the rows of a loop.

    The caller's thread takes the first slice. A forked process starts its own threads.
    If threads cannot be started, the caller's thread takes all rows.

    Args:
        threads: Number of threads, including the caller's; by default one per core.
    """

    def __init__(self, threads: int | None = None) -> None:
        self._threads = threads or available_cores()
        self._executor: ThreadPoolExecutor | None = None
        self._process = os.getpid()

    def run(self, loop: Callable[[Rows], object], rows: Rows) -> None:
        """Calls the loop on slices of the rows in parallel; returns when all are done.

        Args:
            loop: Takes row indices and releases the GIL.
            rows: Row indices in any order, without duplicates.
        """
        count = min(self._threads, -(-len(rows) // _LEAST))
        executor = self._running() if count > 1 else None
        if executor is None:
            loop(rows)
            return
        own, *others = np.array_split(rows, count)
        try:
            futures = [executor.submit(loop, each) for each in others]
            loop(own)
            for future in futures:
                future.result()
        except BaseException:
            # The caller must not touch rows while threads still work on them.
            self.close(wait=True)
            raise

    def close(self, *, wait: bool = False) -> None:
        """Stops the threads; the next `run` starts them again."""
        executor, self._executor = self._executor, None
        if executor is not None and self._process == os.getpid():
            executor.shutdown(wait=wait)

    def _running(self) -> ThreadPoolExecutor | None:
        # Threads do not survive a fork.
        if self._executor is None or self._process != os.getpid():
            self._process = os.getpid()
            self._executor = self._started()
        return self._executor

    def _started(self) -> ThreadPoolExecutor | None:
        """Starts all threads at once, so that no later call fails half-way."""
        executor = ThreadPoolExecutor(self._threads - 1, "tdac-rows")
        barrier = threading.Barrier(self._threads)
        try:
            for _ in range(self._threads - 1):
                executor.submit(barrier.wait)
        except (OSError, RuntimeError) as error:
            barrier.abort()
            executor.shutdown()
            warning = f"using 1 thread instead of {self._threads}: {error}"
            warnings.warn(warning, RuntimeWarning, stacklevel=6)
            self._threads = 1
            return None
        barrier.wait()
        return executor


def available_cores() -> int:
    """Number of cores that this process may use; of all cores if that is unknown."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
