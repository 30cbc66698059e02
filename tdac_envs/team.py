"""Threads that help with the compiled loop of `tdac_envs.row_loop`."""

from __future__ import annotations

import _thread
import os
import warnings
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tdac_envs.row_loop import APART, BELLS, BYTES, END, OWN, TAKEN, row_loop

Words = NDArray[np.int64]


class Team:
    """The caller's thread and its helpers, which start when they are first needed.

    A helper takes no part in a call for which it wakes too late, and nobody waits for
    one that sleeps: the caller waits for the shares that others are at, no longer.
    Helpers know nothing of Python, and wait for none of its locks. Where one cannot be
    started, the others work without it.

    Args:
        threads: How many there may be, the caller's among them.
        plan: What is done in each call, but for the words of a call.

    Attributes:
        process: Where its threads are.
    """

    def __init__(self, threads: int, plan: Words) -> None:
        self.process = os.getpid()
        self._plan = plan
        self._door = np.zeros(TAKEN + OWN * threads, np.int64)
        # Each thread writes to its own, and shares no line of the cache.
        width = int(plan[BYTES]) // self._door.itemsize
        self._slots = np.zeros((threads, width + APART), np.int64)
        # Where to write for whom, for the loop; of those that have not ended.
        self._bells = np.full(threads, -1, np.int64)
        self._ringable: list[int] = []
        self._helpers = 0
        self._most = threads
        self._call = 0
        plan[BELLS] = self._bells.ctypes.data
        shared = self._door.ctypes.data, plan.ctypes.data
        self._loop = loop = row_loop()
        self._make = partial(loop.make, *shared, self._slots.ctypes.data)
        self._help = partial(loop.help, *shared)
        self._wake = partial(loop.wake, *shared)

    def wake(self, threads: int) -> None:
        """Wakes the helpers that are there for a call that will come soon."""
        self._wake(min(threads, self._helpers + 1))

    def make(
        self, order: int, count: int, threads: int, returned: int, block: int
    ) -> int:
        """Makes the calls of the plan; not 0 where one has failed.

        Args:
            order: Address of the rows' numbers.
            count: Of rows.
            threads: How many work.
            returned: Pieces that are copied after a row's call.
            block: Address where what they are copied to begins.
        """
        threads = min(threads, self._most)
        while self._helpers + 1 < threads:
            try:
                self._start(self._helpers + 1)
            except (OSError, RuntimeError) as error:
                threads = self._most = self._helpers + 1
                told = f"{threads} thread{'s' * (threads > 1)} instead of more"
                warnings.warn(f"{told}: {error}", RuntimeWarning, stacklevel=5)
        self._call += 1
        return self._make(self._call, order, count, threads, returned, block)

    def end(self) -> None:
        """Has the helpers end.

        It does not wait for them: garbage may be collected, and this be called, where
        they would wait for this thread in turn.
        """
        self._bells[:] = -1
        # Those of a process that was forked are another's.
        while self._ringable and self.process == os.getpid():
            bell = self._ringable.pop()
            os.write(bell, END)
            os.close(bell)

    def _start(self, number: int) -> None:
        heard, bell = os.pipe()
        self._bells[number] = bell
        self._ringable.append(bell)
        self._helpers = number
        try:
            # Unlike those of `threading`, it has started or not, interrupted or not.
            # It holds the team, whose memory it uses.
            _thread.start_new_thread(self._serve, (number, heard))
        except RuntimeError:
            self._helpers = number - 1
            self._bells[number] = -1
            for end in (self._ringable.pop(), heard):
                os.close(end)
            raise

    def _serve(self, number: int, heard: int) -> None:
        try:
            self._help(self._slots[number].ctypes.data, number, heard)
        finally:
            os.close(heard)
