"""Prints an evaluation on the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console
from tdac_agent.cli.sentences import print_sentences
from tdac_agent.cli.titled_table import titled_table
from tdac_agent.evaluation.evaluation_report import (
    EvaluatedProblem,
    Evaluation,
    PairedComparison,
    PolicyRow,
    Timing,
)
from tdac_agent.tasks.units import Units

NONE = "–"
# Least width of long policy names, so that a table fits into 80 columns.
WIDEST = 12
LEGEND = (
    "knows: what the policy may use; sensors include pose and goal, + map and + "
    "guidance come in addition to sensors, privileged is everything. 95 %: exact "
    "interval of the rate (Clopper-Pearson). hit: episodes with a contact. time, path: "
    "relative to the shortest path at full speed; SPARC: smoothness, spectral arc "
    "length of the speed (0 is smoothest); these are medians of the successes. gap: "
    "clearance beside the body, least / mean. ms/step: median / 99th percentile of a "
    "policy call, measured by the judge."
)
PAIRED = (
    ">: reaches the goal more often; ~: no significant difference; by McNemar's exact "
    "test, not corrected for the number of pairs. only one: episodes in which only one "
    "of the two reaches the goal. both know: what both may use; empty if it differs."
)
# Level of each comparison; not corrected for multiple tests.
SIGNIFICANT = 0.05


def show_evaluation(
    found: Evaluation, console: Console, units: dict[str, Units]
) -> None:
    """Prints a table per task with its failure reasons, then the comparisons.

    Args:
        found: The evaluation.
        console: Console to print to.
        units: Units of each task by its name, as from `Setting.shown`.
    """
    timings = {(t.task, t.policy): t for t in found.timings}
    for task in found.tasks:
        rows = [row for row in found.rows if row.task == task.name]
        console.print(_table(found, task, rows, timings, units[task.name]))
        console.print()
        for line in _notes(rows):
            print_sentences(console, line, indent=2)
    console.print(LEGEND, style="dim", highlight=False)
    if found.comparisons:
        console.print()
        console.print(comparison_table(found.comparisons, several=len(found.tasks) > 1))
        console.print(PAIRED, style="dim", highlight=False)


def _table(
    found: Evaluation,
    task: EvaluatedProblem,
    rows: Sequence[PolicyRow],
    timings: dict[tuple[str, str], Timing],
    units: Units,
) -> Table:
    places = 0 if task.unit == "m" else 1
    starts = {
        "jitter": "jittered starts",
        "mixed": "jittered and random starts",
        "random": "random starts and goals",
    }
    title = (
        f"{task.called or task.name}: {found.episodes} episodes each, "
        f"{starts.get(str(found.variation), 'the nominal start')}, seed {found.seed}"
    )
    table = titled_table(title, gap=0)
    longest = max(len(row.policy) for row in rows)
    table.add_column("policy", overflow="fold", min_width=min(longest, WIDEST))
    table.add_column("knows", no_wrap=True)
    names = ("reached", "95 %", "hit", "time", "path", "SPARC")
    for name in (*names, f"gap {units.length}", "ms/step"):
        table.add_column(name, justify="right", no_wrap=True)
    for row in rows:
        timing = timings[row.task, row.policy]
        gaps = [
            units.scale * (gap or 0.0)
            for gap in (row.clearance_min, row.clearance_mean)
        ]
        assert row.interval is not None
        colour = "green" if row.rate == 1.0 else "red" if row.rate == 0.0 else "yellow"
        table.add_row(
            escape(row.policy),
            row.knows,
            f"[{colour}]{row.successes}/{row.episodes}[/]",
            f"{100 * row.interval.low:.0f}–{100 * row.interval.high:.0f}",
            str(row.collided),
            _figure(row.time_ratio, 2),
            _figure(row.path_ratio, 2),
            _figure(row.smoothness, 1),
            f"{units.amount(gaps[0], places)}/{units.amount(gaps[1], 0)}",
            f"{timing.median_ms:.2f}/{timing.p99_ms:.1f}",
        )
    return table


def _notes(rows: Sequence[PolicyRow]) -> list[str]:
    """Notes on the policies, and the reasons of their failures with counts."""
    lines = []
    for row in rows:
        if row.note is not None:
            lines.append(f"{row.policy}: {row.note}")
        for reason, count in row.reasons.items():
            lines.append(f"{row.policy}, {count} of {row.episodes}: {reason}")
    return lines


def comparison_table(pairs: Sequence[PairedComparison], *, several: bool) -> Table:
    """One row per pair of policies; with a column for the task if `several`."""
    table = titled_table("The same episodes, paired", gap=0)
    for name in (*(("task",) if several else ()), "policies"):
        table.add_column(name, overflow="fold")
    table.add_column("only one", justify="right")
    table.add_column("p", justify="right")
    table.add_column("both know")
    for pair in pairs:
        table.add_row(
            *((escape(pair.task),) if several else ()),
            escape(_pair(pair)),
            _counts(pair),
            f"{pair.p:.2g}",
            pair.equal_information or "",
        )
    return table


def _pair(pair: PairedComparison) -> str:
    """The two names, joined by `>` if the difference is significant, else by `~`."""
    better, worse = _ordered(pair)
    return f"{better} {'>' if pair.p < SIGNIFICANT else '~'} {worse}"


def _ordered(pair: PairedComparison) -> tuple[str, str]:
    """The two names; the one that reaches the goal more often comes first."""
    if pair.only_other > pair.only_one:
        return pair.other, pair.one
    return pair.one, pair.other


def _counts(pair: PairedComparison) -> str:
    few, many = sorted((pair.only_one, pair.only_other))
    return f"{many}:{few}"


def _figure(value: float | None, decimals: int) -> str:
    return NONE if value is None else f"{value:.{decimals}f}"
