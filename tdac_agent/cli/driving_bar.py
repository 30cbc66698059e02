"""The progress of episodes: a bar on a terminal, now and then a line elsewhere."""

from __future__ import annotations

import sys
import time
from typing import Self

from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
)

from tdac_agent.cli.console import Console
from tdac_agent.cli.sentences import print_plain

SECONDS = 30.0
"""Time between two lines. Work that takes less prints none."""


class DrivingBar:
    """Context manager that shows how many episodes were driven, and reached the goal.

    Args:
        console: Console to print to.
        most: Number of episodes.
        doing: What is driven.
        is_long: Whether to show the time left, and elsewhere a line now and then.
        cut: What follows if it is interrupted, such as `not verified`. It is printed
            with what was driven.
        reaching: Whether to show how many reached the goal.
    """

    def __init__(
        self,
        console: Console,
        most: int,
        doing: str = "preparing",
        *,
        is_long: bool = False,
        cut: str | None = None,
        reaching: bool = True,
    ) -> None:
        self._console, self._most, self._cut = console, most, cut
        self._reaching = reaching
        columns = (
            TextColumn("{task.fields[doing]}"),
            BarColumn(),
            MofNCompleteColumn(),
            *([TextColumn("{task.fields[successes]} reached")] if reaching else []),
            *([TimeRemainingColumn()] if is_long else []),
        )
        # Redrawn only on updates: a timer would cost CPU time.
        self._bar = Progress(
            *columns,
            console=console,
            transient=True,
            auto_refresh=False,
            disable=not console.is_terminal,
        )
        self._row = self._bar.add_task("", total=most, successes=0, doing=escape(doing))
        self._doing = doing
        self._prints_lines = is_long and not console.is_terminal
        self._next = time.monotonic() + SECONDS
        self.counts = (0, 0)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        self._bar.stop()
        if kind is KeyboardInterrupt and self._cut is not None:
            driven, successes = self.counts
            reached = f"{driven} of {self._most} {self._doing}"
            failed = f", {driven - successes} failed" if self._reaching else ""
            text = f"interrupted after {reached}{failed}; {self._cut}"
            print_plain(self._console, text)

    def show(self, episodes: int, successes: int, doing: str | None = None) -> None:
        """Shows the episodes that were driven, and what is driven now."""
        self.counts = episodes, successes
        self._doing = doing or self._doing
        self._bar.update(
            self._row,
            completed=episodes,
            successes=successes,
            doing=escape(self._doing),
            refresh=True,
        )
        now = time.monotonic()
        if self._prints_lines and now >= self._next:
            self._next = now + SECONDS
            line = f"{self._doing}: the goal reached in {successes} of {episodes} …"
            print(line, file=sys.stderr, flush=True)

    def show_count(self, episodes: int) -> None:
        """Shows the episodes alone, where success is not what is looked for."""
        self.counts = episodes, self.counts[1]
        self._bar.update(self._row, completed=min(episodes, self._most), refresh=True)
        now = time.monotonic()
        if self._prints_lines and now >= self._next:
            self._next = now + SECONDS
            print(f"{self._doing}: {episodes} …", file=sys.stderr, flush=True)
