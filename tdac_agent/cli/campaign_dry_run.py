"""`tdac campaign --dry-run`: the runs and their maximum cost."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass

from rich.markup import escape
from rich.table import Table

from tdac_agent.campaign.config import find_config, read_config
from tdac_agent.campaign.drive import read_progress
from tdac_agent.campaign.perform import RUNS
from tdac_agent.campaign.plan import Cell, Plan, Shard, make_plan, models_of
from tdac_agent.cli.campaign import CampaignCommand, with_limits
from tdac_agent.cli.campaign_table import labels_of, make_console, make_table
from tdac_agent.cli.sentences import print_sentences
from tdac_agent.models.budget import format_usd
from tdac_agent.models.choice import check_name
from tdac_agent.models.lifecycle import model_warnings
from tdac_agent.models.prices import PriceList, load_prices, price_file
from tdac_agent.prompting.prompt import load_template
from tdac_agent.synthesis.cost_forecast import CostForecast, predict_cost

LEGEND = (
    "K: iterations; J: repairs per iteration; asked: questions of all runs if no "
    "controller ever passes; USD at most: if each question is asked once; asked 3 "
    "times: if each question is asked three times"
)


@dataclass(frozen=True, slots=True)
class PlanRow:
    """The maximum cost of one kind of run.

    Attributes:
        kind: Folder name of the kind.
        runs: Number of runs.
        iterations: K.
        patience: J.
        questions: Number of questions of all runs if no controller ever passes.
        cost_once: USD at most if each question is asked once; None if unknown.
        cost_most: USD at most if each question is asked three times; None if unknown.
    """

    kind: str
    runs: int
    iterations: int
    patience: int
    questions: int
    cost_once: float | None
    cost_most: float | None


def run(wanted: CampaignCommand, as_json: bool) -> int:
    """Prints the plan and returns 0; asks no model, needs no key, writes nothing."""
    console = make_console(stderr=as_json)
    shard, file = Shard.parse(wanted.shard), find_config(wanted.given)
    config = with_limits(read_config(file), wanted.limits)
    for name in config.models:
        check_name(name)
    with console.status("reading the tasks …"):
        plan = make_plan(config, file.parent, trust=wanted.trust)
    prices, folder = load_prices(), wanted.folder(config)
    progress, _ = read_progress(plan, shard, folder / RUNS)
    rows = [
        _row(tally.cell, tally.planned, plan, prices)
        for tally in progress.tallies.values()
    ]
    if as_json:
        sys.stdout.write(json.dumps([asdict(row) for row in rows], indent=2) + "\n")
        return 0
    console.print(_table([t.cell for t in progress.tallies.values()], rows))
    print_sentences(console, LEGEND, "dim")
    if progress.before:
        done = f"{progress.before} of {progress.planned} runs in {folder} have already"
        print_sentences(console, f"{done} finished; they are counted above, too")
    for line in _lines(rows, config.max_cost, config.max_tokens, prices):
        print_sentences(console, line)
    for line in model_warnings(models_of(plan.cells)):
        print_sentences(console, f"note: {line}", "yellow")
    return 0


def _row(cell: Cell, runs: int, plan: Plan, prices: PriceList) -> PlanRow:
    forecast: CostForecast = predict_cost(
        plan.tasks[cell.task],
        cell.learner,
        cell.optimizer,
        prices,
        iterations=cell.iterations,
        patience=cell.patience,
        refine=cell.refine,
        template=load_template(cell.prompt),
        base_url=cell.base_url,
        max_output=cell.max_output,
    )
    once, most = forecast.cost_once, forecast.cost_most
    return PlanRow(
        cell.folder,
        runs,
        cell.iterations,
        cell.patience,
        runs * forecast.questions,
        None if once is None else runs * once,
        None if most is None else runs * most,
    )


def _table(cells: list[Cell], rows: list[PlanRow]) -> Table:
    labels = labels_of(cells)
    figures = ("runs", "K", "J", "asked", "USD at\nmost", "asked 3\ntimes")
    table = make_table(labels.names, figures)
    for cell, row in zip(cells, rows, strict=True):
        table.add_row(
            *map(escape, labels.of(cell)),
            *map(str, (row.runs, row.iterations, row.patience, row.questions)),
            _usd(row.cost_once),
            _usd(row.cost_most),
        )
    return table


def _lines(
    rows: list[PlanRow],
    max_cost: float | None,
    max_tokens: int | None,
    prices: PriceList,
) -> list[str]:
    lines = [f"{sum(row.runs for row in rows)} runs; no model was asked"]
    costs = [row.cost_once for row in rows]
    unknown = costs.count(None)
    total = sum(cost for cost in costs if cost is not None)
    if total or unknown:
        kinds = f", excluding {unknown} kinds of unknown price" if unknown else ""
        lines.append(
            f"if no controller ever passes: at most {format_usd(total)}{kinds}; a run "
            "that is verified early costs a small part of that"
        )
        bounds = [format_usd(max_cost)] if max_cost is not None else []
        bounds += [f"{max_tokens} tokens"] if max_tokens is not None else []
        lines.append(f"limit of all runs together: {' and '.join(bounds) or 'none'}")
        lines.append(f"prices of {prices.dated}: {price_file()}")
    return lines


def _usd(cost: float | None) -> str:
    return "unknown" if cost is None else f"{cost:.2f}" if cost else "–"
