"""`tdac rules RUN`: the history of each repair rule of a run."""

from __future__ import annotations

import shlex
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.sentences import print_plain
from tdac_agent.errors import RunError
from tdac_agent.prompting.given_rules import GIVEN, shared_rules, written
from tdac_agent.prompting.rules import RepairRule, RuleBook
from tdac_agent.runs.run_record import Run, load_rules, load_run
from tdac_agent.storage.files import write_atomic
from tdac_agent.verification.diagnosis.listed import list_tests
from tdac_envs.core.intake import TEXT_BYTES, read_file

_COLOURS = {"in force": "green", "dropped": "red", "made room": "yellow"}


def run(folder: Path, as_json: bool) -> int:
    """Prints the rules; returns the exit code."""
    record, book = load_run(folder), load_rules(folder)
    if as_json:
        print_json(book)
        return 0
    console = Console()
    title = f"{record.task}: rules by {record.optimizer}, {record.status}"
    if book.rules:
        console.print(f"[bold]{escape(title)}[/]\n")
        console.print(_histories(book))
    else:
        console.print(escape(f"{title}; no rules: {_why_none(record)}"))
    return 0


def export(folders: list[Path], out: Path) -> int:
    """Writes rules for other runs to a file; returns the exit code.

    Raises:
        RunError: A folder has no run, there is no rule to write, or the file cannot be
            written.
    """
    runs = [load_run(folder) for folder in folders]
    books = [load_rules(folder) for folder in folders]
    rules = shared_rules(books)
    number = sum(len(book.in_force) for book in books)
    if not number:
        raise RunError("no rule to export: none is in force at the end of a run given")
    if not rules:
        raise RunError(
            f"no rule to export: each of the {number} in force is about one task only, "
            "or has done harm"
        )
    tasks = ", ".join(dict.fromkeys(run.task for run in runs))
    names = [name for run in runs for name in run.models or (run.optimizer,)]
    authors = ", ".join(dict.fromkeys(names))
    heading = f"Learnt on {tasks} by {authors}."
    text = written(rules, heading)
    try:
        if out.is_file() and read_file(out, TEXT_BYTES) != text.encode():
            raise RunError(
                f"{out} exists and has other rules: delete it, or give another --out"
            )
        write_atomic(out, text)
    except OSError as error:
        raise RunError(f"cannot write {out}: {error.strerror}") from error
    use = shlex.join(["tdac", "synth", "--rules", str(out)])
    kept = f"{len(rules)} of {number} rules in force"
    print_plain(Console(), f"{out}: {kept}; to use them: {use}")
    return 0


def _histories(book: RuleBook) -> Table:
    """A paragraph per rule: its text, then its status and effect."""
    grid = Table.grid(padding=(0, 2, 0, 0))
    grid.add_column(no_wrap=True, style="bold")
    grid.add_column(overflow="fold")
    for rule in book.rules:
        state = f"[{_COLOURS[rule.status]}]{_state(rule)}[/]"
        lines = [
            f"[bold]{escape(rule.text)}[/]",
            *(f"[dim]{escape(edit)}[/]" for edit in rule.edits),
            f"{state} · {rule.scope} · {_origin(rule)}",
            f"failed before: {escape(list_tests(rule.evidence, 4) or '–')}",
            f"effect: {escape(_effect(rule))}",
            "",
        ]
        grid.add_row(rule.id, "\n".join(lines))
    return grid


def _why_none(run: Run) -> str:
    """Why a run has no rules."""
    if not run.refine:
        return "this run does not refine its prompt (--no-refine)"
    failed = [attempt for attempt in run.attempts if not attempt.passed]
    if failed and not any(attempt.valid for attempt in run.attempts):
        number = len({attempt.k for attempt in failed})
        return f"no answer of {number} iteration{'s' * (number > 1)} could be used"
    if any(attempt.j == run.patience and attempt.valid for attempt in failed):
        return "the optimizer added none"
    return "no iteration has failed after all its edits"


def _effect(rule: RepairRule) -> str:
    """The effect of a rule; names the cured tests unless it cured all or none."""
    pairs = list(zip(rule.evidence, rule.passes_each, strict=True))
    cured = [test for test, count in pairs if count == rule.tried]
    sometimes = [test for test, count in pairs if 0 < count < rule.tried]
    effect = rule.effect_text
    if not rule.tried or len(cured) == len(pairs):
        return effect
    if cured:
        effect += f"; cured: {list_tests(cured, 4)}"
    if sometimes:
        effect += f"; cured sometimes: {list_tests(sometimes, 4)}"
    return effect


def _origin(rule: RepairRule) -> str:
    return f"since k={rule.born}" if rule.born != GIVEN else "given at the beginning"


def _state(rule: RepairRule) -> str:
    if rule.in_force:
        return rule.status
    why = f": {rule.reason}" if rule.reason else ""
    return escape(f"{rule.status} in k={rule.ended}{why}")
