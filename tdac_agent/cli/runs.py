"""`tdac runs [DIR]`: lists the runs and trainings in a folder."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Any

from rich import box
from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.sentences import print_plain, print_sentences
from tdac_agent.errors import RunError
from tdac_agent.library.listing import folders_of, row_of
from tdac_agent.models.budget import format_usd
from tdac_agent.verification.verdict import COLOURS

USUAL = Path("runs")
"""Default folder; it does not exist before the first run."""
WIDE = 100
"""Console width from which all columns fit."""
_COLOURS = {
    **COLOURS,
    "trained": "green",
    "running": "cyan",
    "unreadable": "red",
}


def run(folder: Path, as_json: bool) -> int:
    """Prints the runs, the newest last; returns 0.

    Raises:
        RunError: There is no such folder.
    """
    try:
        rows = sorted(map(row_of, folders_of(folder)), key=_age)
    except OSError as error:
        if folder != USUAL or folder.exists():
            raise RunError(f"cannot read {folder}: {error.strerror}") from error
        rows = []
    if as_json:
        print_json(rows)
        return 0
    console = Console()
    if rows:
        console.print(_table(rows, folder, console.width))
        for row in rows:
            if row["status"] == "unreadable":
                print_sentences(console, f"{row['run']}: {row['reason']}", "red")
                continue
            if "steps" in row:
                print_sentences(console, _training_progress(row))
            if row.get("agent"):
                print_sentences(console, _agent(row))
            if row["go_on"]:
                print_plain(console, f"{_what_goes_on(row)}: {row['go_on']}")
    else:
        console.print(f"no runs in {folder}; `tdac synth` makes one", soft_wrap=True)
    return 0


def _training_progress(row: dict[str, Any]) -> str:
    """The steps of a training so far, and the success rate of its best policy."""
    rate = row["success_rate"]
    best = "" if rate is None else f", the best policy reached {rate:.0%} of the goals"
    return f"{row['run']}: {row['steps']:,} of {row['of_steps']:,} steps{best}"


def _what_goes_on(row: dict[str, Any]) -> str:
    if row["status"] != "passed":
        return "to continue"
    return f"{row['run']} has passed; to go on improving it"


def _agent(row: dict[str, Any]) -> str:
    """How the agent of a run was connected, and its programs."""
    clients = ", ".join(row["clients"])
    return f"{row['run']}: agent: {row['agent']}{f' ({clients})' if clients else ''}"


def _age(row: dict[str, Any]) -> tuple[str, str]:
    return row.get("started", ""), row["run"]


def _table(rows: list[dict[str, Any]], folder: Path, width: int) -> Table:
    """One line per run; cuts long learner names, drops columns on a narrow console."""
    wide = width >= WIDE
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1))
    within = max(len(row["run"]) for row in rows) > width // 2
    if within:
        table.title, table.title_justify = escape(f"in {folder}:"), "left"
    table.add_column("run", overflow="fold")
    if wide:
        table.add_column("task", no_wrap=True)
    table.add_column("learner", overflow="ellipsis", min_width=8)
    table.add_column("status", no_wrap=True)
    figures = _figures(rows)
    for name in figures:
        table.add_column(name, justify="right", no_wrap=True)
    if wide:
        table.add_column("started", no_wrap=True)
    legend = ["k: iterations begun / allowed"] if "k" in figures else []
    if any("+" in cell for cell in figures.get("k", ())):
        legend[0] += ", + variations of what works"
    if any("–" in column for column in figures.values()):
        legend.append("–: no model was asked, or it does not report this")
    table.caption = "; ".join(legend)
    table.caption_justify = "left"
    for number, row in enumerate(rows):
        status = row["status"]
        task, started = row.get("task", ""), _when(row.get("started", ""))
        table.add_row(
            escape(_within(folder, row["run"]) if within else row["run"]),
            *([escape(task)] if wide else []),
            # No-break spaces: the name is cut, not wrapped.
            escape(row.get("learner", "").replace(" ", "\N{NO-BREAK SPACE}")),
            f"[{_COLOURS.get(status, 'yellow')}]{status}[/]",
            *(column[number] for column in figures.values()),
            *([escape(started)] if wide else []),
        )
    return table


def _within(folder: Path, run: str) -> str:
    """The path of a run, relative to the folder that the user gave."""
    return str(Path(run).relative_to(folder))


def _figures(rows: list[dict[str, Any]]) -> dict[str, list[str]]:
    """The columns of figures by name, without empty ones."""
    lines = [_figures_of(row) for row in rows]
    columns = {
        name: [line[at] for line in lines]
        for at, name in enumerate(("k", "tokens", "cost"))
    }
    return {name: cells for name, cells in columns.items() if set(cells) - {"–", ""}}


def _figures_of(row: dict[str, Any]) -> tuple[str, str, str]:
    """Iterations, tokens and cost of a run; a dash for what is not reported."""
    if "k" not in row:
        return "", "", ""
    tokens = row["tokens_in"] + row["tokens_out"]
    cost = "unknown" if row["cost"] is None else format_usd(row["cost"])
    asked = tokens or row["cost"] != 0.0
    varied = f" +{row['variations']}" if row["variations"] else ""
    return (
        f"{row['k']}/{row['iterations']}{varied}",
        str(tokens) if tokens else "–",
        cost if asked else "–",
    )


def _when(started: str) -> str:
    try:
        return f"{datetime.fromisoformat(started).astimezone():%m-%d %H:%M}"
    except (ValueError, OverflowError):
        return started[:11]
