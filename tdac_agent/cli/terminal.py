"""The one door to the terminal: what passes it cannot steer the terminal.

Controllers, models, servers, file names and tasks may contain escape sequences that
clear the screen and write a verdict of their own. So nothing relies on its caller:
`filter_streams` covers `print`, tracebacks, warnings and log lines, and our
`Console`, in `commands.console`, all that rich draws.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any, TextIO, cast

from tdac_agent.storage.plain import printable


class FilteredStream:
    """A text stream that writes a mark for each character that is not printable.

    Attributes:
        rich_proxied_file: The stream behind it. rich looks for this name, and writes
            its own escape sequences there.

    Args:
        stream: Where to write.
    """

    def __init__(self, stream: TextIO) -> None:
        self.rich_proxied_file = stream

    def write(self, text: str) -> int:
        """Writes a text, filtered; returns its length."""
        return self.rich_proxied_file.write(printable(text))

    def writelines(self, lines: Iterable[str]) -> None:
        """Writes several texts, filtered."""
        self.rich_proxied_file.writelines(map(printable, lines))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rich_proxied_file, name)


def filter_streams() -> None:
    """Filters all that is written to `sys.stdout` and `sys.stderr` from now on."""
    sys.stdout, sys.stderr = _filtered(sys.stdout), _filtered(sys.stderr)


def unfiltered(stream: TextIO) -> TextIO:
    """The stream behind a filter, for escape sequences of our own."""
    behind = getattr(stream, "rich_proxied_file", None)
    return stream if behind is None else unfiltered(behind)


def _filtered(stream: TextIO) -> TextIO:
    # A closed one is None.
    if stream is None or isinstance(stream, FilteredStream):
        return stream
    return cast(TextIO, FilteredStream(stream))
