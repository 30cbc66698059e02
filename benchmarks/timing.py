"""Timing in turns, and the table of results.

Compared cases take turns within one run, so that other load on the machine affects all
of them equally: ratios carry over where seconds do not.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

Call = Callable[[], int | object]
"""A timed call; if it returns an int, that is the number of steps it made."""
Times = Mapping[str, Sequence[float]]
"""Seconds per step of each case, one value per round."""

WIDTH = 140
"""Minimum console width, so that tables are not cut."""


@dataclass(frozen=True, slots=True)
class Effort:
    """How thoroughly a bench measures.

    Attributes:
        quick: Whether to use toy sizes and one round, only to check that it works.
        rounds: Number of rounds over all cases; by default the bench's own.
    """

    quick: bool = False
    rounds: int | None = None

    def rounds_of(self, usual: int) -> int:
        """The number of rounds for a bench with `usual` rounds by default."""
        return self.rounds or (1 if self.quick else usual)


@dataclass(frozen=True, slots=True)
class Row:
    """One case of a bench.

    Attributes:
        case: What was timed.
        seconds: Median time, s.
        fastest: Minimum time, s.
        slowest: Maximum time, s.
        per_floor: Time divided by that of the floor.
        speed: Speed relative to the reference: median of the ratios within rounds.
        low: First quartile of these ratios.
        high: Third quartile of these ratios.
        limit: Time limit in s, or None.
        note: Additional figures as text.
    """

    case: str
    seconds: float
    fastest: float
    slowest: float
    per_floor: float
    speed: float
    low: float
    high: float
    limit: float | None = None
    note: str = ""


@dataclass(frozen=True, slots=True)
class Bench:
    """The rows of one bench, and the cases that their ratios refer to.

    Attributes:
        title: What was measured.
        floor: Name of the case that is the floor.
        reference: Name of the case that is the reference.
        rows: One per case.
    """

    title: str
    floor: str
    reference: str
    rows: Sequence[Row]


def in_turn(cases: Mapping[str, Call], rounds: int) -> dict[str, list[float]]:
    """Times each case `rounds` times in turn, after one untimed warm-up call each."""
    taken: dict[str, list[float]] = {name: [] for name in cases}
    for number in range(rounds + 1):
        for name, call in cases.items():
            began = time.perf_counter()
            count = call()
            seconds = time.perf_counter() - began
            if number:
                taken[name].append(seconds / (count if isinstance(count, int) else 1))
    return taken


def compared(
    title: str,
    times: Times,
    floor: str,
    reference: str,
    limits: Mapping[str, float] | None = None,
    notes: Mapping[str, str] | None = None,
) -> Bench:
    """A bench of these times, with ratios to the floor and to the reference."""
    rows = []
    for case, own in times.items():
        low, speed, high = quartiles(_ratios(times[reference], own))
        _, per_floor, _ = quartiles(_ratios(own, times[floor]))
        rows.append(
            Row(
                case,
                statistics.median(own),
                min(own),
                max(own),
                per_floor,
                speed,
                low,
                high,
                (limits or {}).get(case),
                (notes or {}).get(case, ""),
            )
        )
    return Bench(title, floor, reference, rows)


def _ratios(over: Sequence[float], under: Sequence[float]) -> list[float]:
    """Ratios per round; of the medians if the numbers of rounds differ."""
    if len(over) != len(under):
        over, under = [statistics.median(over)], [statistics.median(under)]
    return [a / b for a, b in zip(over, under, strict=True)]


def quartiles(ratios: Sequence[float]) -> tuple[float, float, float]:
    """First quartile, median and third quartile; a single value three times."""
    if len(ratios) == 1:
        return ratios[0], ratios[0], ratios[0]
    low, middle, high = statistics.quantiles(ratios, method="inclusive")
    return low, middle, high


def show(bench: Bench) -> None:
    """Prints a bench as a table."""
    table = Table(title=bench.title, title_justify="left", box=SIMPLE)
    heads = ("case", "median", "range", "× floor", "speed", "quartiles", "limit", "")
    for name in heads:
        figures = "left" if name in ("case", "") else "right"
        table.add_column(name, justify=figures, no_wrap=True)
    for row in bench.rows:
        table.add_row(
            row.case,
            duration(row.seconds),
            _range(row),
            f"{row.per_floor:.3g}",
            f"{row.speed:.3g}",
            "" if row.low == row.high else f"{row.low:.3g} to {row.high:.3g}",
            _verdict(row),
            row.note,
        )
    console = Console()
    console.width = max(console.width, WIDTH)
    console.print(table)
    console.print(f"floor: {bench.floor}; speed: times that of {bench.reference}\n")


def duration(seconds: float) -> str:
    """A time with three significant digits and its unit."""
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if seconds * factor >= 1.0:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def _range(row: Row) -> str:
    if row.fastest == row.slowest:
        return ""
    return f"{duration(row.fastest)} to {duration(row.slowest)}"


def _verdict(row: Row) -> str:
    if row.limit is None:
        return ""
    colour = "green" if row.fastest <= row.limit else "red"
    return f"[{colour}]{duration(row.limit)}[/]"


def whole_from_one(text: str) -> int:
    """A positive integer from the command line; a type for argparse."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a positive integer, got {text}")
    return int(text)
