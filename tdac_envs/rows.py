"""Many calls of kernels, each with arrays of its own, in one go and on all cores."""

from __future__ import annotations

import ctypes
import os
import weakref
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs import row_loop
from tdac_envs.compiled import Kernel
from tdac_envs.row_copies import Arrays, Outputs, address, copies
from tdac_envs.team import Team

Index = NDArray[np.int64]
Kinds = NDArray[np.uint8] | NDArray[np.bool_]

# Rows that a thread takes at a time: little waiting at the end, few that share a line
# of the cache with another thread's.
_SHARE = 16
# Rows for which it pays to wake a thread.
_LEAST = 64


class Rows:
    """Calls of some kernels, ready to be made again and again; see `Kernel.bind`.

    What goes into a row and comes out of it can be copied by the thread that makes its
    call: memory that one core alone touches stays in its cache.

    Args:
        kernels: What is called; all take the same arguments.
        arguments: Of each row; all of the same types. No two rows may write to the
            same memory.
        threads: How many work at a time; by default as many as there are cores.
        inputs: Pairs of arrays with a row for each row, in one piece; before a row's
            call, that of the first is copied to that of the second.
        outputs: Such arrays, of which `call_all` returns copies.
    """

    def __init__(
        self,
        kernels: Sequence[Kernel[Any, Any]],
        arguments: Iterable[tuple[Any, ...]],
        threads: int | None = None,
        *,
        inputs: Sequence[tuple[NDArray[Any], NDArray[Any]]] = (),
        outputs: Arrays = (),
    ) -> None:
        self._kernels = kernels
        packed = [kernels[0].pack(each) for each in arguments]
        self._slots = np.array([slots for slots, _ in packed], np.int64)
        self._kept = [kept for _, kept in packed]
        self._all = np.arange(len(packed))
        self._firsts = np.zeros(len(packed), np.uint8)
        self._threads = threads or len(os.sched_getaffinity(0))
        self._kept.append([inputs])
        self._given, self._outputs = copies(inputs), Outputs(outputs)
        calls: list[Any] = [kernel.load() for kernel in kernels]
        entries = [ctypes.cast(call, ctypes.c_void_p).value for call in calls]
        self._entries = np.array(entries, np.int64)
        self._plan = np.zeros(row_loop.THREADS, np.int64)
        self._plan[row_loop.SHARE] = _SHARE
        self._plan[row_loop.ENTRIES] = self._entries.ctypes.data
        self._plan[row_loop.GIVEN] = address(self._given)
        self._plan[row_loop.N_GIVEN] = len(inputs)
        self._plan[row_loop.RETURNED] = address(self._outputs.pieces)
        self._differ()
        self._team: Team | None = None

    def __getstate__(self) -> dict[str, Any]:
        raise TypeError("calls with addresses of memory cannot be copied or pickled")

    def put(self, row: int, *args: Any) -> None:
        """Replaces the arguments of one row."""
        slots, self._kept[row] = self._kernels[0].pack(args)
        changed = np.flatnonzero(slots != self._slots[row])
        self._slots[row] = slots
        if np.isin(changed, self._columns).all():
            self._values[row] = slots[self._columns]
        else:
            self._differ()

    def _differ(self) -> None:
        """Finds the words in which the calls differ: only these are read for each."""
        differs = (self._slots != self._slots[:1]).any(axis=0)
        self._columns = np.flatnonzero(differs)
        self._values = np.ascontiguousarray(self._slots[:, self._columns])
        self._plan[row_loop.COLUMNS] = self._columns.ctypes.data
        self._plan[row_loop.WIDTH] = len(self._columns)
        self._plan[row_loop.VALUES] = self._values.ctypes.data

    def call(self, rows: Index, kinds: Kinds | None = None) -> None:
        """Makes the calls of some rows, in any order.

        Args:
            rows: Their numbers.
            kinds: Number of the kernel of each row, also of those that are not called;
                by default the first.

        Raises:
            ArithmeticError: One of them failed.
        """
        self._make(np.ascontiguousarray(rows, np.int64), kinds, 0)

    def call_all(self, kinds: Kinds | None = None) -> list[NDArray[Any]]:
        """Makes the calls of all rows; returns what is then in the outputs.

        Args:
            kinds: Number of the kernel of each row; by default the first.

        Raises:
            ArithmeticError: One of them failed.
        """
        found = self._outputs.renewed()
        self._make(self._all, kinds, len(found))
        return found

    def _make(self, order: Index, kinds: Kinds | None, returned: int) -> None:
        which = self._firsts
        if kinds is not None:
            which = np.ascontiguousarray(kinds, np.uint8)
        self._plan[row_loop.N_RETURNED] = returned
        self._plan[row_loop.ORDER] = address(order)
        self._plan[row_loop.KINDS] = address(which)
        count = len(order)
        threads = max(min(self._threads, -(-count // _LEAST)), 1)
        if self._at_work().make(self._plan, self._slots[0], count, threads):
            names = " or ".join(kernel.name for kernel in self._kernels)
            raise ArithmeticError(f"{names} failed")

    def close(self) -> None:
        """Ends the threads."""
        if self._team is not None:
            self._team.end()
            self._team = None

    def _at_work(self) -> Team:
        # Threads do not outlive a fork.
        if self._team is None or self._team.process != os.getpid():
            self._team = Team(self._threads, self._slots.shape[1])
            weakref.finalize(self, self._team.end)
        return self._team
