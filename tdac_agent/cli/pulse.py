"""Lines about long work, where no bar or spinner is shown."""

from __future__ import annotations

import sys
import time

SECONDS = 30.0
"""Time between two lines."""


class Pulse:
    """Prints now and then how far long work has come, unless on a terminal.

    Work that takes less than `SECONDS` prints nothing.

    Args:
        is_terminal: Whether the output is one, which shows a bar instead.
    """

    def __init__(self, *, is_terminal: bool) -> None:
        self._is_silent = is_terminal
        self._next = time.monotonic() + SECONDS

    def __call__(self, text: str) -> None:
        """Prints a text to stderr if it is time for a line."""
        now = time.monotonic()
        if self._is_silent or now < self._next:
            return
        self._next = now + SECONDS
        print(text, file=sys.stderr, flush=True)
