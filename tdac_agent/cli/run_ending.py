"""The last lines of a run with a controller: verdict, file, and what to do next."""

from __future__ import annotations

import shlex

from rich.markup import escape

from tdac_agent.cli.console import Console
from tdac_agent.cli.sentences import print_indented, print_plain
from tdac_agent.runs.improvement_record import TaskImprovement
from tdac_agent.runs.run_record import Run, status_now
from tdac_agent.verification.confirmation import CONFIRMATION_FILE, read_confirmation
from tdac_agent.verification.evidence import evidence_of
from tdac_agent.verification.verdict import COLOURS, delivered_text, verified_text


def show_ending(run: Run, search: TaskImprovement | None, console: Console) -> None:
    """Prints the verdict on a run's controller, and the next commands.

    Args:
        run: A run with a controller that passed all tests.
        search: What its search for improvements brought, if it had one.
        console: Where to print.
    """
    status = status_now(run, before=False)
    mark = "✔ " if status in {"verified", "passed"} else ""
    confirmation = read_confirmation(run) if run.confirmations else None
    colour, evidence = COLOURS.get(status, "yellow"), evidence_of(run, confirmation)
    shown = f": {evidence}" if evidence else ""
    console.print(
        f"[bold {colour}]{mark}{status}[/]{escape(shown)} → "
        f"{escape(str(run.controller))}",
        soft_wrap=True,
        highlight=False,
    )
    how = f"{delivered_text(run)}, {run.seconds:.1f} s"
    if search is not None and search.selected != search.first:
        how += f"; improved in iteration {search.k}"
    print_indented(console, how)
    if confirmation is not None:
        print_indented(console, verified_text(confirmation))
    if search is not None:
        print_indented(console, search.told)
    if run.reason and search is not None:
        print_indented(console, f"the search ended early: {run.reason}")


def show_next(run: Run, console: Console) -> None:
    """Prints the commands that show the controller of a run, and the files on it."""
    folder = str(run.folder)
    if run.status == "passed" and not run.confirmations:
        print_plain(console, f"  not verified yet: {_command('verify', folder)}")
    names = ("report.json", CONFIRMATION_FILE, "trajectory.png")
    evidence = [str(run.folder / name) for name in names if _is_there(run, name)]
    print_plain(
        console, f"  see it: {_command('play', folder, '--video', 'drive.mp4')}"
    )
    print_plain(console, f"  the story: {_command('report', folder)}")
    print_plain(console, f"  evidence: {', '.join(evidence)}")


def _is_there(run: Run, name: str) -> bool:
    return (run.folder / name).is_file()


def _command(*words: str) -> str:
    return shlex.join(["tdac", *words])
