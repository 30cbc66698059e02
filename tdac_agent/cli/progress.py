"""Live progress of a synthesis, printed from the records of its journal."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rich.live import Live
from rich.markup import escape
from rich.spinner import Spinner
from rich.table import Table

from tdac_agent.cli.console import Console
from tdac_agent.models.budget import format_usd
from tdac_agent.synthesis.question_kinds import NEW
from tdac_agent.verification.diagnosis.listed import list_tests
from tdac_agent.verification.verdict import COLOURS

_ANSWERS = (
    ("generate", "controller", "controllers"),
    ("edit", "edit", "edits"),
    ("summarise", "rule update", "rule updates"),
    ("improve", "improvement", "improvements"),
)
FINAL = frozenset({"validation", "comparison"})
"""Purposes of worlds whose results are printed."""
CHECKS = {
    False: "checking the suite: reference must pass, do-nothing must fail",
    True: "checking your tests: they must run on a controller that does nothing",
}
VERBS = {
    "generate": "writing",
    "edit": "editing",
    "summarise": "writing rules from the failures of",
    "improve": "improving",
}


class SynthProgress:
    """Shows journal records as lines: current activity and results.

    Args:
        console: Console to print to.
        heading: Line to print when the run begins.
        on_set: Whether the run is on a task set.
        told: Tells in a sentence how candidate (k, j) failed; without it, the names of
            the failed tests are printed.
    """

    def __init__(
        self,
        console: Console,
        heading: str,
        *,
        on_set: bool = False,
        told: Callable[[int, int], str] | None = None,
    ) -> None:
        self._console = console
        self._heading = heading
        self._on_set = on_set
        self._told = told
        self._has_quoted = False
        self._spinner = Spinner("dots", text="preparing")

    def __enter__(self) -> SynthProgress:
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
            self._console.print(f"  {CHECKS[self._on_set]}", style="dim")
            self._spinner.update(text="checking the suite")
        elif kind == "prove.step":
            self._spinner.update(text=f"checking the suite: {record['doing']} …")
        elif kind.startswith("call."):
            self._show_call(at, record)
        elif kind == "rules":
            for note in record["notes"]:
                self.say(f"  k={record['k']}", f"rules: {escape(note)}", "dim")
        elif kind == "verify.start":
            self._spinner.update(text=f"{at}  testing controller.py in the sandbox")
        elif kind == "verify.end":
            self._print_attempt(at, record)
        elif kind == "improve.begin":
            self.say(f"  {at}", escape(record["said"]), "dim")
        elif kind == "hidden.start":
            self.doing("driving on hidden worlds")
        elif kind.startswith("drive."):
            show = self._show_worlds if self._on_set else self._show_episodes
            show(at, record)

    def doing(self, text: str) -> None:
        """Shows the current activity."""
        self._spinner.update(text=text)

    def _print_heading(self, record: dict[str, Any]) -> None:
        self._console.print(self._heading)
        for note in record["notes"]:
            self._console.print(f"[yellow]note: {escape(note)}[/]")
        if record["event"] == "run.resume":
            answers = _answers(record["answers"])
            self._console.print(f"continuing: {answers}{_unanswered(record)}")

    def _show_call(self, at: str, record: dict[str, Any]) -> None:
        """Shows a question, or what came of it."""
        kind = record["event"]
        if kind == "call.intent":
            verb = VERBS[record["kind"]]
            self.doing(f"{at}  {verb} controller.py: {escape(record['model'])}")
        elif kind == "call.fault":
            self._print_fault(at, record)
        elif kind == "call.reply":
            for note in record["notes"]:
                self.say(f"  {at}", escape(note), "dim")
        elif kind == "call.unused":
            self._print_unused(at, record)

    def _print_fault(self, at: str, record: dict[str, Any]) -> None:
        wait = record["wait"]
        then = "giving up" if wait is None else f"asking again in {wait:.0f} s"
        line = f"{record['fault']} fault: {record['reason']}; {then}"
        self.say(f"  {at}", escape(line), "yellow")

    def _print_unused(self, at: str, record: dict[str, Any]) -> None:
        """Prints why an answer is requested again; not for the last one."""
        asked, most = record["asked"], record["most"]
        if asked < most:
            problem = f"answer {asked} of at most {most} cannot be used: "
            problem += f"{record['problem']}; asking again"
            self.say(f"  {at}", escape(problem), "yellow")
        if not self._has_quoted:
            self._has_quoted = True
            quote = f"it says: “{record['says']}”" if record["says"] else "it is empty"
            self.say(f"  {at}", escape(quote), "dim")

    def _show_episodes(self, at: str, record: dict[str, Any]) -> None:
        """Shows how disturbed episodes go, and prints those of the comparison."""
        blind = record["what"] == "confirmation"
        most = record["episodes"]
        if blind:
            most = record.get("driven", record.get("done", 0))
        reached = f"{record.get('reached', 0)} of {most} goals reached"
        kind = "disturbed episodes"
        if blind:
            kind = f"blind drives (at most {record['episodes']})"
        if record["event"] != "drive.end":
            self.doing(f"{at}  {kind}: {reached}")
        elif blind:
            word = record["word"]
            self.say(f"  {at}", f"{word}: blind drives: {reached}", COLOURS[word])
        elif record["what"] == "comparison":
            self.say(f"  {at}", f"other disturbed episodes: {reached}", "dim")

    def _show_worlds(self, at: str, record: dict[str, Any]) -> None:
        """Shows how it drives on worlds of a set, and prints those of the selection."""
        what = record["what"]
        driven = "hidden worlds" if what == "hidden" else f"{at}  {what}"
        match record["event"]:
            case "drive.start":
                self.doing(f"{driven}: {record['worlds']} worlds")
            case "drive.step":
                so_far = f"{record['reached']} of {record['done']} worlds reached"
                self.doing(f"{driven}: {so_far}")
            case "drive.end" if what in FINAL:
                result = f"{record['reached']} of {record['driven']} reached"
                self.say(f"  {at}", f"{what} worlds: {result}", "dim")

    def _print_attempt(self, at: str, record: dict[str, Any]) -> None:
        note = escape("; ".join(record["notes"][-1:]))
        if record.get("asked", "") not in NEW:
            self.say(f"~ {at}", note, "" if record["valid"] else "yellow")
        elif not record["valid"]:
            self.say(f"– {at}", note, "yellow")
        elif record["unchanged"]:
            self.say(f"= {at}", note, "yellow")
        elif record["passed"]:
            text = note if self._on_set else "all tests passed"
            self.say(f"✔ {at}", text, "green" if self._on_set else COLOURS["passed"])
        elif self._on_set:
            self.say(f"[red]✘ {at}[/]", f"[red]{note}[/]")
        else:
            failed = record["failed_tests"]
            names = f"{len(failed)} failed: {list_tests(failed, 3)}"
            text = names if self._told is None else self._told(record["k"], record["j"])
            self.say(f"[red]✘ {at}[/]", escape(text or names))

    def say(self, place: str, text: str, style: str = "") -> None:
        """Prints a line in two columns, so that wrapped text stays below the text."""
        line = Table.grid(padding=(0, 2, 0, 0))
        line.add_column(no_wrap=True)
        line.add_column(overflow="fold")
        line.add_row(place, text, style=style)
        self._console.print(line)


def _answers(counts: dict[str, int]) -> str:
    """The number of recorded answers, in all and by kind."""
    total, parts = sum(counts.values()), []
    for kind, singular, plural in _ANSWERS:
        count = counts.get(kind, 0)
        if count:
            parts.append(f"{count} {singular if count == 1 else plural}")
    kinds = f" ({', '.join(parts)})" if parts else ""
    return f"{total} recorded answer{'' if total == 1 else 's'}{kinds}"


def _unanswered(record: dict[str, Any]) -> str:
    """The questions without a recorded answer, and the cost of lost answers."""
    number, lost = record["unanswered"], record["lost_usd"]
    text = ""
    if number:
        questions = "one question has" if number == 1 else f"{number} questions have"
        again = "is" if number == 1 else "are"
        text = f"; {questions} no recorded answer and {again} asked again"
    return text + (f"; lost answers count as at most {format_usd(lost)}" * bool(lost))
