"""The one door to compiled code: numba's `njit`, with a cache that can be trusted.

numba compiles a kernel when it is first called, and keeps the machine code on disk for
later processes, in the folder of `tdac_envs.core.code_cache`.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import config, njit
from numba.core import event
from numpy.typing import DTypeLike, NDArray

from tdac_envs.core.code_cache import cache_folder

F = TypeVar("F", bound=Callable[..., Any])

TELL_SECONDS = 5.0
KERNELS: list[Any] = []
"""All of the modules that have been imported."""


def kernel(function: F) -> F:
    """Compiles a function at its first call, or loads what is on disk; a decorator.

    All calls from Python have the same types: numbers are float or int as annotated,
    arrays that are only read are `constant`. Each further combination would be compiled
    on its own, and numba does not keep several on disk if processes write at once.

    With `NUMBA_DISABLE_JIT=1` the function stays as it is.
    """
    folder = cache_folder()
    # The functions of others keep the place that they have.
    others, config.CACHE_DIR = config.CACHE_DIR, str(folder or "")
    try:
        made: F = njit(nogil=True, cache=folder is not None)(function)
    finally:
        config.CACHE_DIR = others
    KERNELS.append(made)
    return made


def subkernel(function: F) -> F:
    """Compiles a function into the kernels that call it; a decorator."""
    made: F = njit(nogil=True)(function)
    return made


def constant(array: NDArray[Any], dtype: DTypeLike | None = None) -> NDArray[Any]:
    """The array as kernels take what they only read: C-contiguous and read-only.

    To numba that is another type than an array that can be written to. It is copied
    where it is of another dtype.
    """
    view = np.ascontiguousarray(array, dtype).view()
    view.flags.writeable = False
    return view


class _Progress(event.Listener):  # type: ignore[misc]
    """Says on standard error what takes so long: compiling takes many seconds."""

    def __init__(self) -> None:
        self._told = -TELL_SECONDS

    def on_start(self, event: Any) -> None:
        if event.data["dispatcher"] not in KERNELS:
            return
        now = time.monotonic()
        if now - self._told >= TELL_SECONDS:
            self._told = now
            done = sum(bool(each.signatures) for each in KERNELS)
            count = f"kernel {done + 1} of at most {len(KERNELS)}"
            told = f"compiling for this machine, kept for the next time: {count}"
            print(f"tdac: {told}", file=sys.stderr, flush=True)

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _Progress())

if config.DISABLE_JIT:
    told = (
        "NUMBA_DISABLE_JIT: nothing is compiled, steps take hundreds of times as long"
    )
    print(f"tdac: {told}", file=sys.stderr, flush=True)
