"""`tdac runs [DIR]`: lists the runs and trainings in a folder."""

from __future__ import annotations

import json
import os
import shlex
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich import box
from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console
from tdac_agent.cli.run_view import resume_command
from tdac_agent.cli.sentences import print_sentences
from tdac_agent.errors import RunError
from tdac_agent.models.budget import format_usd
from tdac_agent.runs.run_record import (
    JOURNAL,
    RUN_FILE,
    Run,
    at_work,
    load_run,
    status_now,
)
from tdac_agent.training.curve import PLAN_FILE, read_curve

USUAL = Path("runs")
"""Default folder; it does not exist before the first run."""
DEEPEST = 6
"""Levels of subfolders that are searched for runs."""
WIDE = 100
"""Console width from which all columns fit."""
_COLOURS = {
    "verified": "green",
    "trained": "green",
    "selected": "green",
    "not verified": "red",
    "running": "cyan",
    "unreadable": "red",
}


def run(folder: Path, as_json: bool) -> int:
    """Prints the runs, the newest last; returns 0.

    Raises:
        RunError: There is no such folder.
    """
    try:
        rows = sorted(map(_row, _folders(folder)), key=_age)
    except OSError as error:
        if folder != USUAL or folder.exists():
            raise RunError(f"cannot read {folder}: {error.strerror}") from error
        rows = []
    if as_json:
        sys.stdout.write(json.dumps(rows, indent=2) + "\n")
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
            if row["go_on"]:
                console.print(f"to continue: {escape(row['go_on'])}", soft_wrap=True)
    else:
        console.print(f"no runs in {folder}; `tdac synth` makes one", soft_wrap=True)
    return 0


def _folders(folder: Path) -> list[Path]:
    """The run and training folders in a folder, itself included, at any usual depth.

    A campaign has its runs three levels below its folder. Nothing is searched below a
    run, in hidden folders, or behind symbolic links to folders.

    Raises:
        OSError: The folder cannot be read.
    """
    with os.scandir(folder):
        pass  # `os.walk` would report no error
    found = []
    for name, below, _ in os.walk(folder):
        place = Path(name)
        if _is_run(place):
            found.append(place)
        depth = len(place.relative_to(folder).parts)
        if depth == DEEPEST or (depth and place in found[-1:]):
            below.clear()
        below[:] = [each for each in below if not each.startswith(".")]
    return found


def _is_run(place: Path) -> bool:
    try:
        return any((place / name).is_file() for name in (RUN_FILE, JOURNAL, PLAN_FILE))
    except OSError:
        return False


def _training(folder: Path) -> dict[str, Any]:
    from tdac_agent.training.plan import read_plan  # imports Gymnasium

    try:
        plan, points = read_plan(folder), read_curve(folder)
    except RunError as error:
        return {"run": str(folder), "status": "unreadable", "reason": str(error)}
    last = max((point.steps for point in points), default=0)
    best = max(points, key=lambda point: point.worth, default=None)
    done = last >= plan.steps
    return {
        "run": str(folder),
        "task": plan.worlds,
        "learner": plan.algo,
        "status": "trained" if done else "not at its end",
        "steps": last,
        "of_steps": plan.steps,
        "success_rate": None if best is None else best.success_rate,
        "started": datetime.fromtimestamp(
            (folder / PLAN_FILE).stat().st_mtime, UTC
        ).isoformat(),
        "go_on": "" if done else shlex.join(["tdac", "train", "--resume", str(folder)]),
    }


def _training_progress(row: dict[str, Any]) -> str:
    """The steps of a training so far, and the success rate of its best policy."""
    rate = row["success_rate"]
    best = "" if rate is None else f", the best policy reached {rate:.0%} of the goals"
    return f"{row['run']}: {row['steps']:,} of {row['of_steps']:,} steps{best}"


def _row(folder: Path) -> dict[str, Any]:
    """The record of a run or training folder, also of a damaged one."""
    if (folder / PLAN_FILE).is_file():
        return _training(folder)
    before = at_work(folder)
    try:
        run = load_run(folder)
    except RunError as error:
        reason = str(error).removeprefix(f"{folder} is not a run folder: ")
        return {"run": str(folder), "status": "unreadable", "reason": reason}
    status = status_now(run, before=before)
    return {
        "run": str(folder),
        "task": run.task,
        "learner": run.learner,
        "optimizer": run.optimizer,
        "status": status,
        "k": _begun(run),
        "iterations": run.iterations,
        "tau": run.tau,
        "tokens_in": run.tokens_in,
        "tokens_out": run.tokens_out,
        "cost": run.cost,
        "cost_lost": run.cost_lost,
        "started": run.started,
        "seconds": run.seconds,
        "censored": run.censored,
        "reason": run.reason,
        "go_on": "" if status == "running" else resume_command(run),
    }


def _begun(run: Run) -> int:
    """The iteration that was begun last, though its candidate may not be judged yet."""
    folders = (run.folder / "iterations").glob("k*/")
    names = [folder.name[1:] for folder in folders]
    begun = [int(name) for name in names if name.isascii() and name.isdecimal()]
    return max([*begun, *(attempt.k for attempt in run.attempts)], default=0)


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
    return (
        f"{row['k']}/{row['iterations']}",
        str(tokens) if tokens else "–",
        cost if asked else "–",
    )


def _when(started: str) -> str:
    try:
        return f"{datetime.fromisoformat(started).astimezone():%m-%d %H:%M}"
    except (ValueError, OverflowError):
        return started[:11]
