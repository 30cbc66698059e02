"""`tdac synth`: shows live progress, then a table and the run folder."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any

import typer
from rich.markup import escape

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.dry_run import dry_run
from tdac_agent.cli.omitted_facts import check_omitted
from tdac_agent.cli.progress import SynthProgress
from tdac_agent.cli.run_view import show_run, show_selection
from tdac_agent.cli.sentences import print_plain
from tdac_agent.cli.synth_flags import RunFlags
from tdac_agent.cli.task_choice import check_tier, chosen_problem
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.errors import Fault, RunError
from tdac_agent.library.listing import next_folder
from tdac_agent.models.provider import Provider
from tdac_agent.models.ready import check_ready
from tdac_agent.option_fields import flag_name
from tdac_agent.problems.problem import Problem
from tdac_agent.runs.ownership import is_own_folder
from tdac_agent.runs.resume import (
    check_own,
    existing_run,
    resume_arguments,
    resume_line,
)
from tdac_agent.runs.run_record import AGENT, RUN_FILE, Run, candidate_at, load_run
from tdac_agent.storage.printable_record import read_record
from tdac_agent.synthesis.options import SynthOptions
from tdac_agent.synthesis.synthesize import synthesize
from tdac_agent.tasks.setting import tolerance_text
from tdac_agent.tasks.task import Task, display_name
from tdac_agent.tasks.task_file import SET_FILE, TASK_FILE
from tdac_agent.verification.diagnosis.measures import shortest_path_length
from tdac_agent.verification.diagnosis.report import Report

RECORDED = ("learner", "optimizer", "base_url", "max_cost", "max_tokens")
WITH_RESUME = frozenset({"resume", "trust", "as_json"})
"""Flags of a run as a whole that may be given with --resume; options of the synthesis
may unless they are part of the run's identity."""
_EXIT = {"verified": 0, "passed": 0, "selected": 0, "budget": 4}


def run(
    context: typer.Context,
    flags: TaskFlags,
    options: SynthOptions,
    run_flags: RunFlags,
) -> int:
    """Synthesises a controller and prints the run; returns the exit code."""
    sources = {name: context.get_parameter_source(name) for name in context.params}
    typed = {n for n, s in sources.items() if s and s.name == "COMMANDLINE"}
    if run_flags.resume is not None:
        return resume(options, run_flags, typed)
    if run_flags.dry_run:
        return dry_run(flags, options, run_flags, typed)
    check_tier(options.tier)
    check_models(options)
    console = Console(stderr=run_flags.as_json)
    with console.status("preparing the task …"):
        problem = chosen_problem(flags, options, run_flags, profile=run_flags.profile)
        problem = problem.allowed(options.suite, trust=run_flags.trust)
    check_omitted(options, typed, on_set=problem.has_hidden)
    folder = run_flags.out or next_folder(problem.name)
    code = write(problem, folder, options, console)
    return _with_envelope(code, folder, problem, options, console)


def _with_envelope(
    code: int,
    folder: Path,
    problem: Problem,
    options: SynthOptions,
    console: Console,
) -> int:
    """Searches for the smallest failure of what a run delivered; returns its code."""
    if not options.envelope or code != 0:
        return code
    from tdac_agent.cli.falsify import show_envelope  # slow to import

    own = problem.task if problem.tasks is None else problem.tasks
    assert own is not None
    where = console, options.tier, folder
    show_envelope(str(folder), own, options.envelope, *where)
    return code


def write(
    problem: Problem,
    folder: Path,
    options: SynthOptions,
    console: Console,
    index: int = 0,
) -> int:
    """Synthesises with live progress and prints the run; returns the exit code.

    Args:
        problem: Task or task set.
        folder: Run folder.
        options: Options of the synthesis.
        console: Console to print to; if it is stderr, the run record goes to stdout as
            JSON.
        index: Index of the run among otherwise equal ones.
    """
    before = existing_run(folder)
    heading = _heading(problem, options.learner, options.optimizer)
    on_set, told = problem.tasks is not None, _teller(folder, problem)
    try:
        with SynthProgress(console, heading, on_set=on_set, told=told) as progress:
            result = synthesize(
                problem, out=folder, options=options, index=index, on_event=progress
            )
    except (KeyboardInterrupt, Fault, OSError):
        print_plain(console, _so_far(folder))
        raise
    return _show(result, console, before=before)


def _teller(folder: Path, problem: Problem) -> Callable[[int, int], str] | None:
    """Tells from a run's folder how a candidate failed on a task."""
    if problem.task is None:
        return None
    dt = problem.task.nominal.dt

    def told(k: int, j: int) -> str:
        from tdac_agent.html_report.story import told_of  # slow to import

        report = read_record(Report, folder / candidate_at(k, j), "report.json")
        return "" if report is None else told_of(report, dt)

    return told


def resume(options: SynthOptions, run_flags: RunFlags, typed: Collection[str]) -> int:
    """Continues a run with its own settings; returns the exit code.

    Args:
        options: Limits and tier, among others, may be new; models, server, template and
            seed permit a run from elsewhere to use its own values.
        run_flags: Folder of the run, and whether a run from elsewhere may run and
            contact all that it names.
        typed: Names of the flags on the command line.
    """
    assert run_flags.resume is not None
    may = {each.name for each in fields(options)} - options.identity.keys()
    _refuse_others(typed, WITH_RESUME | may, TaskFlags(), options, run_flags)
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
    later = {"selected": options.then_verify, "passed": "confirm" in typed}
    more = later.get(before.status, False)
    if before.finished and not more:
        check_own(before)
        return _show(before, console, before=before)
    everything = _values(options)
    known = {name: everything[name] for name in may & set(typed)}
    check_ready_again(before, known)
    with console.status("preparing the task …"):
        wanted = resume_arguments(run_flags.resume, known, trust=run_flags.trust)
    problem, folder, index = (wanted.pop(n) for n in ("problem", "out", "index"))
    settings = _restored(options, before).changed(**wanted)
    code = write(problem, folder, settings, console, index)
    return _with_envelope(code, folder, problem, settings, console)


def _restored(options: SynthOptions, before: Run) -> SynthOptions:
    """The options of a run that have no field of their own in its record.

    Raises:
        RunError: The record has an option that there is not.
    """
    try:
        return type(options)().restored(before.options)
    except ValueError as error:
        raise RunError(f"{before.folder / RUN_FILE}: {error}") from error


def _values(options: SynthOptions) -> dict[str, Any]:
    return {field.name: getattr(options, field.name) for field in fields(options)}


def _refuse_others(typed: Collection[str], may: Collection[str], *options: Any) -> None:
    """Refuses flags whose values --resume takes from the run folder.

    Raises:
        RunError: Such a flag is given; the message names it.
    """
    known = [field for each in options for field in fields(each)]
    wrong = [each for each in known if each.name in set(typed) - set(may)]
    if wrong:
        names = ", ".join(map(flag_name, wrong))
        raise RunError(f"--resume continues a run as it was begun: leave out {names}")


def check_models(options: SynthOptions) -> None:
    """Checks the models of a new run before its task is loaded; see `check_ready`."""
    learner = str(options.learner)
    names = [learner, str(options.optimizer or learner)]
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
        return exit_code(run)
    if before is not None and before.finished and before.status == run.status:
        note = f"the run in {run.folder} has already finished; nothing was done"
        print_plain(console, note)
    (show_selection if run.on_set else show_run)(run, console)
    return exit_code(run)


def exit_code(run: Run) -> int:
    """0 if the run ended as was asked for; 1 for what passed and was not confirmed."""
    confirmed = run.status != "passed" or not run.confirmations
    return _EXIT.get(run.status, 1) if confirmed else 1


def _so_far(folder: Path) -> str:
    """Where the unfinished run is, and the command to continue it."""
    if not any((folder / name).is_file() for name in (TASK_FILE, SET_FILE)):
        return "the run had not begun"
    command = shlex.join(["tdac", "synth", "--resume", str(folder)])
    # The first error is the one to report.
    with suppress(RunError):
        run = load_run(folder)
        if run.passed:
            result = f"passed all tests in iteration {run.tau}: {run.controller}"
            return f"{result}; to go on improving it: {command}"
    return f"the run so far is in {folder}; to continue: {command}"


def _heading(problem: Problem, learner: str | Provider, optimizer: Any) -> str:
    kind = "no language model"
    kind = kind if problem.task is None else f"a tuned template, {kind}"
    model = f"learner [bold]{escape(str(learner))}[/]"
    model += f" ({kind})" if learner == "builtin" else ""
    if optimizer not in (None, learner):
        model += f", optimizer [bold]{escape(str(optimizer))}[/]"
    task = problem.task
    if task is None:
        digest = f"[bold]{escape(problem.name)}[/] {problem.sha256[:8]}"
        return f"task set {digest}, worlds of dev; {model}"
    nominal, setting, called = task.nominal, task.setting, display_name(task)
    # The name of a task that is not bundled says it.
    near = "" if "goal within" in called else f"goal within {tolerance_text(setting)}, "
    return (
        f"task [bold]{escape(called)}[/]: shortest path "
        f"{setting.length_text(shortest_path_length(nominal))}, "
        f"body radius {setting.length_text(nominal.body_radius)}, "
        f"{near}at most {nominal.horizon} steps; {model}" + "".join(_remarks(task))
    )


def _remarks(task: Task) -> list[str]:
    """Lines on how the map or world was read, and notes that need attention."""
    setting = task.setting
    lines = [f"\n{escape(line)}" for line in setting.remarks()]
    notes = [*setting.params.notes, *(f"left out: {name}" for name in setting.left_out)]
    return lines + [f"\n[yellow]note: {escape(note)}[/]" for note in notes]
