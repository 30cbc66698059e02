"""`tdac synth --set`: writes a controller for worlds that it has never seen."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Any

from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from tdac_agent.cli import dry_run as dry
from tdac_agent.cli import verify_set
from tdac_agent.cli.console import Console
from tdac_agent.cli.flags import check_tier
from tdac_agent.cli.progress import Progress
from tdac_agent.cli.run_view import print_budget_end, usage_of
from tdac_agent.cli.synth import check_models, check_ready_again, read_text
from tdac_agent.cli.synth_set_flags import SynthSetFlags
from tdac_agent.errors import Fault
from tdac_agent.evaluation.set_report import SetReport
from tdac_agent.library.listing import next_folder
from tdac_agent.models.choice import check_name
from tdac_agent.problems.choice import problem_of
from tdac_agent.prompting.prompt import load_template
from tdac_agent.prompting.set_prompt import set_prompt
from tdac_agent.runs.improvement_record import NOT_SHOWN, is_shown
from tdac_agent.runs.resume import check_own, existing_run, resume_arguments
from tdac_agent.runs.run_record import Run
from tdac_agent.runs.selection_record import (
    HIDDEN_FILE,
    CandidateFigures,
    Improvement,
    Selection,
)
from tdac_agent.synthesis.synthesize import synthesize
from tdac_agent.tasks.task_file import SET_FILE
from tdac_envs.core.intake import RECORD_BYTES, read_file
from tdac_envs.ladder.task_sets import load_set

FINAL = frozenset({"validation", "comparison"})
"""Purposes of worlds whose results are printed."""
_EXIT = {"verified": 0, "selected": 0, "budget": 4}


class SetProgress(Progress):
    """Shows the journal records of a run on a task set."""

    def __call__(self, record: dict[str, Any]) -> None:
        """Shows one record."""
        match record["event"]:
            case "drive.start":
                self.doing(f"{_driven(record)}: {record['worlds']} worlds")
            case "drive.step":
                so_far = f"{record['reached']} of {record['done']} worlds reached"
                self.doing(f"{_driven(record)}: {so_far}")
            case "drive.end":
                if record["what"] in FINAL:
                    result = f"{record['reached']} of {record['driven']} reached"
                    worlds = f"{record['what']} worlds"
                    self.say(f"  {_at(record)}", f"{worlds}: {result}", "dim")
            case "hidden.start":
                self.doing("driving on hidden worlds")
            case _:
                super().__call__(record)

    def _print_attempt(self, at: str, record: dict[str, Any]) -> None:
        said = escape("; ".join(record["notes"][-1:]))
        if record["parent"] is not None:
            self.say_varied(at, record)
        elif not record["valid"]:
            self.say(f"– {at}", said, "yellow")
        elif record["unchanged"]:
            self.say(f"= {at}", said, "yellow")
        elif record["passed"]:
            self.say(f"✔ {at}", said, "green")
        else:
            self.say(f"[red]✘ {at}[/]", f"[red]{said}[/]")


def _at(record: dict[str, Any]) -> str:
    return f"k={record['k']} j={record['j']}"


def _driven(record: dict[str, Any]) -> str:
    """What is being driven, for the spinner."""
    if record["what"] == "hidden":
        return "hidden worlds"
    return f"{_at(record)}  {record['what']}"


def run(
    flags: SynthSetFlags,
    wanted: dict[str, Any],
    out: Path | None,
    start_from: Path | None,
    as_json: bool,
) -> int:
    """Writes a controller for a set and prints the run; returns the exit code.

    Args:
        flags: Flags that concern task sets.
        wanted: Further arguments of `synthesize`.
        out: Run folder; the next free one by default.
        start_from: Controller to begin with.
        as_json: Whether to print the run record as JSON.
    """
    check_tier(wanted["tier"])
    check_models(wanted)
    assert flags.name is not None
    tasks = load_set(flags.name)
    source = None if start_from is None else read_text(start_from)
    folder = out if out is not None else next_folder(tasks.name)
    own = {"problem": tasks, "out": folder, "start_from": source}
    return _write({**wanted, **flags.settings(), **own}, Console(stderr=as_json))


def resume(
    before: Run, given: dict[str, Any], then_verify: bool, trust: bool, as_json: bool
) -> int:
    """Continues a run with its own settings; returns the exit code.

    Args:
        before: The run as recorded.
        given: Flags given again, `max_cost`, `max_tokens` and `tier`.
        then_verify: Whether to drive on hidden worlds at the end.
        trust: Whether a run from elsewhere may contact all that it names.
        as_json: Whether to print the run record as JSON.
    """
    check_tier(given["tier"])
    console = Console(stderr=as_json)
    if before.finished and not (then_verify and before.status == "selected"):
        check_own(before)
        return _show(before, console, before=before)
    check_ready_again(before, given)
    wanted = resume_arguments(before.folder, given, trust=trust)
    return _write({**wanted, "then_verify": then_verify}, console)


def dry_run(
    flags: SynthSetFlags, models: dict[str, Any], loop: dict[str, Any], as_json: bool
) -> int:
    """Prints the first question to stdout, the cost to stderr; returns 0.

    Args:
        flags: Flags that concern task sets.
        models: As for `dry_run.run`.
        loop: `iterations`, `patience`, `candidates`, `refine`, `vision` and `improve`.
        as_json: Whether to print the forecast as JSON.
    """
    assert flags.name is not None
    for name in (models["learner"], models["optimizer"] or models["learner"]):
        check_name(name)
    tasks = load_set(flags.name)
    template = load_template(models["prompt"])
    question = set_prompt(tasks, dry.rules_of(models), template)
    return dry.show(tasks.name, tasks, question, models, loop, as_json)


def _write(wanted: dict[str, Any], console: Console) -> int:
    folder = wanted["out"]
    before = existing_run(folder)
    try:
        with SetProgress(console, _heading(wanted)) as progress:
            result = synthesize(**wanted, on_event=progress)
    except (KeyboardInterrupt, Fault, OSError):
        console.print(_so_far(folder), soft_wrap=True)
        raise
    return _show(result, console, before=before)


def _so_far(folder: Path) -> str:
    """Where the unfinished run is, and the command to continue it."""
    if not (folder / SET_FILE).is_file():
        return "the run had not begun"
    command = shlex.join(["tdac", "synth", "--resume", str(folder)])
    return f"the run so far is in {folder}; to continue: {command}"


def _heading(wanted: dict[str, Any]) -> str:
    tasks = problem_of(wanted["problem"]).tasks
    assert tasks is not None
    learner, optimizer = wanted["learner"], wanted["optimizer"]
    model = " (no language model)" if learner == "builtin" else ""
    if optimizer not in (None, learner):
        model += f", optimizer [bold]{escape(str(optimizer))}[/]"
    return (
        f"task set [bold]{escape(tasks.name)}[/] {tasks.sha256[:8]}, worlds of dev; "
        f"learner [bold]{escape(learner)}[/]{model}"
    )


def _show(run: Run, console: Console, *, before: Run | None) -> int:
    """Prints a run, as JSON if the console is stderr; returns the exit code."""
    code = _EXIT.get(run.status, 1)
    if console.stderr:
        sys.stdout.write(run.model_dump_json(indent=2) + "\n")
        return code
    if before is not None and before.finished and before.status == run.status:
        note = f"the run in {run.folder} has already finished; nothing was done"
        console.print(note, soft_wrap=True)
    if run.status == "budget":
        print_budget_end(run, console)
        return code
    if run.tau is not None:
        _show_selected(run, console)
    else:
        reason = escape(run.reason)
        console.print(f"[bold red]no controller was selected[/]: {reason}")
        console.print(f"  the attempts are in {run.folder / 'iterations'}")
    usage = usage_of(run)
    if usage:
        console.print(f"  {escape(usage)}")
    return code


def _show_selected(run: Run, console: Console) -> None:
    """Prints the selection, the verdict on hidden worlds if any, and next commands."""
    content = read_file(run.folder / "report.json", RECORD_BYTES)
    selection = Selection.model_validate_json(content)
    console.print(_candidates(selection))
    most = selection.episodes + selection.improve
    console.print(
        f"  goals reached, of worlds of dev; {selection.used} of at most {most} "
        "episodes were driven",
        highlight=False,
    )
    if selection.stopped:
        console.print(f"  the writing ended: {escape(selection.stopped)}")
    console.print(
        f"[bold]selected[/] k={selection.k} j={selection.j}, {run.seconds:.0f} s: "
        f"{escape(str(run.controller))}",
        soft_wrap=True,
    )
    scores = selection.optimistic
    if scores is not None:
        console.print(
            f"  selected, optimistic: {100 * scores.success:.1f} % reached, time score "
            f"{scores.time:.3f}",
            highlight=False,
        )
    if selection.improvement is not None:
        console.print(f"  {_improvement(selection.improvement)}", highlight=False)
    hidden = run.folder / HIDDEN_FILE
    if run.status != "selected" and hidden.is_file():
        text = read_file(hidden, RECORD_BYTES)
        verify_set.show(SetReport.model_validate_json(text), console)
        return
    given = str(run.controller), "--set", str(run.folder / SET_FILE)
    line = escape(f"  not verified yet: {shlex.join(['tdac', 'verify', *given])}")
    console.print(line, soft_wrap=True, highlight=False)


def _improvement(found: Improvement) -> str:
    """What the search for improvements brought, in one line."""
    about = f"{found.variations} variation{'' if found.variations == 1 else 's'}"
    base = f"k={found.k} j={found.j}"
    if not found.worlds:
        return f"improving: {about}; none was better than {base}, which stays"
    assert found.before is not None
    assert found.after is not None
    assert found.low is not None
    assert found.high is not None
    told = "" if is_shown(found.low, found.p) else f"; {NOT_SHOWN}"
    return (
        f"improving: {about}; time score {found.before:.3f} ({base}) -> "
        f"{found.after:.3f} on {found.worlds} other worlds: "
        f"{found.after - found.before:+.3f} "
        f"(95 % interval {found.low:+.3f} to {found.high:+.3f})"
        f"{told}"
    )


def _candidates(selection: Selection) -> Table:
    """The candidates of the loop, and the variations that went on to the selection."""
    table, searched = Table(box=SIMPLE, padding=(0, 1, 0, 0)), selection.improve > 0
    search = ("improving",) if searched else ()
    for name in ("k", "j", "feedback", *search, "validation", "time score"):
        table.add_column(name, justify="right")
    for each in selection.candidates:
        if each.feedback_worlds or each.validation_worlds:
            chosen = (each.k, each.j) == (selection.k, selection.j)
            cells = _cells(each, searched=searched)
            table.add_row(*cells, style="bold" if chosen else None)
    return table


def _cells(each: CandidateFigures, *, searched: bool) -> tuple[str, ...]:
    return (
        str(each.k),
        str(each.j),
        _part(each.feedback_reached, each.feedback_worlds),
        *([_score(each.improve_time)] if searched else []),
        _part(each.validation_reached, each.validation_worlds),
        _score(each.validation_time),
    )


def _part(reached: int, worlds: int) -> str:
    return f"{reached}/{worlds}" if worlds else ""


def _score(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"
