"""A spinner for what may be over before one is wanted."""

from __future__ import annotations

import sys
from contextlib import ExitStack


class Spinner:
    """Says on a terminal what is being done, from its first call on.

    Until then, and where stderr is no terminal, nothing that draws is loaded. A context
    manager.

    Args:
        text: What is being done.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._shown = ExitStack()
        self._done = not sys.stderr.isatty()

    def __call__(self) -> None:
        """Shows it, unless it is shown already."""
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
