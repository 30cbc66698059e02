"""Prints an evaluation on the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console
from tdac_agent.cli.sentences import print_sentences
from tdac_agent.cli.titled_table import titled_table
from tdac_agent.evaluation.evaluate import Problem
from tdac_agent.evaluation.evaluation_report import (
    EvaluatedProblem,
    Evaluation,
    PairedComparison,
    PolicyRow,
    Timing,
)
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.gap import TOO_CLOSE
from tdac_envs.ladder.frozen import ladder_of

NONE = "–"
# Least widths of long policy names, so that a table fits into 80 columns.
WIDEST, WIDEST_ON_SET = 12, 16
MOST_CAUSES = 6
LEGEND = (
    "knows: what the policy may use; sensors include pose and goal, + map and + "
    "guidance come in addition to sensors, privileged is everything. 95 %: exact "
    "interval of the rate (Clopper-Pearson). hit: episodes with a contact. time, path: "
    "relative to the shortest path at full speed; SPARC: smoothness, spectral arc "
    "length of the speed (0 is smoothest); these are medians of the successes. gap: "
    "between body and obstacles, smallest of all / mean over steps. ms/step: median / "
    "99th percentile of a policy call, measured by the judge."
)
SET_LEGEND = (
    "knows: what the policy may use; sensors include the goal, and the pose where the "
    "set observes it; + memory: its own map of what its rays showed; + planner: points "
    "on the way that is found on this map; + map: the given one. 95 %: exact "
    "interval of the rate (Clopper-Pearson); with several "
    "runs on each world, worlds are resampled. SCT: success x OT / T (least possible "
    "/ actual time); SPL: success x L / driven (shortest / actual path); BARN: at most "
    "0.5 (docs/task-sets.md). hit: episodes with a contact; late: cut off at the "
    "horizon; error: the policy's own, or too much CPU time."
)
PAIRED = (
    ">: reaches the goal more often; ~: no significant difference; by McNemar's exact "
    "test, not corrected for the number of pairs. only one: episodes in which only one "
    "of the two reaches the goal. both know: what both may use; empty if it differs."
)
# Level of each comparison; not corrected for multiple tests.
SIGNIFICANT = 0.05


def show_evaluation(
    results: Evaluation, console: Console, problems: Sequence[Problem]
) -> None:
    """Prints the tables of each task or set with failures, then the comparisons."""
    for task, problem in zip(results.tasks, problems, strict=True):
        if isinstance(problem, Task):
            _show_task(results, task, problem.setting.shown, console)
        else:
            _show_set(results, task, console)
    on_sets = [task.split is not None for task in results.tasks]
    if not all(on_sets):
        console.print(LEGEND, style="dim", highlight=False)
    if any(on_sets):
        print_sentences(console, SET_LEGEND)
    if results.comparisons:
        console.print()
        several = len(results.tasks) > 1
        console.print(comparison_table(results.comparisons, several=several))
        console.print(PAIRED, style="dim", highlight=False)


def _show_task(
    results: Evaluation, task: EvaluatedProblem, units: Units, console: Console
) -> None:
    timings = {(t.task, t.policy): t for t in results.timings}
    rows = results.of(task.name)
    console.print(_table(results, task, rows, timings, units))
    console.print()
    for line in _notes(rows):
        print_sentences(console, line, indent=2)


def _table(
    results: Evaluation,
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
    start = starts.get(str(results.variation), "the nominal start")
    title = (
        f"{task.called or task.name}: {results.episodes} episodes each, {start}, "
        f"seed {results.seed}"
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
        least = row.smallest_gap if row.smallest_gap is not None else row.clearance_min
        gaps = [units.scale * (gap or 0.0) for gap in (least, row.clearance_mean)]
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
        if row.too_close:
            share = f"{row.too_close} of {row.successes} successes"
            lines.append(f"{row.policy}: {share} came {TOO_CLOSE} to obstacles")
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


def _show_set(results: Evaluation, task: EvaluatedProblem, console: Console) -> None:
    """Prints the scores, those by generator, and failures."""
    worlds = f"worlds 0 to {results.episodes - 1} of {task.split}"
    ladder = ladder_of(task.name, task.sha256, task.dynamics)
    rows = results.of(task.name)
    console.print(_scores(f"{task.name} {task.sha256[:8]}: {worlds}", rows))
    console.print()
    if ladder:
        print_sentences(console, f"{task.name}: {ladder}", indent=2)
    for row in rows:
        _print_failures(row, console)
    kinds = list(dict.fromkeys(kind for row in rows for kind in row.by_generator))
    if len(kinds) > 1:
        console.print(_by_generator(rows, kinds))
        console.print()


def _policies(title: str, rows: Sequence[PolicyRow]) -> Table:
    table = titled_table(title)
    longest = max(len(row.policy) for row in rows)
    table.add_column("policy", overflow="fold", min_width=min(longest, WIDEST_ON_SET))
    return table


def _scores(title: str, rows: Sequence[PolicyRow]) -> Table:
    table = _policies(title, rows)
    table.add_column("knows", no_wrap=True)
    for name in ("reached", "95 %", "SCT", "SPL", "BARN", "hit", "late", "error"):
        table.add_column(name, justify="right", no_wrap=True)
    for row in rows:
        cells = [NONE] * 5
        if row.scores is not None and row.interval is not None:
            colour = "green" if row.successes == row.episodes else "yellow"
            colour = colour if row.successes else "red"
            low, high = 100 * row.interval.low, 100 * row.interval.high
            scores = row.scores.time, row.scores.path, row.scores.barn
            cells = [
                f"[{colour}]{row.successes}/{row.episodes}[/]",
                f"{low:.0f}–{high:.0f}",
                *(f"{score:.3f}" for score in scores),
            ]
        hit, late = (row.outcomes.get(each, 0) for each in ("collision", "out of time"))
        counts = hit, late, row.episodes - row.successes - hit - late
        table.add_row(escape(row.policy), row.knows, *cells, *map(str, counts))
    return table


def _by_generator(rows: Sequence[PolicyRow], kinds: Sequence[str]) -> Table:
    """Success and SCT of each policy in the worlds of each generator."""
    table = _policies("by generator: reached, SCT", rows)
    for kind in kinds:
        table.add_column(escape(kind), justify="right", no_wrap=True)
    for row in rows:
        own = [row.by_generator.get(kind) for kind in kinds]
        cells = (
            NONE if each is None else f"{100 * each.success:.0f} % {each.time:.2f}"
            for each in own
        )
        table.add_row(escape(row.policy), *cells)
    return table


def _print_failures(row: PolicyRow, console: Console) -> None:
    """The failures of a policy by cause; if nothing was driven, the reasons."""
    if row.scores is None:
        for text in row.told:
            print_sentences(console, f"{row.policy}, not driven: {text}", indent=2)
    elif row.causes:
        causes = list(row.causes.items())[:MOST_CAUSES]
        text = ", ".join(f"{count} {name}" for name, count in causes)
        print_sentences(console, f"{row.policy}, failures: {text}", indent=2)
