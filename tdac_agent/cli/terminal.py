"""Filters all output, so that untrusted text cannot control the terminal.

Controllers, models, servers, file names and tasks may contain escape sequences that
clear the screen and print a fake verdict. No caller has to filter: `filter_streams`
covers `print`, tracebacks, warnings and log lines, and `tdac_agent.cli.console.Console`
covers everything that rich draws.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any, TextIO, cast

from tdac_agent.storage.plain import printable


class FilteredStream:
    """A text stream that replaces each character that is not printable by a mark.

    Attributes:
        rich_proxied_file: The unfiltered stream. rich looks for this name and writes
            its own escape sequences there.
    """

    def __init__(self, stream: TextIO) -> None:
        self.rich_proxied_file = stream

    def write(self, text: str) -> int:
        """Writes a filtered text; returns its length."""
        return self.rich_proxied_file.write(printable(text))

    def writelines(self, lines: Iterable[str]) -> None:
        """Writes several filtered texts."""
        self.rich_proxied_file.writelines(map(printable, lines))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rich_proxied_file, name)


def filter_streams() -> None:
    """Filters all that is written to `sys.stdout` and `sys.stderr` from now on."""
    sys.stdout, sys.stderr = _filtered(sys.stdout), _filtered(sys.stderr)


def unfiltered(stream: TextIO) -> TextIO:
    """The stream behind a filter, for tdac's own escape sequences."""
    inner = getattr(stream, "rich_proxied_file", None)
    return stream if inner is None else unfiltered(inner)


def _filtered(stream: TextIO) -> TextIO:
    # A closed standard stream is None.
    if stream is None or isinstance(stream, FilteredStream):
        return stream
    return cast(TextIO, FilteredStream(stream))
