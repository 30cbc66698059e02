"""`tdac campaign --dry-run`: the runs, and what they can cost at most."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass

from rich.markup import escape
from rich.table import Table

from tdac_agent.campaign.config import find_config, read_config
from tdac_agent.campaign.drive import look
from tdac_agent.campaign.perform import RUNS
from tdac_agent.campaign.plan import Cell, Plan, Shard, make_plan, models_of
from tdac_agent.cli.campaign import Wanted, with_limits
from tdac_agent.cli.campaign_table import labels_of, make_console, make_table
from tdac_agent.cli.sentences import tell
from tdac_agent.models.budget import told_usd
from tdac_agent.models.choice import check_name
from tdac_agent.models.lifecycle import model_warnings
from tdac_agent.models.prices import PriceList, load_prices, price_file
from tdac_agent.prompting.prompt import load_template
from tdac_agent.synthesis.outlook import Outlook, foresee

LEGEND = (
    "K iterations with up to J repairs each; asked: questions of all runs if nothing "
    "ever passes; USD if each is answered at once, and if each answer has to be asked "
    "for three times"
)


@dataclass(frozen=True, slots=True)
class Row:
    """What a kind of run can cost.

    Attributes:
        kind: Its folder.
        runs: How many.
        iterations: K.
        patience: J.
        questions: Of all runs, if nothing ever passes.
        cost_once: USD at most, each question being answered at once; None if unknown.
        cost_most: USD at most, each answer being asked for three times.
    """

    kind: str
    runs: int
    iterations: int
    patience: int
    questions: int
    cost_once: float | None
    cost_most: float | None


def run(wanted: Wanted, as_json: bool) -> int:
    """Prints the plan; no model is asked, no key is needed, nothing is written.

    Args:
        wanted: What the command was asked for.
        as_json: Whether to print JSON.
    """
    console = make_console(stderr=as_json)
    shard, file = Shard.parse(wanted.shard), find_config(wanted.given)
    config = with_limits(read_config(file), wanted.limits)
    for name in config.models:
        check_name(name)
    with console.status("reading the tasks …"):
        plan = make_plan(config, file.parent, trust=wanted.trust)
    prices, folder = load_prices(), wanted.folder(config)
    progress, _ = look(plan, shard, folder / RUNS)
    rows = [
        _row(tally.cell, tally.planned, plan, prices)
        for tally in progress.tallies.values()
    ]
    if as_json:
        sys.stdout.write(json.dumps([asdict(row) for row in rows], indent=2) + "\n")
        return 0
    console.print(_table([t.cell for t in progress.tallies.values()], rows))
    tell(console, LEGEND, "dim")
    if progress.before:
        done = f"{progress.before} of {progress.planned} runs have come to their end"
        tell(console, f"{done} before, and are counted here, too: {folder}")
    for line in _lines(rows, config.max_cost, config.max_tokens, prices):
        tell(console, line)
    for line in model_warnings(models_of(plan.cells)):
        tell(console, f"note: {line}", "yellow")
    return 0


def _row(cell: Cell, runs: int, plan: Plan, prices: PriceList) -> Row:
    outlook: Outlook = foresee(
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
    once, most = outlook.cost_once, outlook.cost_most
    return Row(
        cell.folder,
        runs,
        cell.iterations,
        cell.patience,
        runs * outlook.questions,
        None if once is None else runs * once,
        None if most is None else runs * most,
    )


def _table(cells: list[Cell], rows: list[Row]) -> Table:
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
    rows: list[Row],
    max_cost: float | None,
    max_tokens: int | None,
    prices: PriceList,
) -> list[str]:
    lines = [f"{sum(row.runs for row in rows)} runs; no model was asked"]
    costs = [row.cost_once for row in rows]
    unknown = costs.count(None)
    total = sum(cost for cost in costs if cost is not None)
    if total or unknown:
        kinds = f", without {unknown} kinds whose price is unknown" if unknown else ""
        lines.append(
            f"if nothing ever passes: at most {told_usd(total)}{kinds}; a run that is "
            "verified soon costs a small part of that"
        )
        bounds = [told_usd(max_cost)] if max_cost is not None else []
        bounds += [f"{max_tokens} tokens"] if max_tokens is not None else []
        lines.append(f"all runs together stop at {' and '.join(bounds) or 'nothing'}")
        lines.append(f"prices of {prices.dated}: {price_file()}")
    return lines


def _usd(cost: float | None) -> str:
    return "unknown" if cost is None else f"{cost:.2f}" if cost else "–"
