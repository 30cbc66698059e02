"""`tdac synth`: live progress, then a table and the run folder."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path
from typing import Any

from rich.markup import escape

from tdac_agent.cli.console import Console
from tdac_agent.cli.flags import TaskFlags
from tdac_agent.cli.progress import Progress
from tdac_agent.cli.run_view import show_run
from tdac_agent.errors import ControllerFileError, Fault
from tdac_agent.runs.records import Run, load_run
from tdac_agent.runs.resume import asked_for, check_own, run_there
from tdac_agent.synthesis.loop import synthesize
from tdac_agent.tasks.task import Task, called
from tdac_agent.tasks.task_file import TASK_FILE
from tdac_agent.tasks.trust import allowed
from tdac_agent.verification.verify import read_source

_EXIT = {"verified": 0, "budget": 4}


def run(
    flags: TaskFlags,
    wanted: dict[str, Any],
    out: Path | None,
    start_from: Path | None,
    suite: Path | None,
    trust: bool,
    as_json: bool,
) -> int:
    """Synthesises and prints; returns the exit code.

    Args:
        flags: That name the task.
        wanted: Further arguments of `synthesize`.
        out: Run folder; the next free one by default.
        start_from: Controller to begin with.
        suite: Folder with further tests.
        trust: Whether what the task brings may run.
        as_json: Whether to print the record.
    """
    console = Console(stderr=as_json)
    source = None if start_from is None else read_text(start_from)
    with console.status("preparing the task …"):
        task = allowed(flags.load(), suite, trust=trust)
    folder = out if out is not None else next_folder(task.name)
    wanted = {**wanted, "task": task, "out": folder, "start_from": source}
    return synthesise_and_show(wanted, console)


def resume(
    folder: Path,
    given: dict[str, Any],
    limits: dict[str, Any],
    trust: bool,
    as_json: bool,
) -> int:
    """Goes on with a run as it was begun; returns the exit code.

    Args:
        folder: Of the run.
        given: Flags that allow what the run of somebody else's wants.
        limits: `max_cost` and `max_tokens`, None where they stay.
        trust: Whether a run of somebody else's may do what it wants.
        as_json: Whether to print the record.
    """
    console = Console(stderr=as_json)
    before = load_run(folder)
    if before.finished:
        check_own(before)
        return _show(before, console, before=before)
    with console.status("preparing the task …"):
        wanted = asked_for(folder, {**given, **limits}, trust=trust)
    return synthesise_and_show(wanted, console)


def synthesise_and_show(wanted: dict[str, Any], console: Console) -> int:
    """Synthesises with live progress, and prints what came out; the exit code.

    Args:
        wanted: Arguments of `synthesize`, `optimizer` among them.
        console: Where to; the record goes to stdout as JSON where this is stderr.
    """
    task, folder = wanted["task"], wanted["out"]
    optimizer = wanted["optimizer"]
    heading = _heading(task, wanted["learner"], optimizer)
    before = run_there(folder)
    try:
        with Progress(console, heading) as progress:
            result = synthesize(**wanted, on_event=progress)
    except (KeyboardInterrupt, Fault, OSError):
        console.print(_so_far(folder), soft_wrap=True)
        raise
    return _show(result, console, before=before)


def _show(run: Run, console: Console, *, before: Run | None) -> int:
    """Prints a run, as JSON where the console is not for it; returns the exit code."""
    if console.stderr:
        sys.stdout.write(run.model_dump_json(indent=2) + "\n")
        return _EXIT.get(run.status, 1)
    if before is not None and before.finished:
        told = f"{run.folder} has ended before; nothing was done"
        console.print(told, soft_wrap=True)
    show_run(run, console)
    return _EXIT.get(run.status, 1)


def _so_far(folder: Path) -> str:
    """What there is of a run that did not come to its end."""
    if not (folder / TASK_FILE).is_file():
        return "nothing was begun"
    return f"the run so far is in {folder}; go on: tdac synth --resume {folder}"


def read_text(path: Path) -> str:
    """Text of a controller file.

    Raises:
        ControllerFileError: It cannot be read, or is not UTF-8.
    """
    try:
        return read_source(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise ControllerFileError(
            f"{path} is not UTF-8 text: {error.reason}"
        ) from error


def _heading(task: Task, learner: str, optimizer: str | None) -> str:
    nominal, units = task.nominal, task.setting.units
    radius = units.scale * nominal.body_radius
    model = " (a tuned template, no language model)" if learner == "builtin" else ""
    if optimizer not in (None, learner):
        model += f", optimizer [bold]{escape(str(optimizer))}[/]"
    return (
        f"task [bold]{escape(called(task))}[/]: {units.told(nominal.shortest)} for a "
        f"disc of {radius:g} {units.length}, at most {nominal.horizon} steps; learner "
        f"[bold]{escape(learner)}[/]{model}" + "".join(_remarks(task))
    )


def _remarks(task: Task) -> list[str]:
    """How map or world was read, and what a person should look at."""
    setting = task.setting
    lines = [f"\n{escape(line)}" for line in setting.remarks()]
    notes = [*setting.params.notes, *(f"left out: {name}" for name in setting.left_out)]
    return lines + [f"\n[yellow]note: {escape(note)}[/]" for note in notes]


def next_folder(name: str) -> Path:
    """`runs/NAME-1`, or the first number that is free."""
    for number in itertools.count(1):
        folder = Path("runs") / f"{name}-{number}"
        if not folder.exists():
            return folder
    raise AssertionError("unreachable")
