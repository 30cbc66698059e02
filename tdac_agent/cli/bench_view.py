"""How results of `tdac bench` are printed: tables, notes and pairs."""

from __future__ import annotations

from collections.abc import Sequence

from rich.markup import escape
from rich.table import Table

from tdac_agent.bench.bench import RESULTS
from tdac_agent.bench.record import Bench, BenchPair, BenchRow, BenchSet, Interval
from tdac_agent.cli.console import Console
from tdac_agent.cli.sentences import print_sentences
from tdac_agent.cli.titled_table import titled_table
from tdac_agent.metrics.paired import LEAST_P

NONE = "–"
# Widest name of an entrant, so that a table fits into 80 columns.
WIDEST = 14
FEW = 20
"""Worlds below which a bootstrap claims too much."""
LEGEND = (
    "time: mean of success x OT / T (SCT; least possible / actual time), with a 95 % "
    "interval by bootstrap over worlds (and seeds). reached: with the exact 95 % "
    "interval; by bootstrap if there are several seeds. path: mean of success x L / "
    "driven (SPL; shortest / actual path). contacts: with a wall / a mover while "
    "driving / a mover while standing. late: cut off at the horizon; error: its own, "
    "or too much CPU time; all three count the episodes of all files of an entrant."
)


def show(results: Bench, console: Console) -> None:
    """Prints a table for each set, one over all, and how far the first is ahead."""
    for own in results.sets:
        rows = results.of_set(own.name)
        knows_map = any(row.knows == "+ map" for row in rows)
        console.print(_table(own, rows, console.width))
        console.print()
        if own.ladder:
            print_sentences(console, f"{own.name}: {own.ladder}", indent=2)
        for row in rows:
            for note in _notes(row, knows_map):
                print_sentences(console, note, indent=2)
    if results.overall:
        console.print(_overall(results))
        console.print()
        there = {each.entrant for each in results.overall}
        there |= {row.entrant for row in results.rows if row.kind == "privileged"}
        if absent := [name for name in results.entrants if name not in there]:
            note = f"not on all sets, and so not above: {', '.join(absent)}"
            print_sentences(console, note, indent=2)
    print_sentences(console, LEGEND)
    if any(own.worlds < FEW for own in results.sets):
        print_sentences(
            console,
            f"With fewer than {FEW} worlds, intervals by bootstrap are too narrow.",
        )
    first = results.entrants[0]
    pairs = [pair for pair in results.pairs if first in (pair.one, pair.other)]
    if pairs:
        console.print()
        console.print(_pairs(first, pairs))
        text = (
            "on the same worlds; p by bootstrap, at least the smallest one of a sign "
            "test on so many worlds, adjusted for all pairs of a set (Holm). All "
            f"pairs are in {RESULTS}."
        )
        print_sentences(console, text)


def _table(own: BenchSet, rows: Sequence[BenchRow], room: int) -> Table:
    table = titled_table(f"{own.name} {own.sha256[:8]}: {own.which}")
    longest = max(len(row.entrant) for row in rows)
    width = max(min(longest, WIDEST + max(room - 80, 0)), len("entrant"))
    table.add_column("entrant", overflow="fold", width=width)
    for name in ("time (95 %)", "reached, %", "path", "contacts", "late", "error"):
        table.add_column(name, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(escape(row.entrant), *_cells(row))
    return table


def _cells(row: BenchRow) -> list[str]:
    if row.time is None or row.success is None or row.path is None:
        return [NONE] * 6
    kinds = ("wall", "mover", "mover_standing")
    time, share = row.time, row.success
    return [
        f"{time.value:.3f} ({time.low:.2f}–{time.high:.2f})",
        f"{100 * share.value:.1f} ({100 * share.low:.0f}–{100 * share.high:.0f})",
        f"{row.path:.3f}",
        "/".join(str(row.contacts.get(kind, 0)) for kind in kinds),
        str(row.late),
        str(row.errors),
    ]


def _notes(row: BenchRow, knows_map: bool) -> list[str]:
    notes = []
    if row.problem is not None:
        notes.append(f"{row.entrant} did not drive: {row.problem}")
    if row.kind == "privileged" and row.time is not None:
        notes.append(
            f"{row.entrant} knows the true world and all movers: not compared with "
            "others"
        )
    if row.knows == "sensors" and knows_map:
        notes.append(f"{row.entrant} does not get the map")
    if row.tuned is False:
        notes.append(f"{row.entrant} was not tuned for this set")
    if row.trained_here is False:
        notes.append(f"{row.entrant} does not record on which set it was trained")
    if row.kind == "learned" and len(row.files) == 1:
        notes.append(f"{row.entrant}: a single seed")
    if row.clock_dependent is not None:
        notes.append(f"{row.entrant} is clock-dependent: {row.clock_dependent}")
    if row.causes:
        causes = ", ".join(f"{count} {name}" for name, count in row.causes.items())
        notes.append(f"{row.entrant}, failures: {causes}")
    counts = [each.hidden for each in row.files if each.hidden and each.hidden > 1]
    # Nobody chooses among versions of what comes with the package.
    if counts and row.kind not in ("builtin", "planner", "baseline"):
        notes.append(
            f"{row.entrant}: evaluation {max(counts)} of its file on hidden worlds; "
            "only the first one is to be reported"
        )
    return notes


def _overall(results: Bench) -> Table:
    table = titled_table(f"all {len(results.sets)} sets, equal weights")
    table.add_column("entrant", overflow="fold")
    for name in ("time", "95 %", "middle half", "reached"):
        table.add_column(name, justify="right", no_wrap=True)
    for each in results.overall:
        table.add_row(
            escape(each.entrant),
            f"{each.time.value:.3f}",
            f"{each.time.low:.3f}–{each.time.high:.3f}",
            f"{each.middle:.3f}",
            f"{100 * each.success:.1f} %",
        )
    return table


def _pairs(first: str, pairs: Sequence[BenchPair]) -> Table:
    """By how much the first entrant is ahead of each other one."""
    table = titled_table(f"time score of {first}, minus that of")
    table.add_column("entrant", overflow="fold")
    table.add_column("set")
    for name in ("difference", "95 %", "p"):
        table.add_column(name, justify="right", no_wrap=True)
    for pair in pairs:
        ahead = pair.ahead if pair.one == first else _negative(pair.ahead)
        other = pair.other if pair.one == first else pair.one
        colour = "green" if ahead.low > 0 else "red" if ahead.high < 0 else "yellow"
        table.add_row(
            escape(other),
            escape(pair.set or "all"),
            f"[{colour}]{ahead.value:+.3f}[/]",
            f"{ahead.low:+.3f} to {ahead.high:+.3f}",
            f"{'≤ ' if pair.p <= LEAST_P else ''}{pair.p_holm:.2g}",
        )
    return table


def _negative(interval: Interval) -> Interval:
    return Interval(value=-interval.value, low=-interval.high, high=-interval.low)
