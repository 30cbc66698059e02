"""A lock for shared and exclusive work."""

from __future__ import annotations

import threading
from collections.abc import Generator
from contextlib import contextmanager


class Turns:
    """Lets several threads work concurrently, or one while all others wait.

    Args:
        places: Number of threads that may work concurrently.
    """

    def __init__(self, places: int) -> None:
        self._places = places
        self._free = threading.Semaphore(places)
        # Held while places are taken, so that exclusive work is not overtaken.
        self._door = threading.Lock()

    @contextmanager
    def beside(self) -> Generator[None]:
        """Context of work that may run beside other work."""
        with self._door:
            self._free.acquire()
        try:
            yield
        finally:
            self._free.release()

    @contextmanager
    def alone(self) -> Generator[None]:
        """Context of work that runs alone."""
        with self._door:
            for _ in range(self._places):
                self._free.acquire()
        try:
            yield
        finally:
            self._free.release(self._places)
