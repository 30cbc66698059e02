"""Rows that run this project's own tests in a clone below the temporary folder."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from commands import counted, own_environment, run
from place import Place
from walls import hidden

BUSY_LOOPS = 4
# Only some tests of each kind of compiled function, because plain Python is slow.
KERNELS = "tests/envs/map2d/test_kernels.py"
MOVERS = (
    "tests/envs/map2d/test_movers.py",
    "tests/envs/map2d/test_crowd.py",
    "tests/envs/map2d/test_encounters.py",
    "tests/envs/ladder/test_moving.py",
)


def temporary(place: Place) -> str:
    """The command (`make test`) in the clone, without bubblewrap."""
    command = [*place.command, f"PYTHON={sys.executable}"]
    return counted(run(command, cwd=place.tree, env=hidden(place)))


def busy(place: Place) -> str:
    """The same while other programs load the processors."""
    _ = place.python  # install before the load starts
    with busy_loops(BUSY_LOOPS):
        return temporary(place)


@contextmanager
def busy_loops(number: int) -> Iterator[None]:
    """Runs processes that compute all the time."""
    command = [sys.executable, "-c", "while True: pass"]
    loops = [subprocess.Popen(command) for _ in range(number)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def bounds(place: Place) -> str:
    """Tests of kernels and movers, compiled so that each index is checked."""
    tests = [place.python, "-m", "pytest", "-q", "-m", "not slow", KERNELS, *MOVERS]
    return counted(
        run(tests, cwd=place.tree, env=own_environment(NUMBA_BOUNDSCHECK="1"))
    )


def nojit(place: Place) -> str:
    """A handful of kernel tests without compilation."""
    tests = [place.python, "-m", "pytest", "-q", "-m", "not slow", KERNELS]
    return counted(
        run(tests, cwd=place.tree, env=own_environment(NUMBA_DISABLE_JIT="1"))
    )
