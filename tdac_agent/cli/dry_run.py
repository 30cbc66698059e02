"""`tdac synth --dry-run`: the first prompt and the maximum cost of the run."""

from __future__ import annotations

import sys
from collections.abc import Collection, Sequence

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.omitted_facts import check_omitted
from tdac_agent.cli.sentences import print_sentences
from tdac_agent.cli.synth_flags import RunFlags
from tdac_agent.cli.task_choice import chosen_problem
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.models.budget import format_usd
from tdac_agent.models.choice import Options, check_name, missing_for_name
from tdac_agent.models.prices import SHIPPED, load_prices, price_file
from tdac_agent.models.tariff import MAX_COST
from tdac_agent.models.vendors import vendor_of
from tdac_agent.prompting.prompt import load_template
from tdac_agent.synthesis.cost_forecast import CostForecast, cost_of
from tdac_agent.synthesis.options import RACE, SynthOptions
from tdac_agent.synthesis.settled import settled
from tdac_agent.synthesis.synthesize import book_of
from tdac_agent.synthesis.workload import shares


def dry_run(
    flags: TaskFlags,
    options: SynthOptions,
    run_flags: RunFlags,
    typed: Collection[str],
) -> int:
    """Prints the prompt alone to stdout, the rest to stderr; returns 0."""
    learner = str(options.learner)
    names = learner, str(options.optimizer or learner)
    for name in names:
        check_name(name)
    book = book_of(options.rules)
    problem = chosen_problem(flags, options, run_flags, profile=run_flags.profile)
    check_omitted(options, typed, on_set=problem.has_hidden)
    options = settled(options, on_set=problem.has_hidden)
    template = load_template(options.prompt)
    base_url = _server_of(names, options.base_url)
    server = Options(problem.setting, options.base_url, options.key_over_http)
    missing = [line for each in names for line in missing_for_name(each, server)]
    episodes = options.episodes if problem.has_hidden else None
    race = options.search == RACE
    forecast = cost_of(
        problem.name,
        problem.question(book.in_force, template),
        *names,
        load_prices(),
        iterations=options.iterations or 0,
        patience=options.patience,
        candidates=options.candidates or 1,
        ask=options.ask if race else "",
        refine=options.refine,
        variations=0 if race else shares(episodes, options.improve).asked,
        base_url=base_url,
        max_output=options.max_output,
        max_cost=options.max_cost,
        max_tokens=options.max_tokens,
    )
    if run_flags.as_json:
        print_json(forecast)
        return 0
    sys.stdout.write(forecast.prompt)
    sys.stdout.flush()
    console = Console(stderr=True, highlight=False)
    unbounded = _unbounded(forecast) if base_url is None else []
    estimates = _estimates(forecast, race=race)
    estimates += _prices(forecast, elsewhere=base_url is not None)
    for line in [*estimates, *_still_needed([*missing, *unbounded])]:
        print_sentences(console, line)
    return 0


def _server_of(names: Sequence[str], base_url: str | None) -> str | None:
    """The server that answers for all of the models; None for the vendors' own."""
    vendors = [vendor for name in names if (vendor := vendor_of(name)) is not None]
    urls = {vendor.server(base_url) for vendor in vendors}
    return urls.pop() if len(urls) == 1 else base_url


def _estimates(forecast: CostForecast, *, race: bool) -> list[str]:
    k, j = forecast.iterations, forecast.patience
    lines = [
        f"prompt: about {forecast.prompt_tokens} tokens (an estimate: a third of its "
        "bytes; models count differently)",
        f"answer: at most {forecast.answer_tokens} tokens",
    ]
    if forecast.cost_most == 0.0:
        return [*lines, "cost: none; no model is asked"]
    if forecast.first_cost is not None:
        reserved = format_usd(forecast.first_cost)
        lines.append(f"first question: at most {reserved}, reserved before it is asked")
    whole = f"whole run: {forecast.questions} questions (K={k}, J={j}"
    if race:
        whole = f"whole run: at most {forecast.questions} questions (K={k}"
    if forecast.variations:
        whole += f", and {forecast.variations} to improve what works"
    whole += ")" if race else ") if no controller passes"
    if forecast.variations:
        whole += " before the last one"
    if forecast.cost_once is not None and forecast.cost_most is not None:
        whole += (
            f": at most {format_usd(forecast.cost_once)}, or "
            f"{format_usd(forecast.cost_most)} if each question is asked three times"
        )
    return [*lines, whole, *_budget(forecast)]


def _budget(forecast: CostForecast) -> list[str]:
    """The limits of a run, and whether they cover its first question."""
    limits = []
    if forecast.max_cost is not None:
        default = ", by default" if forecast.max_cost == MAX_COST else ""
        limits.append(f"{format_usd(forecast.max_cost)} (--max-cost{default})")
    if forecast.max_tokens is not None:
        limits.append(f"{forecast.max_tokens} tokens (--max-tokens)")
    if not limits:
        return []
    verdict = "enough for the first question; the run stops before exceeding it"
    if forecast.first_needs:
        needs = forecast.first_needs
        verdict = f"not enough for the first question: give {needs} or more"
    return [f"budget: {' and '.join(limits)}: {verdict}"]


def _unbounded(forecast: CostForecast) -> list[str]:
    """Flags needed for vendor models without a price; others have a token limit."""
    if forecast.max_tokens is not None:
        return []
    return [
        f"--max-tokens N, since no price of {name} is known to limit the run's cost"
        for name in forecast.unknown_prices
        if vendor_of(name) is not None
    ]


def _prices(forecast: CostForecast, *, elsewhere: bool) -> list[str]:
    """The source of the prices, and the models without one.

    Args:
        forecast: The forecast.
        elsewhere: Whether another server answers, to which no listed price applies.
    """
    if forecast.cost_most == 0.0:
        return []
    lines = []
    if forecast.uncounted:
        names = " and ".join(forecast.uncounted)
        lines.append(f"cost of {names}: not counted; tdac cannot know it")
    if forecast.unknown_prices:
        names = " and ".join(forecast.unknown_prices)
        way = (
            f"to see the cost, add it to a copy of {SHIPPED} at "
            "~/.config/tdac/prices.yaml (or at the path in $TDAC_PRICES)"
        )
        if elsewhere:
            way = "listed prices do not apply to a server of your own"
        lines.append(f"price of {names}: unknown; {way}")
    if forecast.first_cost is not None or (forecast.unknown_prices and not elsewhere):
        lines.append(f"prices of {forecast.prices_dated}: {price_file()}")
    return lines


def _still_needed(missing: list[str]) -> list[str]:
    return [f"still needed: {line}" for line in dict.fromkeys(missing)]
