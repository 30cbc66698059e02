"""Work side by side, and now and then alone."""

from __future__ import annotations

import threading
from collections.abc import Generator
from contextlib import contextmanager


class Turns:
    """Lets some threads work at a time, or one of them while all others wait.

    Args:
        places: How many may work side by side.
    """

    def __init__(self, places: int) -> None:
        self._places = places
        self._free = threading.Semaphore(places)
        # Held while places are taken: who wants all of them is not overtaken.
        self._door = threading.Lock()

    @contextmanager
    def beside(self) -> Generator[None]:
        """Work that may go on beside other work."""
        with self._door:
            self._free.acquire()
        try:
            yield
        finally:
            self._free.release()

    @contextmanager
    def alone(self) -> Generator[None]:
        """Work beside which nothing else goes on."""
        with self._door:
            for _ in range(self._places):
                self._free.acquire()
        try:
            yield
        finally:
            self._free.release(self._places)
