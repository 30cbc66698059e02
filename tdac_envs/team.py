"""Threads that help with the compiled loop of `tdac_envs.row_loop`."""

from __future__ import annotations

import os
import threading
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tdac_envs.row_loop import (
    APART,
    ENDS,
    FAILED,
    N_PLAN,
    OPEN,
    TAKEN,
    THREADS,
    row_loop,
)

Words = NDArray[np.int64]


class Team:
    """The caller's thread and its helpers, which start when they are first needed.

    A helper takes no part in a call for which it wakes too late, and nobody waits for
    one that sleeps: the caller waits for the shares that others are at, no longer.

    Args:
        threads: How many there may be, the caller's among them.
        width: Words of a kernel's slots.

    Attributes:
        process: Where its threads are.
    """

    def __init__(self, threads: int, width: int) -> None:
        self.process = os.getpid()
        self._plan = np.zeros(N_PLAN, np.int64)
        self._door = np.zeros(TAKEN + APART * threads, np.int64)
        # Each thread writes to its own, and shares no line of the cache.
        self._slots = np.zeros((threads, width + APART), np.int64)
        # Of the parts: how many rows in all, where each begins and where it ends.
        self._count = 0
        self._begins = self._ends = np.zeros(0, np.int64)
        self._call = 0
        self._over = False
        self._bells: list[threading.Lock] = []
        self._helpers: list[threading.Thread] = []
        loop, shared = row_loop(), (self._door.ctypes.data, self._plan.ctypes.data)
        self._enter = [
            partial(loop, *shared, slots.ctypes.data, number)
            for number, slots in enumerate(self._slots)
        ]

    def make(self, plan: Words, slots: Words, count: int, threads: int) -> int:
        """Makes the calls of a plan; not 0 where one has failed.

        Args:
            plan: Without the threads and the ends of their parts.
            slots: Of any row.
            count: Of rows.
            threads: How many work.
        """
        if (count, threads) != (self._count, len(self._ends)):
            self._divide(count, threads)
        door, bells = self._door, self._bells[: threads - 1]
        self._plan[: plan.size] = plan
        self._slots[:threads, : slots.size] = slots
        door[TAKEN::APART][:threads] = self._begins
        door[FAILED] = 0
        self._call += 1
        try:
            door[OPEN] = self._call
            for bell in bells:
                _ring(bell)
        finally:
            # An interrupt must not leave the door open.
            status = self._enter[0](self._call)
        return status

    def _divide(self, count: int, threads: int) -> None:
        """Gives each thread its part of so many rows."""
        for number in range(len(self._helpers) + 1, threads):
            self._start(number)
        bounds = [k * count // threads for k in range(threads + 1)]
        self._begins, self._ends = np.array(bounds[:-1]), np.array(bounds[1:])
        self._count = count
        self._plan[THREADS], self._plan[ENDS] = threads, self._ends.ctypes.data

    def end(self) -> None:
        """Ends the helpers."""
        self._over = True
        for bell in self._bells:
            _ring(bell)
        for helper in self._helpers:
            helper.join()

    def _start(self, number: int) -> None:
        bell = threading.Lock()
        bell.acquire()
        name = f"tdac-rows-{number}"
        helper = threading.Thread(
            target=self._help, args=(number, bell), name=name, daemon=True
        )
        self._bells.append(bell)
        self._helpers.append(helper)
        helper.start()

    def _help(self, number: int, bell: threading.Lock) -> None:
        while bell.acquire() and not self._over:
            self._enter[number](self._call)


def _ring(bell: threading.Lock) -> None:
    """Wakes the helper; one that has not yet taken the last call takes this one."""
    if bell.locked():
        bell.release()
