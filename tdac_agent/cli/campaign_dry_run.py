"""What `tdac campaign` reads, and `--dry-run`: the runs and their maximum cost."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from tdac_agent.campaign.config import CampaignConfig, find_config, read_config
from tdac_agent.campaign.drive import read_progress
from tdac_agent.campaign.perform import RUNS
from tdac_agent.campaign.plan import (
    Cell,
    Plan,
    Shard,
    make_plan,
    models_of,
    question_of,
)
from tdac_agent.cli.campaign_flags import CampaignOptions
from tdac_agent.cli.campaign_table import labels_of, make_console, make_table
from tdac_agent.cli.console import print_json
from tdac_agent.cli.sentences import print_sentences
from tdac_agent.models.budget import format_usd
from tdac_agent.models.choice import check_name
from tdac_agent.models.lifecycle import model_warnings
from tdac_agent.models.prices import PriceList, load_prices, price_file
from tdac_agent.prompting.prompt import load_template
from tdac_agent.synthesis.cost_forecast import CostForecast, cost_of
from tdac_agent.synthesis.options import RACE, SynthOptions
from tdac_agent.synthesis.settled import settled
from tdac_agent.synthesis.workload import shares

FOLDER = Path("campaigns")
LEGEND = (
    "K: iterations; J: repairs per iteration; questions: of all runs if no controller "
    "ever passes; USD once, 3 times: cost if each question is asked once, or three "
    "times because the first two answers cannot be used"
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


def read_campaign(options: CampaignOptions) -> tuple[Path, CampaignConfig, Path]:
    """The campaign file, its contents with the typed limits, and the folder."""
    file = find_config(options.config)
    limits = {"max_cost": options.max_cost, "max_tokens": options.max_tokens}
    typed = {name: value for name, value in limits.items() if value is not None}
    config = read_config(file).model_copy(update=typed)
    return file, config, options.out or FOLDER / config.name


def _limits(config: CampaignConfig) -> str:
    """The limits of all runs together, and how they are set; empty without any."""
    words = []
    if config.max_cost is not None:
        cost = format_usd(config.max_cost)
        words.append(f"{cost} (max_cost in the file, --max-cost)")
    if config.max_tokens is not None:
        tokens = config.max_tokens
        words.append(f"{tokens} tokens (max_tokens in the file, --max-tokens)")
    return " and ".join(words)


def dry_run(options: CampaignOptions) -> int:
    """Prints the plan and returns 0; asks no model, needs no key, writes nothing."""
    console, shard = make_console(stderr=options.as_json), Shard.parse(options.shard)
    file, config, folder = read_campaign(options)
    for name in config.models:
        check_name(name)
    with console.status("reading the tasks …"):
        plan = make_plan(config, file.parent, trust=options.trust)
    prices = load_prices()
    progress, _ = read_progress(plan, shard, folder / RUNS)
    rows = [
        _row(tally.cell, tally.planned, plan, prices)
        for tally in progress.tallies.values()
    ]
    if options.as_json:
        print_json([asdict(row) for row in rows])
        return 0
    console.print(_table([t.cell for t in progress.tallies.values()], rows))
    print_sentences(console, LEGEND, "dim")
    if progress.before:
        done = f"{progress.before} of {progress.planned} runs in {folder} have already"
        print_sentences(console, f"{done} finished; they are counted above, too")
    for line in _lines(rows, config, prices):
        print_sentences(console, line)
    for line in model_warnings(models_of(plan.cells)):
        print_sentences(console, f"note: {line}", "yellow")
    return 0


def _row(cell: Cell, runs: int, plan: Plan, prices: PriceList) -> PlanRow:
    further = SynthOptions(**cell.search).restored(dict(cell.options))
    further = settled(further, on_set=cell.on_set)
    race = further.search == RACE
    forecast: CostForecast = cost_of(
        cell.task_name,
        question_of(plan.problem(cell), load_template(cell.prompt)),
        cell.learner,
        cell.optimizer,
        prices,
        iterations=cell.iterations,
        patience=cell.patience,
        candidates=further.candidates or 1,
        ask=further.ask if race else "",
        refine=cell.refine,
        variations=0 if race else shares(cell.episodes, further.improve).asked,
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
    figures = ("runs", "K", "J", "questions", "USD\nonce", "USD\n3 times")
    table = make_table(labels.names, figures)
    for cell, row in zip(cells, rows, strict=True):
        table.add_row(
            *map(escape, labels.of(cell)),
            *map(str, (row.runs, row.iterations, row.patience, row.questions)),
            _usd(row.cost_once),
            _usd(row.cost_most),
        )
    return table


def _lines(rows: list[PlanRow], config: CampaignConfig, prices: PriceList) -> list[str]:
    """What the runs may do and cost at most."""
    runs = sum(row.runs for row in rows)
    tested = sum(row.runs * row.iterations * (1 + row.patience) for row in rows)
    lines = [f"{runs} runs; no model was asked"]
    unknown = [row.cost_once for row in rows].count(None)
    once, most = (
        sum(cost for cost in costs if cost is not None)
        for costs in ([r.cost_once for r in rows], [r.cost_most for r in rows])
    )
    if not once and not unknown:
        return [*lines, f"at most {tested} candidates are tested: K x (1 + J) per run"]
    kinds = f", excluding {unknown} kinds of unknown price" if unknown else ""
    questions = sum(row.questions for row in rows)
    lines += [
        f"if no controller ever passes: {tested} candidates are tested, K x (1 + J) "
        f"per run, and {questions} questions are asked; without a limit they cost "
        f"{format_usd(once)} if each is asked once, and at most {format_usd(most)} if "
        f"each is asked three times{kinds}; a run that is verified early costs a small "
        "part of that",
        _stop(config, most, is_known=not unknown),
        f"prices of {prices.dated}: {price_file()}",
    ]
    return lines


def _stop(config: CampaignConfig, most: float, *, is_known: bool) -> str:
    """What is spent at most, given the limits of all runs together."""
    words = _limits(config)
    if not words:
        return "no limit for all runs together; set one by --max-cost or --max-tokens"
    line = f"limit of all runs together: {words}"
    if config.max_cost is None:
        return f"{line}; the campaign stops before exceeding it"
    if is_known and config.max_cost >= most:
        return f"{line}; never reached, since all runs cost at most {format_usd(most)}"
    return (
        f"{line}; so this campaign costs at most {format_usd(config.max_cost)}: it "
        "stops before exceeding it"
    )


def _usd(cost: float | None) -> str:
    return "unknown" if cost is None else f"{cost:.2f}" if cost else "–"
