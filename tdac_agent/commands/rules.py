"""`tdac rules RUN`: the life of each repair rule of a run."""

from __future__ import annotations

import sys
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from tdac_agent.records import load_rules, load_run
from tdac_agent.rules import RepairRule, RuleBook

_COLOURS = {"in force": "green", "dropped": "red", "made room": "yellow"}


def run(folder: Path, as_json: bool) -> int:
    """Prints the rules; returns the exit code."""
    record, book = load_run(folder), load_rules(folder)
    if as_json:
        sys.stdout.write(book.model_dump_json(indent=2) + "\n")
        return 0
    console = Console(emoji=False)
    title = f"{record.task}: rules by {record.optimizer}, {record.status}"
    if book.rules:
        console.print(_table(book, title))
    else:
        console.print(
            f"{escape(title)}: no rules, since no iteration failed as a whole"
        )
    return 0


def _table(book: RuleBook, title: str) -> Table:
    table = Table(
        title=escape(title), title_justify="left", expand=True, show_lines=True
    )
    widths = {"text": 3, "evidence": 2, "effect": 1, "state": 1}
    for name in ("rule", "text", "scope", "born", "evidence", "effect", "state"):
        table.add_column(name, overflow="fold", ratio=widths.get(name))
    for rule in book.rules:
        table.add_row(
            rule.id,
            escape("\n".join([rule.text, *rule.edits])),
            rule.scope,
            f"k={rule.born}",
            escape(_evidence(rule)),
            rule.effect_told,
            _state(rule),
        )
    return table


def _evidence(rule: RepairRule) -> str:
    names = [test.rpartition("::")[2] for test in rule.evidence]
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if names[3:] else "")


def _state(rule: RepairRule) -> str:
    told = f"[{_COLOURS[rule.status]}]{rule.status}[/]"
    if rule.in_force:
        return told
    return f"{told} in k={rule.ended}" + (
        f": {escape(rule.reason)}" if rule.reason else ""
    )
