"""The console of all commands."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any

import rich.console
from rich.console import ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.text import Text

from tdac_agent.cli.terminal import unfiltered
from tdac_agent.storage.plain import printable


class Console(rich.console.Console):
    """A rich console on which no text can steer the terminal; rich itself can.

    Args:
        stderr: Whether it writes there and not to stdout.
        highlight: Whether numbers and paths are coloured.
    """

    def __init__(self, *, stderr: bool = False, highlight: bool = True) -> None:
        stream = unfiltered(sys.stderr if stderr else sys.stdout)
        super().__init__(file=stream, stderr=stderr, highlight=highlight, emoji=False)

    def render_str(self, text: str, **options: Any) -> Text:
        """Reads markup as rich does; filtered already, a text is laid out as it is."""
        return super().render_str(printable(text), **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Renders as rich does; every text passes the filter on its way."""
        for segment in super().render(renderable, options):
            if segment.control:
                yield segment
            else:
                yield Segment(printable(segment.text), segment.style)
