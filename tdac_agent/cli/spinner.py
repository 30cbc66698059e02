"""A spinner that is loaded only when needed."""

from __future__ import annotations

import sys
from contextlib import ExitStack


class Spinner:
    """Context manager that shows an activity on a terminal from its first call on.

    It imports rich on that call, and only if stderr is a terminal.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._shown = ExitStack()
        self._done = not sys.stderr.isatty()

    def __call__(self) -> None:
        """Shows the spinner, unless it is already shown."""
        if self._done:
            return
        self._done = True
        from tdac_agent.cli.console import Console

        console = Console(stderr=True)
        self._shown.enter_context(console.status(self._text))

    def __enter__(self) -> Spinner:
        return self

    def __exit__(self, *error: object) -> None:
        self._shown.close()
