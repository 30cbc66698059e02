"""Live progress of a synthesis, from the records of its journal."""

from __future__ import annotations

from typing import Any

from rich.live import Live
from rich.markup import escape
from rich.spinner import Spinner
from rich.table import Table

from tdac_agent.cli.console import Console
from tdac_agent.cli.run_view import told_tests
from tdac_agent.models.budget import told_usd

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
        self._has_quoted = False
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
            told = "checking the suite: reference must pass, do-nothing must fail"
            self._console.print(f"  {told}", style="dim")
            self._spinner.update(text="checking the suite")
        elif kind == "prove.step":
            self._spinner.update(text=f"checking the suite: {record['doing']} …")
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
                self._say(f"  {at}", escape(note), "dim")
        elif kind == "call.unused":
            self._print_unused(at, record)
        elif kind == "rules":
            for note in record["notes"]:
                self._say(f"  k={record['k']}", f"rules: {escape(note)}", "dim")
        elif kind == "verify.start":
            self._spinner.update(text=f"{at}  testing controller.py in the sandbox")
        elif kind == "verify.end":
            self._print_attempt(at, record)

    def _print_heading(self, record: dict[str, Any]) -> None:
        self._console.print(self._heading)
        for note in record["notes"]:
            self._console.print(f"[yellow]note: {escape(note)}[/]")
        if record["event"] == "run.resume":
            known = _known(record["answers"])
            self._console.print(f"going on: {known}{_open(record)}")

    def _print_fault(self, at: str, record: dict[str, Any]) -> None:
        wait = record["wait"]
        then = "given up" if wait is None else f"asking again in {wait:.0f} s"
        told = f"{record['fault']} fault: {record['reason']}; {then}"
        self._say(f"  {at}", escape(told), "yellow")

    def _print_unused(self, at: str, record: dict[str, Any]) -> None:
        """Why an answer is asked for again; what came of the last one follows."""
        asked, most = record["asked"], record["most"]
        if asked < most:
            why = f"answer {asked} of at most {most} cannot be used: "
            told = f"{why}{record['problem']}; asking again"
            self._say(f"  {at}", escape(told), "yellow")
        if not self._has_quoted:
            self._has_quoted = True
            said = f"it says: “{record['says']}”" if record["says"] else "it is empty"
            self._say(f"  {at}", escape(said), "dim")

    def _print_attempt(self, at: str, record: dict[str, Any]) -> None:
        if record["passed"]:
            self._say(f"✔ {at}", "all tests passed", "green")
        elif not record["valid"]:
            why = "; ".join(record["notes"][-1:])
            self._say(f"– {at}", escape(why), "yellow")
        elif record["unchanged"]:
            self._say(f"= {at}", "the same code as before", "yellow")
        else:
            failed = record["failed_tests"]
            names = escape(told_tests(failed, 3))
            told = f"[red]{len(failed)} failed:[/] {names}"
            self._say(f"[red]✘ {at}[/]", told)

    def _say(self, place: str, told: str, style: str = "") -> None:
        """A line whose continuation is not mistaken for another one."""
        line = Table.grid(padding=(0, 2, 0, 0))
        line.add_column(no_wrap=True)
        line.add_column(overflow="fold")
        line.add_row(place, told, style=style)
        self._console.print(line)


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
    """Questions without an answer on record, and what lost answers may have cost."""
    number, lost = record["unanswered"], record["lost_usd"]
    told = ""
    if number:
        one = number == 1
        who = "one question has" if one else f"{number} questions have"
        told = f"; {who} no answer on record and {'is' if one else 'are'} put again"
    return told + (f"; lost answers count with {told_usd(lost)}, at most" * bool(lost))
