"""`tdac synth`: shows live progress, then a table and the run folder."""

from __future__ import annotations

import shlex
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

from rich.markup import escape

from tdac_agent.cli.console import Console
from tdac_agent.cli.flags import TaskFlags, check_tier
from tdac_agent.cli.progress import Progress
from tdac_agent.cli.run_view import show_run
from tdac_agent.errors import ControllerFileError, Fault, RunError
from tdac_agent.library.listing import next_folder
from tdac_agent.models.ready import check_ready
from tdac_agent.problems.choice import problem_of
from tdac_agent.runs.ownership import is_own_folder
from tdac_agent.runs.resume import (
    check_own,
    existing_run,
    resume_arguments,
    resume_line,
)
from tdac_agent.runs.run_record import AGENT, Run, load_run
from tdac_agent.synthesis.setup import checked_vision
from tdac_agent.synthesis.synthesize import synthesize
from tdac_agent.tasks.task import Task, display_name
from tdac_agent.tasks.task_file import SET_FILE, TASK_FILE, Profile
from tdac_agent.tasks.trust import allowed
from tdac_agent.verification.diagnosis.measures import shortest_path_length
from tdac_agent.verification.verify import read_source

RECORDED = ("learner", "optimizer", "base_url", "max_cost", "max_tokens")
_EXIT = {"verified": 0, "budget": 4}


def run(
    flags: TaskFlags,
    profile: Profile | None,
    wanted: dict[str, Any],
    out: Path | None,
    start_from: Path | None,
    suite: Path | None,
    trust: bool,
    as_json: bool,
) -> int:
    """Synthesises a controller and prints the run; returns the exit code.

    Args:
        flags: Flags that name the task.
        profile: What a controller must define; by default as the task says.
        wanted: Further arguments of `synthesize`.
        out: Run folder; the next free one by default.
        start_from: Controller to begin with.
        suite: Folder with additional tests.
        trust: Whether the task's own tests may run.
        as_json: Whether to print the run record as JSON.
    """
    check_tier(wanted["tier"])
    check_models(wanted)
    console = Console(stderr=as_json)
    source = None if start_from is None else read_text(start_from)
    with console.status("preparing the task …"):
        task = allowed(flags.load().with_profile(profile), suite, trust=trust)
    folder = out if out is not None else next_folder(task.name)
    wanted = {**wanted, "problem": task, "out": folder, "start_from": source}
    return synthesise_and_show(wanted, console)


def resume(
    folder: Path,
    given: dict[str, Any],
    settings: dict[str, Any],
    trust: bool,
    as_json: bool,
    then_verify: bool = False,
) -> int:
    """Continues a run with its own settings; returns the exit code.

    Args:
        folder: Run folder.
        given: Flags given again, which permits their use by a run from elsewhere.
        settings: `max_cost` and `max_tokens`, where None keeps the run's limit; `tier`.
        trust: Whether a run from elsewhere may run and contact all that it names.
        as_json: Whether to print the run record as JSON.
        then_verify: Whether a controller for a task set drives on hidden worlds.
    """
    before = load_run(folder)
    if before.learner == AGENT:
        command = resume_line(before, folder)
        raise RunError(f"the candidates of {folder} come from an agent: {command}")
    if before.on_set:
        from tdac_agent.cli import synth_set

        own = {**given, **settings}
        return synth_set.resume(before, own, then_verify, trust, as_json)
    if then_verify:
        raise RunError(f"--then-verify is for task sets; {folder} is a run on a task")
    check_tier(settings["tier"])
    console = Console(stderr=as_json)
    if before.finished:
        check_own(before)
        return _show(before, console, before=before)
    check_ready_again(before, {**given, **settings})
    with console.status("preparing the task …"):
        wanted = resume_arguments(folder, {**given, **settings}, trust=trust)
    return synthesise_and_show(wanted, console)


def check_models(wanted: dict[str, Any]) -> None:
    """Checks the models of a new run before its task is loaded; see `check_ready`.

    Args:
        wanted: Arguments of `synthesize`.
    """
    names = [wanted["learner"], wanted["optimizer"] or wanted["learner"]]
    loop = (wanted["patience"], wanted["improve"])
    checked_vision(wanted["vision"], names[1], *loop)
    check_ready(names, wanted)


def check_ready_again(before: Run, given: dict[str, Any]) -> None:
    """Checks the models of a run of this installation before its task is loaded.

    Another installation's run may name a server that needs the user's permission. A
    run that was hardly begun, or that other models are given for, is refused later.

    Args:
        before: The run.
        given: Arguments given again; None keeps the run's limit.
    """
    known = {name: getattr(before, name) for name in RECORDED}
    new = {name: value for name, value in given.items() if value is not None}
    wanted, models = {**known, **new}, ("learner", "optimizer")
    same = all(wanted[name] == known[name] for name in models)
    files = (before.folder / TASK_FILE, before.folder / SET_FILE)
    if same and is_own_folder(before) and any(map(Path.is_file, files)):
        check_ready([wanted[name] for name in models], wanted)


def synthesise_and_show(wanted: dict[str, Any], console: Console) -> int:
    """Synthesises with live progress and prints the run; returns the exit code.

    Args:
        wanted: Arguments of `synthesize`, including `optimizer`.
        console: Console to print to; if it is stderr, the run record goes to stdout as
            JSON.
    """
    task, folder = problem_of(wanted["problem"]).task, wanted["out"]
    assert task is not None
    heading = _heading(task, wanted["learner"], wanted["optimizer"])
    before = existing_run(folder)
    try:
        with Progress(console, heading) as progress:
            result = synthesize(**wanted, on_event=progress)
    except (KeyboardInterrupt, Fault, OSError):
        console.print(_so_far(folder), soft_wrap=True)
        raise
    return _show(result, console, before=before)


def _show(run: Run, console: Console, *, before: Run | None) -> int:
    """Prints a run, as JSON if the console is stderr; returns the exit code."""
    if console.stderr:
        sys.stdout.write(run.model_dump_json(indent=2) + "\n")
        return _EXIT.get(run.status, 1)
    if before is not None and before.finished:
        note = f"the run in {run.folder} has already finished; nothing was done"
        console.print(note, soft_wrap=True)
    show_run(run, console)
    return _EXIT.get(run.status, 1)


def _so_far(folder: Path) -> str:
    """Where the unfinished run is, and the command to continue it."""
    if not (folder / TASK_FILE).is_file():
        return "the run had not begun"
    command = shlex.join(["tdac", "synth", "--resume", str(folder)])
    # The first error is the one to report.
    with suppress(RunError):
        run = load_run(folder)
        if run.verified:
            told = f"verified in iteration {run.tau}: {run.controller}"
            return f"{told}; to go on improving it: {command}"
    return f"the run so far is in {folder}; to continue: {command}"


def read_text(path: Path) -> str:
    """The text of a controller file.

    Raises:
        ControllerFileError: The file cannot be read, or is not UTF-8.
    """
    try:
        return read_source(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise ControllerFileError(
            f"{path} is not UTF-8 text: {error.reason}"
        ) from error


def _heading(task: Task, learner: str, optimizer: str | None) -> str:
    nominal, setting = task.nominal, task.setting
    model = " (a tuned template, no language model)" if learner == "builtin" else ""
    if optimizer not in (None, learner):
        model += f", optimizer [bold]{escape(str(optimizer))}[/]"
    return (
        f"task [bold]{escape(display_name(task))}[/]: shortest path "
        f"{setting.length_text(shortest_path_length(nominal))}, "
        f"body radius {setting.length_text(nominal.body_radius)}, "
        f"at most {nominal.horizon} steps; "
        f"learner [bold]{escape(learner)}[/]{model}" + "".join(_remarks(task))
    )


def _remarks(task: Task) -> list[str]:
    """Lines on how the map or world was read, and notes that need attention."""
    setting = task.setting
    lines = [f"\n{escape(line)}" for line in setting.remarks()]
    notes = [*setting.params.notes, *(f"left out: {name}" for name in setting.left_out)]
    return lines + [f"\n[yellow]note: {escape(note)}[/]" for note in notes]
