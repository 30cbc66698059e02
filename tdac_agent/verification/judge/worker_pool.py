"""The worker pool: processes that drive episodes in parallel.

Threads would not run in parallel, since an episode is mostly Python code.
"""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import queue
import signal
import sys
from collections.abc import Callable, Generator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Generic, ParamSpec, TypeVar

from tdac_agent.errors import Fault
from tdac_agent.sandbox.counters import shared_counters

SIZE = max(2, len(os.sched_getaffinity(0)))

P = ParamSpec("P")
T = TypeVar("T")


class WorkerPool(Generic[P, T]):
    """A worker pool, forked from this process, which should have a single thread then.

    While a process of the pool works, it and its children are pinned to one core that
    no other process of the pool uses: judge and controller alternate, and waking a
    process on another core takes longer than most of their answers.

    Args:
        work: Called in a process for each request. Arguments and results are pickled;
            everything else that it refers to is as it was at the fork.
        end: Called in each process before it ends.
        size: Number of processes.
        first: Called in each process before its first request.
    """

    def __init__(
        self,
        work: Callable[P, T],
        end: Callable[[], None],
        size: int = SIZE,
        first: Callable[[], None] | None = None,
    ) -> None:
        context = multiprocessing.get_context("fork")
        cores = Cores()
        self._ends: list[Connection] = []
        self._idle: queue.SimpleQueue[Connection] = queue.SimpleQueue()
        self._members = []
        for _ in range(size):
            ours, theirs = context.Pipe()
            self._ends.append(ours)
            member = context.Process(
                target=_serve,
                args=(first, work, end, theirs, self._ends, cores),
                daemon=True,
            )
            member.start()
            theirs.close()
            self._members.append(member)
            self._idle.put(ours)

    def do(self, *args: P.args, **kwargs: P.kwargs) -> T:
        """Calls `work` in an idle process, and waits for it; thread-safe.

        Raises:
            Fault: The process has died.
            Exception: Whatever `work` raised.
        """
        member = self._idle.get()
        try:
            member.send((args, kwargs))
            result, error = member.recv()
        except (EOFError, OSError):
            raise Fault("a process of the judge's worker pool has died") from None
        finally:
            self._idle.put(member)
        if error is not None:
            raise error
        return result  # type: ignore[no-any-return]

    @property
    def members(self) -> list[int]:
        """Process ids of the pool."""
        return [member.pid or 0 for member in self._members]

    def close(self) -> None:
        """Ends the processes; none of them may be working."""
        for end in self._ends:
            end.close()
        for member in self._members:
            member.join()


class Cores:
    """The cores that this process may use, distributed among its forks."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("fork")
        self._all = sorted(os.sched_getaffinity(0))
        self._lock = context.Lock()
        self._taken = shared_counters(len(self._all))

    @contextlib.contextmanager
    def one(self) -> Generator[None]:
        """Pins this process to its current core, or to a free one if that is taken.

        Without a free core it is not pinned.
        """
        place = self._take()
        if place is None:
            yield
            return
        _stay_on([self._all[place]])
        try:
            yield
        finally:
            _stay_on(self._all)
            self._taken[place] = 0

    def _take(self) -> int | None:
        here = _core()
        with self._lock:
            free = [i for i, taken in enumerate(self._taken) if not taken]
            if not free:
                return None
            place = next((i for i in free if self._all[i] == here), free[0])
            self._taken[place] = 1
        return place


def _stay_on(cores: list[int]) -> None:
    with contextlib.suppress(OSError):  # some systems forbid pinning
        os.sched_setaffinity(0, cores)


def _core() -> int:
    """The core on which this process runs; see `man proc_pid_stat`."""
    # raw read: of the kernel
    fields = Path("/proc/self/stat").read_text().rpartition(")")[2].split()
    return int(fields[36])


def end_with_parent() -> None:
    """Has the kernel kill this process when its parent ends (on Linux)."""
    if sys.platform == "linux":
        pr_set_pdeathsig = 1
        ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGKILL)


def _serve(
    first: Callable[[], None] | None,
    work: Callable[..., Any],
    end: Callable[[], None],
    judge: Connection,
    ends_of_judge: list[Connection],
    cores: Cores,
) -> None:
    end_with_parent()
    # Copies of the judge's ends would hide that the judge has closed its own.
    for other in ends_of_judge:
        other.close()
    with contextlib.suppress(EOFError, KeyboardInterrupt):
        if first is not None:
            first()
        while True:
            args, kwargs = judge.recv()
            try:
                with cores.one():
                    result = work(*args, **kwargs)
                judge.send((result, None))
            except Exception as error:
                judge.send((None, error))
    end()
