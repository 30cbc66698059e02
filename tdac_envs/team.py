"""Threads that help with the compiled loop of `tdac_envs.row_loop`."""

from __future__ import annotations

import os
import threading
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tdac_envs.row_loop import APART, BELLS, BYTES, OVER, OWN, TAKEN, row_loop

Words = NDArray[np.int64]


class Team:
    """The caller's thread and its helpers, which start when they are first needed.

    A helper takes no part in a call for which it wakes too late, and nobody waits for
    one that sleeps: the caller waits for the shares that others are at, no longer.
    Helpers know nothing of Python, and wait for none of its locks.

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
        self._bells = np.full(threads, -1, np.int64)
        self._pipes: list[tuple[int, int]] = []
        self._helpers: list[threading.Thread] = []
        self._call = 0
        plan[BELLS] = self._bells.ctypes.data
        shared = self._door.ctypes.data, plan.ctypes.data
        loop = row_loop()
        self._make = partial(loop.make, *shared, self._slots.ctypes.data)
        self._help = partial(loop.help, *shared)
        self._wake = partial(loop.wake, *shared)

    def wake(self, threads: int) -> None:
        """Wakes the helpers that are there for a call that will come soon."""
        self._wake(min(threads, len(self._helpers) + 1))

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

        Raises:
            OSError: A helper cannot be started.
        """
        while len(self._helpers) + 1 < threads:
            self._start(len(self._helpers) + 1)
        self._call += 1
        return self._make(self._call, order, count, threads, returned, block)

    def end(self) -> None:
        """Ends the helpers."""
        self._door[OVER] = 1
        # Threads do not outlive a fork.
        if self.process == os.getpid():
            for _, bell in self._pipes:
                os.write(bell, b"!")
            for helper in self._helpers:
                helper.join()
        for pipe in self._pipes:
            for end in pipe:
                os.close(end)
        self._pipes.clear()

    def _start(self, number: int) -> None:
        heard, bell = os.pipe()
        self._pipes.append((heard, bell))
        self._bells[number] = bell
        arguments = self._slots[number].ctypes.data, number, heard
        name = f"tdac-rows-{number}"
        helper = threading.Thread(
            target=self._help, args=arguments, name=name, daemon=True
        )
        helper.start()
        self._helpers.append(helper)
