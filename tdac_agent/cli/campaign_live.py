"""Live progress of a campaign: a table on a terminal, lines in a file."""

from __future__ import annotations

import time
from collections.abc import Iterable

from rich.console import Group, RenderableType
from rich.live import Live
from rich.markup import escape
from rich.padding import Padding
from rich.progress_bar import ProgressBar
from rich.table import Table

from tdac_agent.campaign.perform import Outcome
from tdac_agent.campaign.progress import CampaignProgress, Doing, RunUpdate, Tally
from tdac_agent.cli.campaign_table import (
    format_duration,
    labels_of,
    make_table,
    progress_line,
)
from tdac_agent.cli.console import Console
from tdac_agent.cli.sentences import print_sentences
from tdac_agent.executors.executor import Died, Ended
from tdac_agent.verification.verdict import COLOURS

FRAME_LINES = 10
"""Screen lines outside the rows of the table."""
BAR_WIDTH = 60


class LiveView:
    """Context manager that shows the progress of a campaign."""

    def __init__(self, console: Console, progress: CampaignProgress) -> None:
        self._console = console
        self._progress = progress
        cells = [tally.cell for tally in progress.tallies.values()]
        self._labels = labels_of(cells)
        self._paid = any(cell.asks_models for cell in cells)
        self._live = Live(
            get_renderable=self._render,
            console=console,
            refresh_per_second=2,
            transient=True,
        )

    def __enter__(self) -> LiveView:
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self._console.is_terminal:
            self._live.stop()

    def saw(self, update: RunUpdate) -> None:
        """Prints the lines that stay on the screen."""
        match update:
            case Died():
                death = f"the process of {update.job.name} died: {update.reason}"
                print_sentences(
                    self._console, f"{death}; a new one continues its run", "yellow"
                )
            case Ended() if not self._console.is_terminal:
                self._console.print(self._line(update.outcome), soft_wrap=True)
            case Ended() if not update.outcome.finished:
                self._console.print(self._line(update.outcome), soft_wrap=True)

    def _line(self, outcome: Outcome) -> str:
        at = "" if outcome.tau is None else f" in iteration {outcome.tau}"
        explained = outcome.reason and outcome.status not in ("verified", "passed")
        why = f": {outcome.reason}" if explained else ""
        done = f"[{self._progress.finished}/{self._progress.planned}]"
        colour = COLOURS.get(outcome.status, "yellow")
        status = f"{outcome.status}{at}, {format_duration(outcome.seconds)}{why}"
        return f"{escape(done)} {escape(outcome.name)} [{colour}]{escape(status)}[/]"

    def _render(self) -> RenderableType:
        doing = sorted(self._progress.doing.values(), key=lambda one: one.since)
        room = max(3, self._console.height - FRAME_LINES - len(doing))
        tallies = list(self._progress.tallies.values())
        shown = sorted(tallies, key=self._sort_key)[:room]
        table = self._table(tally for tally in tallies if tally in shown)
        more = len(tallies) - len(shown)
        others = [f"[dim]and {more} more kinds of run[/]"] if more else []
        counts = progress_line(self._progress, going=True)
        return Group(table, *others, self._current_runs(doing), self._bar(), counts)

    def _sort_key(self, tally: Tally) -> tuple[bool, bool, bool]:
        """Sorts running kinds first, then those with halted runs, then unfinished."""
        running = {one.planned.cell.folder for one in self._progress.doing.values()}
        unfinished = tally.finished < tally.planned
        return tally.cell.folder not in running, not tally.halted, not unfinished

    def _table(self, tallies: Iterable[Tally]) -> Table:
        spent = ("tokens", "USD") if self._paid else ()
        table = make_table(
            self._labels.names,
            ("ended", "verified", "passed", "not verified", "halted", *spent),
        )
        for tally in tallies:
            figures = [*_counts(tally), *(_spent(tally) if self._paid else [])]
            table.add_row(*map(escape, self._labels.of(tally.cell)), *figures)
        return table

    def _current_runs(self, doing: Iterable[Doing]) -> Table:
        """The current runs: name, elapsed time and current activity."""
        grid = Table.grid(padding=(0, 2, 0, 0))
        grid.add_column(overflow="fold")
        grid.add_column(justify="right", no_wrap=True)
        grid.add_column(no_wrap=True)
        for one in doing:
            labels = " ".join(self._labels.of(one.planned.cell))
            name = f"[cyan]▸[/] {escape(labels)} [dim]r{one.planned.index:04d}[/]"
            grid.add_row(
                name, format_duration(time.monotonic() - one.since), one.activity
            )
        return grid

    def _bar(self) -> Padding:
        progress = self._progress
        bar = ProgressBar(progress.planned, progress.finished, BAR_WIDTH)
        return Padding(bar, (1, 0, 0, 0))  # the padding also ends the bar's line


def _counts(tally: Tally) -> list[str]:
    ended = tally.ended
    return [
        f"{tally.finished}/{tally.planned}",
        _number(ended["verified"], COLOURS["verified"]),
        _number(ended["passed"], COLOURS["passed"]),
        _number(ended["not verified"], COLOURS["not verified"]),
        _number(tally.halted, "yellow"),
    ]


def _spent(tally: Tally) -> list[str]:
    cost = tally.cost
    return [
        f"{tally.tokens:,}" if tally.tokens else "",
        "?" if cost is None else f"{cost:.2f}" if cost else "",
    ]


def _number(count: int, colour: str) -> str:
    return f"[{colour}]{count}[/]" if count else "[dim]–[/]"
