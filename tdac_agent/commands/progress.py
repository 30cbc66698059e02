"""Live progress of a synthesis, from the records of its journal."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.live import Live
from rich.markup import escape
from rich.spinner import Spinner

from tdac_agent.budget import told_usd
from tdac_agent.commands.run_view import told_tests

_ANSWERS = (
    ("generate", "controller", "controllers"),
    ("edit", "edit", "edits"),
    ("summarise", "about the rules", "about the rules"),
)


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
        if kind in {"run.start", "run.resume"}:
            self._print_heading(record)
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
        elif kind == "call.unused":
            self._print_unused(at, record)
        elif kind == "rules":
            for note in record["notes"]:
                self._console.print(f"  [dim]k={record['k']}  rules: {escape(note)}[/]")
        elif kind == "verify.start":
            self._spinner.update(text=f"{at}  testing controller.py in the sandbox")
        elif kind == "verify.end":
            self._print_attempt(at, record)

    def _print_heading(self, record: dict[str, Any]) -> None:
        self._console.print(self._heading)
        for note in record["notes"]:
            self._console.print(f"[yellow]note: {escape(note)}[/]", soft_wrap=True)
        if record["event"] == "run.resume":
            known = _known(record["answers"])
            self._console.print(f"going on: {known}{_open(record)}", soft_wrap=True)

    def _print_fault(self, at: str, record: dict[str, Any]) -> None:
        wait = record["wait"]
        then = "given up" if wait is None else f"asking again in {wait:.0f} s"
        told = f"{record['fault']} fault: {record['reason']}; {then}"
        self._console.print(f"  [yellow]{at}  {escape(told)}[/]")

    def _print_unused(self, at: str, record: dict[str, Any]) -> None:
        asked, most = record["asked"], record["most"]
        then = "asking again" if asked < most else "given up"
        told = f"answer {asked} of {most} cannot be used: {record['problem']}; {then}"
        self._console.print(f"  [yellow]{at}  {escape(told)}[/]")

    def _print_attempt(self, at: str, record: dict[str, Any]) -> None:
        if record["passed"]:
            self._console.print(f"[green]✔ {at}  all tests passed[/]")
        elif not record["valid"]:
            why = escape("; ".join(record["notes"][-1:]))
            self._console.print(f"[yellow]– {at}  {why}[/]")
        elif record["unchanged"]:
            self._console.print(f"[yellow]= {at}  the same code as before[/]")
        else:
            failed = record["failed_tests"]
            names = escape(told_tests(failed, 3))
            self._console.print(f"[red]✘ {at}  {len(failed)} failed:[/] {names}")


def _known(answers: dict[str, int]) -> str:
    """How many answers are on record, and what they are."""
    total, parts = sum(answers.values()), []
    for kind, one, more in _ANSWERS:
        count = answers.get(kind, 0)
        if count:
            parts.append(f"{count} {one if count == 1 else more}")
    about = f" ({', '.join(parts)})" if parts else ""
    return f"{total} answer{'' if total == 1 else 's'} on record{about}"


def _open(record: dict[str, Any]) -> str:
    """Questions that were put when the last process ended, and what they may cost."""
    number, lost = record["unanswered"], record["lost_usd"]
    if not number:
        return ""
    was, it = (
        ("a question was", "it is") if number == 1 else ("questions were", "they are")
    )
    count = "" if number == 1 else f"{number} "
    bill = f"; lost answers count with {told_usd(lost)}, at most" if lost else ""
    return f"; {count}{was} without an answer when it ended: {it} put again{bill}"
