"""`tdac synth`: live progress, then a table and the run folder."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.markup import escape
from rich.spinner import Spinner
from rich.table import Table

from tdac_agent.commands.flags import TaskFlags
from tdac_agent.errors import ControllerFileError, Fault
from tdac_agent.records import Run
from tdac_agent.synthesis import synthesize
from tdac_agent.task import Task
from tdac_agent.verification import read_source


class Progress:
    """Turns journal records into lines: what is going on, and what came of it.

    Args:
        console: Where to.
        heading: Line to print when the run begins.
    """

    def __init__(self, console: Console, heading: str) -> None:
        self._console = console
        self._heading = heading
        self._spinner = Spinner("dots", text="preparing")

    def __enter__(self) -> Progress:
        self._live = Live(
            self._spinner,
            console=self._console,
            transient=True,
            refresh_per_second=12,
        )
        self._live.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._live.stop()

    def __call__(self, record: dict[str, Any]) -> None:
        """Shows one record."""
        kind = record["event"]
        at = f"k={record.get('k')} j={record.get('j')}"
        if kind == "run.start":
            self._console.print(self._heading)
        elif kind == "prove.start":
            self._spinner.update(text="the suite proves itself")
        elif kind == "call.intent":
            verb = {"generate": "writing", "edit": "editing"}.get(
                record["kind"], "writing rules from the failures of"
            )
            self._spinner.update(
                text=f"{at}  {verb} controller.py: {escape(record['model'])}"
            )
        elif kind == "call.fault":
            self._print_fault(at, record)
        elif kind == "call.reply":
            for note in record["notes"]:
                self._console.print(f"  [dim]{at}  {escape(note)}[/]")
        elif kind == "rules":
            for note in record["notes"]:
                self._console.print(f"  [dim]k={record['k']}  rules: {escape(note)}[/]")
        elif kind == "verify.start":
            self._spinner.update(text=f"{at}  testing controller.py in the sandbox")
        elif kind == "verify.end":
            self._print_attempt(at, record)

    def _print_fault(self, at: str, record: dict[str, Any]) -> None:
        wait = record["wait"]
        then = "given up" if wait is None else f"asking again in {wait:.0f} s"
        told = f"{record['fault']} fault: {record['reason']}; {then}"
        self._console.print(f"  [yellow]{at}  {escape(told)}[/]")

    def _print_attempt(self, at: str, record: dict[str, Any]) -> None:
        if record["passed"]:
            self._console.print(f"[green]✔ {at}  all tests passed[/]")
        elif not record["valid"]:
            self._console.print(f"[yellow]– {at}  no code in the answer[/]")
        else:
            failed = record["failed_tests"]
            names = ", ".join(name.partition("::")[2] for name in failed[:3])
            more = f" and {len(failed) - 3} more" if len(failed) > 3 else ""
            self._console.print(
                f"[red]✘ {at}  {len(failed)} failed:[/] {escape(names)}{more}"
            )


def run(
    flags: TaskFlags,
    start_from: Path | None,
    k: int,
    j: int,
    learner: str,
    optimizer: str | None,
    base_url: str | None,
    prompt: str,
    out: Path | None,
    seed: int,
    as_json: bool,
) -> int:
    """Synthesises and prints; returns the exit code."""
    console = Console(stderr=as_json)
    source = None if start_from is None else read_text(start_from)
    with console.status("preparing the task …"):
        task = flags.load()
    folder = out if out is not None else _next_folder(task.name)
    try:
        with Progress(console, _heading(task, learner, optimizer)) as progress:
            result = synthesize(
                task,
                learner,
                optimizer,
                out=folder,
                iterations=k,
                patience=j,
                seed=seed,
                start_from=source,
                base_url=base_url,
                prompt=prompt,
                on_event=progress,
            )
    except KeyboardInterrupt:
        console.print(f"interrupted; the run so far is in {folder}", soft_wrap=True)
        raise
    except Fault:
        console.print(f"the run so far is in {folder}", soft_wrap=True)
        raise
    if as_json:
        sys.stdout.write(result.model_dump_json(indent=2) + "\n")
    else:
        _show(result, console)
    return 0 if result.verified else 1


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
        f"task [bold]{escape(task.name)}[/]: {units.told(nominal.shortest)} for a disc "
        f"of {radius:g} {units.length}, at most {nominal.horizon} steps; learner "
        f"[bold]{escape(learner)}[/]{model}" + "".join(_remarks(task))
    )


def _remarks(task: Task) -> list[str]:
    """How map or world was read, and what a person should look at."""
    setting = task.setting
    lines = [f"\n{escape(line)}" for line in setting.remarks()]
    notes = [*setting.params.notes, *(f"left out: {name}" for name in setting.left_out)]
    return lines + [f"\n[yellow]note: {escape(note)}[/]" for note in notes]


def _next_folder(name: str) -> Path:
    for number in itertools.count(1):
        folder = Path("runs") / f"{name}-{number}"
        if not folder.exists():
            return folder
    raise AssertionError("unreachable")


def _show(run: Run, console: Console) -> None:
    table = Table(title=f"{run.task}: {run.learner}", title_justify="left")
    table.add_column("k", justify="right")
    table.add_column("j", justify="right")
    table.add_column("result")
    table.add_column("failed tests")
    for attempt in run.attempts:
        result = "[green]verified[/]" if attempt.passed else "[red]failed[/]"
        if not attempt.valid:
            result = "[yellow]invalid[/]"
        names = [name.partition("::")[2] for name in attempt.failed_tests]
        shown = ", ".join(names[:4]) + (" …" if len(names) > 4 else "")
        table.add_row(str(attempt.k), str(attempt.j), result, escape(shown))
    console.print(table)
    if run.verified:
        console.print(
            f"[bold green]verified[/] in iteration {run.tau}, {run.seconds:.1f} s: "
            f"{run.controller}\n"
            f"  evidence: {run.folder / 'report.json'}, "
            f"{run.folder / 'trajectory.png'}\n"
            f"  see it drive: tdac play {run.folder} --video drive.mp4"
        )
    else:
        console.print(
            f"[bold red]not verified[/] after {run.iterations} iterations; "
            f"the attempts are in {run.folder / 'iterations'}"
        )
