"""Tables of kinds of run, and a one-line summary of a campaign's progress."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich import box
from rich.table import Table

from tdac_agent.campaign.plan import Cell
from tdac_agent.campaign.progress import CampaignProgress
from tdac_agent.cli.console import Console
from tdac_agent.models.budget import format_usd

LABEL_WIDTH = 6
FILE_WIDTH = 130
"""Least width of tables that are written to a file."""
ALWAYS = ("task", "learner")
SOMETIMES = ("optimizer", "prompt", "setting")


@dataclass(frozen=True, slots=True)
class Labels:
    """The names of the labels that distinguish the kinds of run of a campaign."""

    names: tuple[str, ...]

    def of(self, cell: Cell) -> list[str]:
        """The labels of a kind of run."""
        labels = {
            "task": cell.task_name,
            "learner": cell.learner,
            "optimizer": cell.optimizer,
            "prompt": Path(cell.prompt).name,
            "setting": cell.setting,
        }
        return [labels[name] for name in self.names]


def labels_of(cells: Sequence[Cell]) -> Labels:
    """Labels for task, learner and every other setting that varies."""
    rows = [(c.optimizer != c.learner, c.optimizer, c.prompt, c.setting) for c in cells]
    other = any(row[0] for row in rows)
    varied = {"optimizer": other, "prompt": _several(rows, 2)}
    varied["setting"] = _several(rows, 3)
    return Labels((*ALWAYS, *(name for name in SOMETIMES if varied[name])))


def _several(rows: Sequence[tuple[object, ...]], column: int) -> bool:
    return len({row[column] for row in rows}) > 1


def make_console(*, stderr: bool) -> Console:
    """A console; at least `FILE_WIDTH` wide if it writes to a file."""
    console = Console(stderr=stderr, highlight=False)
    if not console.is_terminal:
        console.width = max(console.width, FILE_WIDTH)
    return console


def make_table(labels: Iterable[str], figures: Iterable[str]) -> Table:
    """An empty table of kinds of run; a narrow console folds the labels."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for name in labels:
        table.add_column(name, overflow="fold", min_width=LABEL_WIDTH)
    for name in figures:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def progress_line(progress: CampaignProgress, *, going: bool = False) -> str:
    """The progress of a campaign in one line; `going` if it is still running."""
    parts = [f"[bold]{progress.finished} of {progress.planned}[/] runs have ended"]
    if going:
        parts.append(f"{len(progress.doing)} running")
        parts.append(f"{format_duration(progress.seconds)} elapsed")
        left = progress.seconds_left
        parts.append("" if left is None else f"about {format_duration(left)} left")
    elif progress.now:
        parts.append(
            f"{progress.now} of them now, in {format_duration(progress.seconds)}"
        )
    if progress.deaths:
        parts.append(f"{progress.deaths} processes died and were replaced")
    if progress.tokens:
        parts.append(f"{progress.tokens:,} tokens, {format_usd(progress.cost)}")
    if progress.exhausted:
        parts.append("[yellow]the budget is exhausted[/]")
    return ", ".join(part for part in parts if part)


def format_duration(seconds: float) -> str:
    """A duration in readable form: `41 s`, `12:05 min`, `7:30 h`."""
    whole = round(seconds)
    if whole < 100:
        return f"{seconds:.1f} s" if whole < 10 else f"{whole} s"
    if whole < 6000:
        return f"{whole // 60}:{whole % 60:02d} min"
    return f"{whole // 3600}:{whole // 60 % 60:02d} h"
