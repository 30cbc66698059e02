"""Prints what a policy survives, and the smallest failure that was found."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console
from tdac_agent.cli.sentences import print_command, print_sentences
from tdac_agent.runs.falsification import Envelope, Falsification
from tdac_agent.runs.falsify_text import (
    NO_PROOF,
    failure_text,
    plain_text,
    rows_of,
    summary_of,
)


def show_falsification(
    found: Falsification, console: Console, replay: Sequence[str]
) -> None:
    """Prints the envelope of each world, the smallest failure, and how to see it."""
    say = partial(console.print, highlight=False)
    where = (
        found.name if found.split is None else f"{found.split} worlds of {found.name}"
    )
    say(
        f"{escape(found.policy)} on {escape(where)}: {found.episodes} of at most "
        f"{_most(found)} episodes, seed {found.seed}, sandbox {found.sandbox}"
    )
    for envelope in found.envelopes:
        if found.split is not None:
            say(f"[bold]world {envelope.number}[/]")
        say(f"  without a deviation: {plain_text(envelope, found)}")
        if envelope.directions:
            say(_table(envelope, found))
    say(f"[bold]{escape(summary_of(found))}[/]")
    failed = found.counterexample
    if failed is not None:
        print_sentences(console, failure_text(failed, found), indent=2)
        if replay:
            print_command(console, "see it:", list(replay)[1:])
    print_sentences(console, NO_PROOF.format(found.episodes), indent=2)


def _most(found: Falsification) -> int:
    return max(found.budget, found.episodes)


def _table(envelope: Envelope, found: Falsification) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for name in ("alone", "survives", "fails at", "cause"):
        table.add_column(f"  {name}" if name == "alone" else name)
    for _, words, survived, fails, causes in rows_of(envelope, found):
        table.add_row(f"  {words}", survived, fails or "–", causes)
    return table
