"""`tdac synth`: shows live progress, then a table and the run folder."""

from __future__ import annotations

import shlex
from collections.abc import Collection
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any

import typer
from rich.markup import escape

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.dry_run import dry_run
from tdac_agent.cli.progress import SynthProgress
from tdac_agent.cli.run_view import show_run, show_selection
from tdac_agent.cli.sentences import print_plain
from tdac_agent.cli.synth_flags import RunFlags
from tdac_agent.cli.synth_options import SynthOptions
from tdac_agent.cli.task_choice import check_tier, chosen, scope
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.cli.typed_options import flag_name
from tdac_agent.errors import ControllerFileError, Fault, RunError
from tdac_agent.library.listing import next_folder
from tdac_agent.models.ready import check_ready
from tdac_agent.prompting.given_rules import read_given
from tdac_agent.runs.ownership import is_own_folder
from tdac_agent.runs.resume import (
    check_own,
    existing_run,
    resume_arguments,
    resume_line,
)
from tdac_agent.runs.run_record import AGENT, Run, load_run
from tdac_agent.set_synthesis.resume import resume_set_arguments
from tdac_agent.set_synthesis.synthesize import synthesize_on_set
from tdac_agent.synthesis.loop import synthesize
from tdac_agent.synthesis.setup import checked_vision
from tdac_agent.tasks.task import Task, display_name
from tdac_agent.tasks.task_file import SET_FILE, TASK_FILE
from tdac_agent.tasks.trust import allowed
from tdac_agent.verification.diagnosis.measures import shortest_path_length
from tdac_agent.verification.verify import read_source
from tdac_envs.ladder.task_sets import TaskSet

RECORDED = ("learner", "optimizer", "base_url", "max_cost", "max_tokens")
ALLOWED = frozenset(
    {"learner", "optimizer", "base_url", "key_over_http", "prompt", "suite", "seed"}
)
"""Flags that, given with --resume, permit a run from elsewhere to use their values."""
WITH_RESUME = ALLOWED | {
    *("resume", "max_cost", "max_tokens", "tier", "as_json", "trust", "then_verify"),
}
_EXIT = {"verified": 0, "selected": 0, "budget": 4}


def run(
    context: typer.Context,
    flags: TaskFlags,
    options: SynthOptions,
    run_flags: RunFlags,
) -> int:
    """Synthesises a controller and prints the run; returns the exit code."""
    if run_flags.resume is not None:
        sources = {name: context.get_parameter_source(name) for name in context.params}
        typed = {n for n, s in sources.items() if s and s.name == "COMMANDLINE"}
        return resume(options, run_flags, typed)
    if run_flags.dry_run:
        return dry_run(flags, options, run_flags)
    check_tier(options.tier)
    check_models(options)
    console = Console(stderr=run_flags.as_json)
    settings = arguments_of(options)
    with console.status("preparing the task …"):
        problem = chosen(flags, options, run_flags)
        if isinstance(problem, Task):
            problem = problem.with_profile(run_flags.profile)
            problem = allowed(problem, run_flags.suite, trust=run_flags.trust)
    return write(problem, run_flags.out or next_folder(problem.name), settings, console)


def arguments_of(options: SynthOptions) -> dict[str, Any]:
    """The arguments of a synthesis; files are read."""
    named = {field.name: getattr(options, field.name) for field in fields(options)}
    source, rules = options.start_from, options.rules
    named["start_from"] = None if source is None else read_text(source)
    named["rules"] = None if rules is None else read_given(rules)
    return named


def write(
    problem: Task | TaskSet, folder: Path, settings: dict[str, Any], console: Console
) -> int:
    """Synthesises with live progress and prints the run; returns the exit code.

    Args:
        problem: Task or task set.
        folder: Run folder.
        settings: Arguments of a synthesis.
        console: Console to print to; if it is stderr, the run record goes to stdout as
            JSON.
    """
    before, on_set = existing_run(folder), isinstance(problem, TaskSet)
    heading = _heading(problem, settings["learner"], settings["optimizer"])
    try:
        with SynthProgress(console, heading, on_set=on_set) as progress:
            if isinstance(problem, TaskSet):
                own = {"tasks": problem, "out": folder, "on_event": progress}
                result = synthesize_on_set(**settings | own)
            else:
                names = [f.name for f in fields(SynthOptions) if scope(f) == "set"]
                settings = {n: v for n, v in settings.items() if n not in names}
                own = {"task": problem, "out": folder, "on_event": progress}
                result = synthesize(**settings | own)
    except (KeyboardInterrupt, Fault, OSError):
        print_plain(console, _so_far(folder))
        raise
    return _show(result, console, before=before)


def resume(options: SynthOptions, run_flags: RunFlags, typed: Collection[str]) -> int:
    """Continues a run with its own settings; returns the exit code.

    Args:
        options: Limits and tier may be new; others permit a run from elsewhere to use
            its own values.
        run_flags: Folder of the run, and whether a run from elsewhere may run and
            contact all that it names.
        typed: Names of the flags on the command line.
    """
    assert run_flags.resume is not None
    _refuse_others(typed, TaskFlags(), options, run_flags)
    before = load_run(run_flags.resume)
    if before.learner == AGENT:
        command = resume_line(before, run_flags.resume)
        raise RunError(
            f"the candidates of {run_flags.resume} come from an agent: {command}"
        )
    if options.then_verify and not before.on_set:
        raise RunError(
            f"--then-verify is for task sets; {run_flags.resume} is a run on a task"
        )
    check_tier(options.tier)
    console = Console(stderr=run_flags.as_json)
    more = before.status == "selected" and options.then_verify
    if before.finished and not more:
        check_own(before)
        return _show(before, console, before=before)
    everything = {**arguments_of(options), "suite": run_flags.suite}
    known = {name: everything[name] for name in ALLOWED & set(typed)}
    known |= {n: everything[n] for n in ("max_cost", "max_tokens", "tier")}
    check_ready_again(before, known)
    with console.status("preparing the task …"):
        if before.on_set:
            wanted = resume_set_arguments(before, known, trust=run_flags.trust)
            wanted["then_verify"] = options.then_verify
        else:
            wanted = resume_arguments(run_flags.resume, known, trust=run_flags.trust)
    problem = wanted.pop("tasks" if before.on_set else "task")
    return write(problem, wanted.pop("out"), wanted, console)


def _refuse_others(typed: Collection[str], *options: Any) -> None:
    """Refuses flags whose values --resume takes from the run folder.

    Raises:
        RunError: Such a flag is given; the message names it.
    """
    known = [field for each in options for field in fields(each)]
    wrong = [each for each in known if each.name in set(typed) - WITH_RESUME]
    if wrong:
        names = ", ".join(map(flag_name, wrong))
        raise RunError(f"--resume continues a run as it was begun: leave out {names}")


def check_models(options: SynthOptions) -> None:
    """Checks the models of a new run before its task is loaded; see `check_ready`."""
    names = [options.learner, options.optimizer or options.learner]
    checked_vision(options.vision, names[1], options.patience, options.improve)
    limits = (*RECORDED, "key_over_http")
    check_ready(names, {name: getattr(options, name) for name in limits})


def check_ready_again(before: Run, known: dict[str, Any]) -> None:
    """Checks the models of a run of this installation before its task is loaded.

    Another installation's run may name a server that needs the user's permission. A
    run that was hardly begun, or that other models are given for, is refused later.

    Args:
        before: The run.
        known: Arguments typed again; None keeps the run's limit.
    """
    own = {name: getattr(before, name) for name in RECORDED}
    new = {name: value for name, value in known.items() if value is not None}
    wanted, models = {**own, **new}, ("learner", "optimizer")
    same = all(wanted[name] == own[name] for name in models)
    files = (before.folder / TASK_FILE, before.folder / SET_FILE)
    if same and is_own_folder(before) and any(map(Path.is_file, files)):
        check_ready([wanted[name] for name in models], wanted)


def _show(run: Run, console: Console, *, before: Run | None) -> int:
    """Prints a run, as JSON if the console is stderr; returns the exit code."""
    if console.stderr:
        print_json(run)
        return _EXIT.get(run.status, 1)
    if before is not None and before.finished and before.status == run.status:
        note = f"the run in {run.folder} has already finished; nothing was done"
        print_plain(console, note)
    (show_selection if run.on_set else show_run)(run, console)
    return _EXIT.get(run.status, 1)


def _so_far(folder: Path) -> str:
    """Where the unfinished run is, and the command to continue it."""
    if not any((folder / name).is_file() for name in (TASK_FILE, SET_FILE)):
        return "the run had not begun"
    command = shlex.join(["tdac", "synth", "--resume", str(folder)])
    # The first error is the one to report.
    with suppress(RunError):
        run = load_run(folder)
        if run.verified and not run.on_set:
            result = f"verified in iteration {run.tau}: {run.controller}"
            return f"{result}; to go on improving it: {command}"
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


def _heading(problem: Task | TaskSet, learner: str, optimizer: str | None) -> str:
    on_set = isinstance(problem, TaskSet)
    kind = "no language model" if on_set else "a tuned template, no language model"
    model = f"learner [bold]{escape(learner)}[/]"
    model += f" ({kind})" if learner == "builtin" else ""
    if optimizer not in (None, learner):
        model += f", optimizer [bold]{escape(str(optimizer))}[/]"
    if isinstance(problem, TaskSet):
        digest = f"[bold]{escape(problem.name)}[/] {problem.sha256[:8]}"
        return f"task set {digest}, worlds of dev; {model}"
    nominal, setting = problem.nominal, problem.setting
    return (
        f"task [bold]{escape(display_name(problem))}[/]: shortest path "
        f"{setting.length_text(shortest_path_length(nominal))}, "
        f"body radius {setting.length_text(nominal.body_radius)}, "
        f"at most {nominal.horizon} steps; {model}" + "".join(_remarks(problem))
    )


def _remarks(task: Task) -> list[str]:
    """Lines on how the map or world was read, and notes that need attention."""
    setting = task.setting
    lines = [f"\n{escape(line)}" for line in setting.remarks()]
    notes = [*setting.params.notes, *(f"left out: {name}" for name in setting.left_out)]
    return lines + [f"\n[yellow]note: {escape(note)}[/]" for note in notes]
