"""The console that all commands print to, and their JSON."""

from __future__ import annotations

import json
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
    """A rich console that filters all text, so that only rich controls the terminal.

    Args:
        stderr: Whether to write to stderr instead of stdout.
        highlight: Whether to colour numbers and paths.
    """

    def __init__(self, *, stderr: bool = False, highlight: bool = True) -> None:
        stream = unfiltered(sys.stderr if stderr else sys.stdout)
        super().__init__(file=stream, stderr=stderr, highlight=highlight, emoji=False)

    def render_str(self, text: str, **options: Any) -> Text:
        """Parses markup as rich does; filters the text before rich lays it out."""
        return super().render_str(printable(text), **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Renders as rich does; filters the text of each segment."""
        for segment in super().render(renderable, options):
            if segment.control:
                yield segment
            else:
                yield Segment(printable(segment.text), segment.style)


def print_json(value: Any) -> None:
    """Prints a record, or plain data, to stdout as JSON."""
    if hasattr(value, "model_dump_json"):
        text = value.model_dump_json(indent=2)
    else:
        text = json.dumps(value, indent=2)
    sys.stdout.write(f"{text}\n")
