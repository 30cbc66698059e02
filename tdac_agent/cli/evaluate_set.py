"""`tdac evaluate --set`: compares policies on worlds that they have never seen."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console
from tdac_agent.cli.evaluate import check_outputs, wrapper_names, write_csv
from tdac_agent.cli.evaluate_view import NONE, PAIRED, comparison_table
from tdac_agent.cli.flags import check_tier
from tdac_agent.cli.policy_bar import policy_bar
from tdac_agent.cli.sentences import print_sentences
from tdac_agent.cli.titled_table import titled_table
from tdac_agent.evaluation.evaluate import EPISODES, POLICIES, evaluate
from tdac_agent.evaluation.evaluation_report import Evaluation, PolicyRow
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.ladder.task_sets import load_set

MOST_CAUSES = 6
WIDEST = 16
LEGEND = (
    "knows: what the policy may use; sensors include the goal, and the pose where the "
    "set observes it. 95 %: exact interval of the rate (Clopper-Pearson); with several "
    "runs on each world, worlds are resampled. SCT: success x OT / T (least possible "
    "/ actual time); SPL: success x L / driven (shortest / actual path); BARN: at most "
    "0.5 (docs/task-sets.md). hit: episodes with a contact; late: cut off at the "
    "horizon; error: the policy's own, or too much CPU time."
)


def run(
    policies: list[str],
    name: str,
    split: str | None,
    worlds: int | None,
    wrappers: list[str] | None,
    csv: Path | None,
    out: Path | None,
    tier: str,
    as_json: bool,
) -> int:
    """Evaluates the policies and prints the results; returns the exit code."""
    check_tier(tier)
    names = None if wrappers is None else wrapper_names(wrappers)
    check_outputs(csv, out)
    tasks, count = load_set(name), EPISODES if worlds is None else worlds
    most = tasks.count(split or "test")
    if worlds is None and most:
        count = min(count, most)
    console = Console(stderr=as_json)
    bar = policy_bar(console)
    row = bar.add_task("", total=count, successes=0, doing="preparing")

    def watch(task: str, policy: str, episodes: int, successes: int) -> None:
        doing = escape(f"{task}: {policy}")
        bar.update(
            row, completed=episodes, successes=successes, doing=doing, refresh=True
        )

    with ChildPool() as child_pool, WarmJudge(child_pool) as judge, bar:
        found = evaluate(
            policies,
            [tasks],
            count,
            split=split or "test",
            wrappers=names,
            tier=tier,
            out=out,
            judge=judge,
            watch=watch,
        )
    if csv is not None:
        write_csv(found.to_frame(), csv)
    if as_json:
        sys.stdout.write(found.model_dump_json(indent=2) + "\n")
    else:
        show(found, console)
        if out is not None:
            files = f"evaluation.json, episodes.csv, {POLICIES}/"
            console.print(escape(f"wrote {files} to {out}"), soft_wrap=True)
    if found.all_crashed:
        console.print("[red]every policy crashed in every episode[/]")
        return 1
    return 0


def show(found: Evaluation, console: Console) -> None:
    """Prints the scores, those by generator, failures, and pairs."""
    (own,) = found.tasks
    worlds = f"worlds 0 to {found.episodes - 1} of {own.split}"
    title = f"{own.name} {own.sha256[:8]}: {worlds}"
    console.print(_scores(found, title))
    console.print()
    for row in found.rows:
        _print_failures(row, console)
    kinds = list(dict.fromkeys(kind for row in found.rows for kind in row.by_generator))
    if len(kinds) > 1:
        console.print(_by_generator(found, kinds))
        console.print()
    print_sentences(console, LEGEND)
    if found.comparisons:
        console.print()
        console.print(comparison_table(found.comparisons, several=False))
        console.print(PAIRED, style="dim", highlight=False)


def _table(title: str, found: Evaluation) -> Table:
    table = titled_table(title)
    longest = max(len(row.policy) for row in found.rows)
    table.add_column("policy", overflow="fold", min_width=min(longest, WIDEST))
    return table


def _scores(found: Evaluation, title: str) -> Table:
    table = _table(title, found)
    table.add_column("knows", no_wrap=True)
    for name in ("reached", "95 %", "SCT", "SPL", "BARN", "hit", "late", "error"):
        table.add_column(name, justify="right", no_wrap=True)
    for policy, row in zip(found.policies, found.rows, strict=True):
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
        rest = row.episodes - row.successes - hit - late
        counts = map(str, (hit, late, rest))
        table.add_row(escape(policy.name), row.knows, *cells, *counts)
    return table


def _by_generator(found: Evaluation, kinds: Sequence[str]) -> Table:
    """Success and SCT of each policy in the worlds of each generator."""
    table = _table("by generator: reached, SCT", found)
    for kind in kinds:
        table.add_column(escape(kind), justify="right", no_wrap=True)
    for row in found.rows:
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
