"""Many calls of kernels, each with arrays of its own, in one go and on all cores."""

from __future__ import annotations

import ctypes
import os
import weakref
from collections.abc import Iterable, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs import row_loop
from tdac_envs.compiled import Kernel
from tdac_envs.row_copies import Arrays, Columns, Outputs, address, copies
from tdac_envs.team import Team

Index = NDArray[np.int64]
Kinds = NDArray[np.uint8] | NDArray[np.bool_]
Pairs = Sequence[tuple[NDArray[Any], NDArray[Any]]]

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
        kinds: Number of the kernel of each row, which may change from call to call; by
            default the first. One byte each.
        inputs: For each kernel, pairs of arrays with a row for each row, in one piece;
            before a row's call, that of the first is copied to that of the second.
        outputs: Such arrays, of which `call_all` returns copies.
        columns: Arrays with a float64 for each row, of which `call_all` returns copies,
            as what they are listed by.
    """

    def __init__(
        self,
        kernels: Sequence[Kernel[Any, Any]],
        arguments: Iterable[tuple[Any, ...]],
        threads: int | None = None,
        *,
        kinds: Kinds | None = None,
        inputs: Sequence[Pairs] = (),
        outputs: Arrays = (),
        columns: Columns = MappingProxyType({}),
    ) -> None:
        self._kernels = kernels
        packed = [kernels[0].pack(each) for each in arguments]
        self._slots = np.array([slots for slots, _ in packed], np.int64)
        self._kept = [kept for _, kept in packed]
        self._all = np.arange(len(packed))
        self._every = address(self._all)
        self._kinds = np.zeros(len(packed), np.uint8) if kinds is None else kinds
        self._threads = threads or len(os.sched_getaffinity(0))
        calls: list[Any] = [kernel.load() for kernel in kernels]
        entries = [ctypes.cast(call, ctypes.c_void_p).value for call in calls]
        self._entries = np.array(entries, np.int64)
        self._inputs = inputs
        given = [copies(pairs) for pairs in inputs or [()] * len(kernels)]
        table = np.array([(address(pieces), len(pieces)) for pieces in given], np.int64)
        self._given = given, table
        self._outputs = Outputs(outputs, columns)
        self._plan = np.zeros(row_loop.N_PLAN, np.int64)
        self._plan[row_loop.SHARE] = _SHARE
        self._plan[row_loop.KINDS] = address(self._kinds)
        self._plan[row_loop.ENTRIES] = address(self._entries)
        self._plan[row_loop.BASE] = address(self._slots)
        self._plan[row_loop.BYTES] = self._slots[:1].nbytes
        self._plan[row_loop.GIVEN] = address(table)
        self._plan[row_loop.RETURNED] = address(self._outputs.pieces)
        # The words in which the calls differ, and what they are in each; None where
        # these are to be found before the next call.
        self._differing: tuple[Index, Index] | None = None
        self._team: Team | None = None

    def __getstate__(self) -> dict[str, Any]:
        raise TypeError("calls with addresses of memory cannot be copied or pickled")

    def put(self, row: int, *args: Any) -> None:
        """Replaces the arguments of one row."""
        slots, kept = self._kernels[0].pack(args)
        # An interrupt must leave no address of memory that is gone.
        self._kept[row] = [self._kept[row], kept]
        differing, self._differing = self._differing, None
        changed = np.flatnonzero(slots != self._slots[row])
        self._slots[row] = slots
        if differing is not None and np.isin(changed, differing[0]).all():
            columns, values = differing
            values[row] = slots[columns]
            self._differing = differing
        self._kept[row] = kept

    def _differ(self) -> None:
        """Finds the words in which the calls differ: only these are read for each."""
        differs = (self._slots != self._slots[:1]).any(axis=0)
        columns = np.flatnonzero(differs)
        values = np.ascontiguousarray(self._slots[:, columns])
        own = slice(row_loop.COLUMNS, row_loop.VALUES + 1)
        self._plan[own] = address(columns), len(columns), address(values)
        self._differing = columns, values

    def wake(self) -> None:
        """Wakes the threads that help, where a call of all rows is about to be made.

        What is done until then, they need not be waited for.
        """
        team = self._team
        if team is not None and self._threads > 1 and team.process == os.getpid():
            team.wake(self._threads_for(len(self._all)))

    def call(self, rows: Index) -> None:
        """Makes the calls of some rows, in any order.

        Args:
            rows: Their numbers.

        Raises:
            ArithmeticError: One of them failed.
        """
        order = np.ascontiguousarray(rows, np.int64)
        self._make(address(order), len(order))

    def call_all(self) -> list[NDArray[Any]]:
        """Makes the calls of all rows.

        Returns:
            Copies of the outputs, then one array of shape (columns, rows) for each kind
            of column.

        Raises:
            ArithmeticError: One of them failed.
        """
        found, block = self._outputs.renewed()
        self._make(self._every, len(self._all), len(self._outputs.pieces), block)
        return found

    def _make(self, order: int, count: int, returned: int = 0, block: int = 0) -> None:
        if self._differing is None:
            self._differ()
        threads = self._threads_for(count)
        if self._at_work().make(order, count, threads, returned, block):
            names = " or ".join(kernel.name for kernel in self._kernels)
            raise ArithmeticError(f"{names} failed")

    def _threads_for(self, count: int) -> int:
        return max(min(self._threads, -(-count // _LEAST)), 1)

    def close(self) -> None:
        """Has the threads end, without waiting for them."""
        if self._team is not None:
            self._team.end()
            self._team = None

    def _at_work(self) -> Team:
        # Threads do not outlive a fork.
        if self._team is None or self._team.process != os.getpid():
            team = Team(self._threads, self._plan)
            weakref.finalize(self, team.end)
            self._team = team
        return self._team
