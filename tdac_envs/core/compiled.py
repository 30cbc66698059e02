"""Decorators for compiled code: numba's `njit` with a cache that can be trusted.

numba compiles a kernel at its first call and keeps the machine code for later processes
in the folder of `tdac_envs.core.code_cache`.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np
from numba import config, njit
from numba.core import event
from numpy.typing import DTypeLike, NDArray

from tdac_envs.core.code_cache import cache_folder

F = TypeVar("F", bound=Callable[..., Any])

REPORT_SECONDS = 5.0
USUAL = 0.005
"""Time of `_work` on the machine that the estimates of `expect` are for, s."""
KERNELS: list[Any] = []
"""All kernels of the modules imported so far."""


def kernel(function: F) -> F:
    """Decorator: compiles a function at its first call, or loads it from disk.

    All calls from Python must use the same types: float or int as annotated, and
    `read_only` for arrays that are only read. Every other combination of types is
    compiled separately, and concurrent processes may lose each other's results.

    With `NUMBA_DISABLE_JIT=1` the function is not compiled.
    """
    folder = cache_folder()
    # Functions of other packages keep their own cache folder.
    previous, config.CACHE_DIR = config.CACHE_DIR, str(folder or "")
    try:
        compiled: F = njit(nogil=True, cache=folder is not None)(function)
    finally:
        config.CACHE_DIR = previous
    KERNELS.append(compiled)
    return compiled


def subkernel(function: F) -> F:
    """Decorator: compiles a function as part of the kernels that call it."""
    compiled: F = njit(nogil=True)(function)
    return compiled


def read_only(array: NDArray[Any], dtype: DTypeLike | None = None) -> NDArray[Any]:
    """A C-contiguous, read-only view of an array that kernels only read.

    For numba it has a different type than a writeable array. The data is copied only
    if it is not contiguous or has another dtype.
    """
    view = np.ascontiguousarray(array, dtype).view()
    view.flags.writeable = False
    return view


class _Progress(event.Listener):  # type: ignore[misc]
    """Reports on stderr that kernels are compiled, which takes many seconds."""

    def __init__(self) -> None:
        self._reported = -REPORT_SECONDS
        self.expected = ""
        self.message = ""

    def on_start(self, event: Any) -> None:
        if event.data["dispatcher"] not in KERNELS:
            return
        what = _part_of(event.data["dispatcher"])
        own = [each for each in KERNELS if _part_of(each) == what]
        number = min(sum(bool(each.signatures) for each in own) + 1, len(own))
        how_long = f"{self.expected}cached for later runs"
        self.message = f"compiling {what}, {number} of {len(own)} ({how_long})"
        now = time.monotonic()
        if now - self._reported >= REPORT_SECONDS:
            self._reported = now
            print(f"tdac: {self.message}", file=sys.stderr, flush=True)

    def on_end(self, event: Any) -> None:
        if event.data["dispatcher"] in KERNELS:
            self.message = ""


def _part_of(compiled: Any) -> str:
    """What a kernel belongs to, in the words of a user."""
    package = compiled.py_func.__module__.split(".")[1:2]
    return _PARTS.get("".join(package), "the environment")


_PARTS = {
    "grid": "the path planner",
    "ladder": "the maker of worlds",
    "mapping": "the reader of maps",
    "webots": "the sensors of Webots",
}
_progress = _Progress()
event.register("numba:compile", _progress)


def compiling() -> str:
    """What is being compiled now, in a line; empty if nothing is."""
    return _progress.message


@contextmanager
def expect(seconds: float) -> Iterator[None]:
    """Context manager: reports say that compiling takes about so long on this machine.

    Args:
        seconds: About how long it takes on a machine that takes `USUAL` for `_work`.
    """
    begin = time.perf_counter()
    _work()
    here = seconds * (time.perf_counter() - begin) / USUAL
    _progress.expected = f"about {max(round(here / 5.0) * 5, 5)} s, "
    try:
        yield
    finally:
        _progress.expected = ""


def _work() -> None:
    """Some work of an interpreter, as most of that of a compiler in Python is."""
    sum(number % 7 for number in range(200_000))


if config.DISABLE_JIT:
    warning = "NUMBA_DISABLE_JIT is set: nothing is compiled, steps are much slower"
    print(f"tdac: {warning}", file=sys.stderr, flush=True)
