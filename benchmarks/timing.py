"""Times that are taken in turn, and the table that shows them.

What is compared takes turns within one run, so that other work on the machine
disturbs all of it alike: ratios hold where seconds do not.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

Call = Callable[[], object]

WIDTH = 130
"""Columns of a table that is not cut."""


@dataclass(frozen=True, slots=True)
class Row:
    """One case of a bench.

    Attributes:
        case: What was timed.
        seconds: Median time, s.
        fastest: Least time, s.
        slowest: Greatest time, s.
        per_floor: Times the least that the machine can do, as the bench says.
        per_reference: Times what the bench compares with; None without that.
        limit: Most seconds that it should take, or None.
        note: More figures, in words.
    """

    case: str
    seconds: float
    fastest: float
    slowest: float
    per_floor: float | None = None
    per_reference: float | None = None
    limit: float | None = None
    note: str = ""


@dataclass(frozen=True, slots=True)
class Bench:
    """The rows of one bench, and what their ratios are to.

    Attributes:
        title: What was measured.
        floor: Case that is the floor.
        reference: Case that the others are compared with.
        rows: One a case.
    """

    title: str
    floor: str
    reference: str
    rows: Sequence[Row]


def in_turn(cases: Mapping[str, Call], rounds: int) -> list[Row]:
    """Times each case `rounds` times, one after the other, after one call unseen."""
    taken: dict[str, list[float]] = {name: [] for name in cases}
    for number in range(rounds + 1):
        for name, call in cases.items():
            began = time.perf_counter()
            call()
            if number:
                taken[name].append(time.perf_counter() - began)
    return [row_of(name, values) for name, values in taken.items()]


def row_of(case: str, seconds: Sequence[float]) -> Row:
    """Median and range of some times."""
    return Row(case, statistics.median(seconds), min(seconds), max(seconds))


def compared(
    title: str,
    rows: Sequence[Row],
    floor: str,
    reference: str,
    limits: Mapping[str, float] | None = None,
) -> Bench:
    """A bench with its ratios filled in.

    The ratio of the fastest times, which other work disturbs least.
    """
    fastest = {row.case: row.fastest for row in rows}
    return Bench(
        title,
        floor,
        reference,
        [
            replace(
                row,
                per_floor=row.fastest / fastest[floor],
                per_reference=row.fastest / fastest[reference],
                limit=(limits or {}).get(row.case),
            )
            for row in rows
        ],
    )


def show(bench: Bench) -> None:
    """Prints a bench as a table."""
    table = Table(title=bench.title, title_justify="left", box=SIMPLE)
    for name in ("case", "median", "range", "× floor", "× reference", "limit", ""):
        figures = "left" if name in ("case", "") else "right"
        table.add_column(name, justify=figures, no_wrap=True)
    for row in bench.rows:
        table.add_row(
            row.case,
            duration(row.seconds) if row.seconds else "",
            _range(row),
            _ratio(row.per_floor),
            _ratio(row.per_reference),
            _verdict(row),
            row.note,
        )
    console = Console()
    console.width = max(console.width, WIDTH)
    console.print(table)
    console.print(f"floor: {bench.floor}; reference: {bench.reference}\n")


def duration(seconds: float) -> str:
    """A time with three digits and its unit."""
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if seconds * factor >= 1.0:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def _range(row: Row) -> str:
    if row.fastest == row.slowest:
        return ""
    return f"{duration(row.fastest)} to {duration(row.slowest)}"


def _ratio(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"


def _verdict(row: Row) -> str:
    if row.limit is None:
        return ""
    colour = "green" if row.fastest <= row.limit else "red"
    return f"[{colour}]{duration(row.limit)}[/]"
