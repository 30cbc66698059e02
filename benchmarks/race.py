"""Times of things that take turns, so that what else runs disturbs all alike."""

from __future__ import annotations

import argparse
import json
import os
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass

from rich.console import Console
from rich.table import Table

Burst = Callable[[], int]


@dataclass(frozen=True, slots=True)
class Row:
    """One figure of a bench.

    Attributes:
        name: What was measured.
        value: Median of the rounds; for rates and times, of the undisturbed half.
        unit: Of the value.
        ratio: How many times as fast as the reference: median over the rounds, each
            compared with the reference of the same round.
        low: First quartile of these ratios.
        high: Third quartile of them.
    """

    name: str
    value: float
    unit: str
    ratio: float | None = None
    low: float | None = None
    high: float | None = None


def race(bursts: Mapping[str, Burst], rounds: int) -> dict[str, list[float]]:
    """Times of a step, s: for each name, one for each round.

    Args:
        bursts: Each makes some steps and returns how many.
        rounds: In each, all of them take their turn.
    """
    times: dict[str, list[float]] = {name: [] for name in bursts}
    for burst in bursts.values():
        burst()
    for _ in range(rounds):
        for name, burst in bursts.items():
            began = time.perf_counter()
            count = burst()
            times[name].append((time.perf_counter() - began) / count)
    return times


def compared(times: Mapping[str, list[float]], reference: str) -> list[Row]:
    """A row for each name, compared with the reference."""
    rows = []
    for name, own in times.items():
        pairs = zip(times[reference], own, strict=True)
        low, ratio, high = statistics.quantiles((there / here for there, here in pairs))
        calm = statistics.median(sorted(own)[: max(len(own) // 2, 1)])
        rows.append(Row(name, 1e6 * calm, "us a step", ratio, low, high))
    return rows


def show(title: str, rows: Sequence[Row], reference: str) -> None:
    """Prints the rows as a table."""
    table = Table(title=title, title_justify="left")
    table.add_column("", no_wrap=True)
    for head in ("value", "unit", f"x {reference}", "quartiles"):
        table.add_column(head, justify="left" if head == "unit" else "right")
    for row in rows:
        ratio = spread = ""
        if row.ratio is not None:
            ratio, spread = f"{row.ratio:.2f}", f"{row.low:.2f} to {row.high:.2f}"
        table.add_row(row.name, f"{row.value:.3g}", row.unit, ratio, spread)
    Console().print(table)


def main(
    name: str,
    about: str | None,
    benches: Mapping[str, Callable[[int], list[Row]]],
    reference: str,
) -> None:
    """Prints the rows of some benches, by the flags of their command.

    Args:
        name: Of the command.
        about: What it says of itself, in its first line.
        benches: By title; each takes a number of rounds.
        reference: Case that the others are compared with.
    """
    told = (about or "").partition("\n")[0]
    parser = argparse.ArgumentParser(prog=name, description=told)
    parser.add_argument("--rounds", type=int, default=60)
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args()
    load = f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"
    found = {title: bench(options.rounds) for title, bench in benches.items()}
    if options.json:
        print(json.dumps({k: [asdict(row) for row in v] for k, v in found.items()}))
        return
    for title, rows in found.items():
        show(f"{title} ({load})", rows, reference)
