"""Lists the runs and trainings in a folder."""

from __future__ import annotations

import itertools
import os
import shlex
from collections.abc import Collection
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tdac_agent.errors import RunError
from tdac_agent.runs.resume import resume_words
from tdac_agent.runs.run_record import (
    JOURNAL,
    RUN_FILE,
    Run,
    at_work,
    load_run,
    status_now,
)
from tdac_agent.training.curve import PLAN_FILE, read_curve

DEEPEST = 6
"""Levels of subfolders that are searched for runs."""


def folders_of(folder: Path) -> list[Path]:
    """The run and training folders in a folder, itself included, at any usual depth.

    A campaign has its runs three levels below its folder. Nothing is searched below a
    run, in hidden folders, or behind symbolic links to folders.

    Raises:
        OSError: The folder cannot be read.
    """
    with os.scandir(folder):
        pass  # `os.walk` would report no error
    folders = []
    for name, below, _ in os.walk(folder):
        place = Path(name)
        if _is_run(place):
            folders.append(place)
        depth = len(place.relative_to(folder).parts)
        if depth == DEEPEST or (depth and place in folders[-1:]):
            below.clear()
        below[:] = [each for each in below if not each.startswith(".")]
    return folders


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


def row_of(folder: Path) -> dict[str, Any]:
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
        "agent": run.agent,
        "clients": list(run.clients),
        "status": status,
        "k": _begun(run),
        "iterations": run.iterations,
        "variations": len(run.attempts) - len(run.of_loop) if run.improve else 0,
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


def variations_text(row: dict[str, Any]) -> str:
    """What is added to the iteration in the row of a run, if it varies what works."""
    varied = row["variations"]
    return f", {varied} variation{'s' * (varied > 1)}" if varied else ""


def _begun(run: Run) -> int:
    """The iteration that was begun last, though its candidate may not be judged yet.

    Variations of what works are no iterations.
    """
    folders = (run.folder / "iterations").glob("k*/")
    names = [folder.name[1:] for folder in folders]
    begun = [int(name) for name in names if name.isascii() and name.isdecimal()]
    ks = [*begun, *(attempt.k for attempt in run.attempts)]
    return max((k for k in ks if k <= run.iterations), default=0)


def resume_command(run: Run) -> str:
    """The command that continues a run; empty if the run has finished."""
    if run.finished:
        return ""
    more = () if run.enough is None else run.enough.words
    return shlex.join([*resume_words(run, run.folder), *more])


def next_folder(name: str, place: Path = Path(), taken: Collection[str] = ()) -> Path:
    """`runs/NAME-N` with the first free number N, relative to `place`.

    Args:
        name: What the folder is about.
        place: Where the folder `runs` is.
        taken: Folders that will be made by others.
    """
    for number in itertools.count(1):
        folder = Path("runs") / f"{name}-{number}"
        if str(folder) not in taken and not (place / folder).exists():
            return folder
    raise AssertionError("unreachable")
