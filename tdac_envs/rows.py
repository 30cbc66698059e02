"""Many calls of one kernel, each with arrays of its own, in one go and on all cores."""

from __future__ import annotations

import ctypes
import functools
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from tdac_envs.compiled import Kernel, link, machine

# Calls `entry` once a row, with `slots` of which some words are those of the row.
_LOOP = """
define i32 @tdac_rows(
    ptr %entry, ptr %slots, ptr %columns, i64 %width, ptr %values, i64 %count
) {
start:
  br label %rows
rows:
  %row = phi i64 [0, %start], [%next, %call]
  %failed = phi i32 [0, %start], [%either, %call]
  %more = icmp slt i64 %row, %count
  br i1 %more, label %each, label %end
each:
  %first = mul i64 %row, %width
  br label %words
words:
  %word = phi i64 [0, %each], [%after, %copy]
  %left = icmp slt i64 %word, %width
  br i1 %left, label %copy, label %call
copy:
  %place = getelementptr i64, ptr %columns, i64 %word
  %column = load i64, ptr %place
  %which = add i64 %first, %word
  %source = getelementptr i64, ptr %values, i64 %which
  %value = load i64, ptr %source
  %target = getelementptr i64, ptr %slots, i64 %column
  store i64 %value, ptr %target
  %after = add i64 %word, 1
  br label %words
call:
  %status = call i32 %entry(ptr %slots)
  %either = or i32 %failed, %status
  %next = add i64 %row, 1
  br label %rows
end:
  ret i32 %failed
}
"""
# A thread takes so many rows at a time: little waiting at the end, few calls.
_SHARES = 4
_LEAST = 64


class Rows:
    """Calls of a kernel, ready to be made again and again; see `Kernel.bind`.

    Args:
        kernel: What is called. No two calls may write to the same memory.
        arguments: Of each call; all of the same types.
        threads: How many work at a time; by default as many as there are cores.
    """

    def __init__(
        self,
        kernel: Kernel[Any, Any],
        arguments: Iterable[tuple[Any, ...]],
        threads: int | None = None,
    ) -> None:
        self._kernel = kernel
        packed = [kernel.pack(each) for each in arguments]
        self._slots = np.array([slots for slots, _ in packed], np.int64)
        self._kept = [kept for _, kept in packed]
        self._differ()
        self._entry = kernel.load()
        self._threads = threads or len(os.sched_getaffinity(0))
        self._pool: ThreadPoolExecutor | None = None
        self._process = os.getpid()

    def __getstate__(self) -> dict[str, Any]:
        raise TypeError("calls with addresses of memory cannot be copied or pickled")

    def put(self, row: int, *args: Any) -> None:
        """Replaces the arguments of one call."""
        slots, self._kept[row] = self._kernel.pack(args)
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

    def call(self, row: int) -> None:
        """Makes one of the calls."""
        self._check(self._entry(self._slots[row].ctypes.data))

    def call_all(self) -> None:
        """Makes all calls, in any order.

        Raises:
            ArithmeticError: One of them failed.
        """
        count = len(self._slots)
        share = max(_LEAST, -(-count // (_SHARES * self._threads)))
        begins = iter(range(0, count, share))
        helpers = min(self._threads, -(-count // share)) - 1
        if helpers <= 0:
            self._check(self._work(begins, share))
            return
        pool = self._workers()
        waiting = [pool.submit(self._work, begins, share) for _ in range(helpers)]
        status = self._work(begins, share)
        for each in waiting:
            status |= each.result()
        self._check(status)

    def close(self) -> None:
        """Ends the threads."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def _work(self, begins: Iterator[int], share: int) -> int:
        """Makes calls until nobody has any left, `share` at a time."""
        loop, entry = _loop(), ctypes.cast(self._entry, ctypes.c_void_p)  # type: ignore[arg-type]
        slots, columns, values = self._slots[0].copy(), self._columns, self._values
        own, status = (slots.ctypes.data, columns.ctypes.data, len(columns)), 0
        for begin in begins:
            rows = min(share, len(values) - begin)
            first = values.ctypes.data + begin * values.strides[0]
            status |= loop(entry.value, *own, first, rows)
        return status

    def _workers(self) -> ThreadPoolExecutor:
        # Threads do not outlive a fork.
        if self._pool is None or self._process != os.getpid():
            self._pool = ThreadPoolExecutor(self._threads - 1, "tdac-rows")
            self._process = os.getpid()
        return self._pool

    def _check(self, status: int) -> None:
        if status:
            raise ArithmeticError(f"{self._kernel.name} failed")


@functools.cache
def _loop() -> Callable[..., int]:
    """The compiled loop over rows; the engine that holds it lives as long as it."""
    import llvmlite.binding as llvm

    code = machine().emit_object(llvm.parse_assembly(_LOOP))
    engine, address = link([code], "tdac_rows")
    pointer, number = ctypes.c_void_p, ctypes.c_int64
    kinds = (pointer, pointer, pointer, number, pointer, number)
    loop = ctypes.CFUNCTYPE(ctypes.c_int32, *kinds)(address)

    def run(*args: int | None, _: Any = engine) -> int:
        return int(loop(*args))

    return run
