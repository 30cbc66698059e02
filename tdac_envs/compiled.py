"""The one door to compiled code: numba's `njit`, with a cache that can be trusted.

numba compiles a kernel when it is first called, and keeps the machine code on disk for
later processes. It looks for changes in the file of that kernel alone, and it unpickles
what it finds; so the folder is named by everything that the code follows from, and
used only where `tdac_envs.private` says that nobody else can have written there.
"""

from __future__ import annotations

import functools
import hashlib
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numba import config, njit
from numba.core import event
from numpy.typing import DTypeLike, NDArray

from tdac_envs.private import copy, is_private, is_usable, user_cache

F = TypeVar("F", bound=Callable[..., Any])

HERE = Path(__file__).parent
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


@functools.cache
def cache_folder() -> Path | None:
    """Where the machine code of this version, on this machine, is kept.

    Beside the byte code, else in the user's own cache. None, said once, where there is
    no folder that this user alone, or the superuser, can write to.
    """
    name = f"tdac-{_key()}"
    beside, caches = HERE / "__pycache__" / name, user_cache()
    if is_usable(beside, mode=0o755):
        return beside
    own = caches / "tdac" / name if caches else None
    # What is warm and cannot be added to is copied to a place of one's own.
    if own and not own.exists() and is_private(beside):
        copy(beside, own)
    if own and is_usable(own):
        return own
    if not config.DISABLE_JIT:
        places = " or ".join(str(folder.parent) for folder in (beside, own) if folder)
        _say(f"compiled code cannot be kept in {places}: each start compiles anew")
    return None


def _key() -> str:
    """A hash of what machine code follows from: sources, versions, machine, settings.

    Every file that imports from this one may have a kernel, or a constant of one.
    """
    import llvmlite.binding as llvm

    texts = (file.read_bytes() for file in sorted(HERE.rglob("*.py")))
    sources = [text for text in texts if b"compiled import" in text]
    settings = {
        name: repr(value)
        for name, value in sorted(vars(config).items())
        if name.isupper() and "THREAD" not in name and name != "CACHE_DIR"
    }
    versions = sys.version, version("numba"), version("llvmlite"), version("numpy")
    features = sorted(llvm.get_host_cpu_features().items())
    made_by = repr((versions, llvm.get_host_cpu_name(), features, settings))
    return hashlib.sha256(b"\0".join([made_by.encode(), *sources])).hexdigest()[:16]


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
            _say(f"compiling for this machine, kept for the next time: {count}")

    def on_end(self, event: Any) -> None:
        pass


def _say(line: str) -> None:
    print(f"tdac: {line}", file=sys.stderr, flush=True)


_progress = _Progress()
event.register("numba:compile", _progress)
