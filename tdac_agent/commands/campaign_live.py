"""A campaign while it goes on: a table on a terminal, lines in a file."""

from __future__ import annotations

import time
from collections.abc import Iterable

from rich import box
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.markup import escape
from rich.table import Table

from tdac_agent.campaign.executor import Died, Ended, Update
from tdac_agent.campaign.perform import Outcome, Terms
from tdac_agent.campaign.progress import Doing, Progress, Tally
from tdac_agent.commands.campaign_table import (
    COLOURS,
    LABEL_WIDTH,
    labels_of,
    told_counts,
    told_time,
)

FRAME_LINES = 8
"""Around the rows of the table."""


class LiveView:
    """What a campaign shows of itself. A context manager.

    Args:
        console: Where to.
        progress: Of the campaign.
        terms: What its runs share.
    """

    def __init__(self, console: Console, progress: Progress, terms: Terms) -> None:
        self._console = console
        self._progress = progress
        self._terms = terms
        self._labels = labels_of([t.cell for t in progress.tallies.values()])
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

    def saw(self, update: Update) -> None:
        """Tells what stays on the screen."""
        match update:
            case Died():
                told = f"the process of {update.planned.name} died; it goes on"
                self._console.print(f"[yellow]{escape(told)}[/]", soft_wrap=True)
            case Ended() if not self._console.is_terminal:
                self._console.print(self._line(update.outcome), soft_wrap=True)
            case Ended() if not update.outcome.finished:
                self._console.print(self._line(update.outcome), soft_wrap=True)

    def _line(self, outcome: Outcome) -> str:
        at = "" if outcome.tau is None else f" in iteration {outcome.tau}"
        why = f": {outcome.reason}" if outcome.reason else ""
        done = f"[{self._progress.finished}/{self._progress.planned}]"
        colour = COLOURS.get(outcome.status, "yellow")
        told = f"{outcome.status}{at}, {told_time(outcome.seconds)}{why}"
        return f"{escape(done)} {escape(outcome.name)} [{colour}]{escape(told)}[/]"

    def _render(self) -> RenderableType:
        doing = sorted(self._progress.doing.values(), key=lambda one: one.since)
        room = max(3, self._console.height - FRAME_LINES - len(doing))
        tallies = list(self._progress.tallies.values())
        shown = sorted(tallies, key=self._interest)[:room]
        table = self._table(tally for tally in tallies if tally in shown)
        lines = [self._doing(one) for one in doing]
        if len(shown) < len(tallies):
            lines.insert(
                0, f"[dim]and {len(tallies) - len(shown)} more kinds of run[/]"
            )
        return Group(table, *lines, told_counts(self._progress, going=True))

    def _interest(self, tally: Tally) -> tuple[bool, bool, bool]:
        """Kinds under way first, then those with something wrong, then unfinished."""
        at_work = {one.planned.cell.folder for one in self._progress.doing.values()}
        unfinished = tally.finished < tally.planned
        return tally.cell.folder not in at_work, not tally.halted, not unfinished

    def _table(self, tallies: Iterable[Tally]) -> Table:
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
        for name in self._labels.names:
            table.add_column(name, overflow="fold", min_width=LABEL_WIDTH)
        for name in ("runs", "verified", "not", "halted", "tokens", "USD"):
            table.add_column(name, justify="right", no_wrap=True)
        for tally in tallies:
            table.add_row(*map(escape, self._labels.of(tally.cell)), *_figures(tally))
        return table

    def _doing(self, one: Doing) -> str:
        seconds = told_time(time.monotonic() - one.since)
        return f"[cyan]▸[/] {escape(one.planned.name)} [dim]{seconds}[/] {one.said}"


def _figures(tally: Tally) -> list[str]:
    ended = tally.ended
    return [
        f"{tally.finished}/{tally.planned}",
        _number(ended["verified"], "green"),
        _number(ended["not verified"], "red"),
        _number(tally.halted, "yellow"),
        f"{tally.tokens:,}" if tally.tokens else "",
        "?" if tally.cost is None else f"{tally.cost:.2f}" if tally.cost else "",
    ]


def _number(count: int, colour: str) -> str:
    return f"[{colour}]{count}[/]" if count else "[dim]–[/]"
