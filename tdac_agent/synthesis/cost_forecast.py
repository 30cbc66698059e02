"""The first question and the maximum cost of a run, before it begins."""

from __future__ import annotations

from pydantic import ConfigDict, Field

from tdac_agent.models.budget import NOTHING, Amount, Budget, BudgetExhausted
from tdac_agent.models.prices import PriceList
from tdac_agent.models.provider import MAX_OUTPUT_TOKENS
from tdac_agent.models.tariff import MAX_COST, UNKNOWN_COST, UNPRICED_TOKENS, Tariff
from tdac_agent.models.tokens import estimate_tokens, most_tokens
from tdac_agent.storage.printable_record import PrintableRecord
from tdac_agent.synthesis.dialogue import MAX_ASKS
from tdac_agent.synthesis.workload import of_race, tokens_asked, whole


class CostForecast(PrintableRecord):
    """The first question of a run, and cost bounds; token numbers are estimates."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    task: str
    learner: str
    optimizer: str
    iterations: int = Field(description="K")
    patience: int = Field(description="J")
    prompt: str = Field(description="The first prompt, exactly.")
    prompt_tokens: int = Field(description="Estimated from its length in bytes.")
    answer_tokens: int = Field(description="Token limit of the first answer.")
    first_cost: float | None = Field(
        description="USD reserved for the first question; None if unknown."
    )
    max_cost: float | None = Field(
        description="Limit in USD; None if nothing has a price."
    )
    max_tokens: int | None = Field(description="Limit of tokens; None for no limit.")
    first_needs: str = Field(
        description="Flag that the first question needs; empty if the limits suffice."
    )
    questions: int = Field(
        description="Questions of the run, if no candidate passes before the last one."
    )
    variations: int = Field(description="Part of them that vary what works, at most.")
    cost_once: float | None = Field(
        description="Maximum in USD if each first answer can be used."
    )
    cost_most: float | None = Field(
        description="Maximum in USD if each answer is truncated and requested 3 times."
    )
    unknown_prices: tuple[str, ...] = Field(description="Models without a price.")
    uncounted: tuple[str, ...] = Field(
        description="Programs and people, whose cost cannot be known."
    )
    prices_dated: str


def cost_of(
    name: str,
    prompt: str,
    learner: str,
    optimizer: str,
    prices: PriceList,
    *,
    iterations: int = 20,
    patience: int = 1,
    refine: bool = True,
    candidates: int = 1,
    variations: int = 0,
    ask: str = "",
    base_url: str | None = None,
    max_output: int = MAX_OUTPUT_TOKENS,
    max_cost: float | None = None,
    max_tokens: int | None = None,
) -> CostForecast:
    """Predicts the cost bounds of a run from its first question; asks no model.

    Args:
        name: Name of the task or task set.
        prompt: The first question.
        learner: Name of LLM1.
        optimizer: Name of LLM2.
        prices: Prices of the models.
        iterations: K.
        patience: J.
        refine: Whether failures become rules.
        candidates: N, asked for side by side.
        variations: Most variations of what works (`most_variations`).
        ask: Kinds of questions of a race; empty for the loop.
        base_url: URL of the models' server; by default the vendor's.
        max_output: Token limit of an answer.
        max_cost: Limit in USD; by default 2.
        max_tokens: Limit of tokens; by default as in `bounds_of`.
    """
    tokens = estimate_tokens(prompt)
    terms = {"candidates": candidates, "variations": variations}
    work = whole(iterations, patience, refine=refine, **terms)
    if ask:
        work = of_race(iterations, candidates, ask)
    sizes = tokens_asked(tokens, max_output)
    if ask:  # new controllers are asked for with what is known
        sizes = sizes._replace(learner=sizes.optimizer)
    prices_of = [prices.price_of(m, base_url) for m in (learner, optimizer)]
    first, second = prices_of
    once = most = first_cost = None
    if first is not None:
        first_cost = first.most(most_tokens(prompt), max_output)
    if first is not None and second is not None:
        answers = max_output * (1 + 2 * (MAX_ASKS - 1))
        once, most = (
            work.learner * first.most(times * sizes.learner, out)
            + work.optimizer * second.most(times * sizes.optimizer, out)
            + work.either
            * max(price.most(times * sizes.optimizer, out) for price in (first, second))
            for times, out in ((1, max_output), (MAX_ASKS, answers))
        )
    without = [
        name
        for name, price in zip((learner, optimizer), prices_of, strict=True)
        if price is None
    ]
    own = [name for name in without if name.partition(":")[0] in UNKNOWN_COST]
    if base_url is not None and max_tokens is None and len(without) > len(own):
        max_tokens = UNPRICED_TOKENS
    priced = any(price is not None and price.most(1, 1) > 0 for price in prices_of)
    limit = (MAX_COST if max_cost is None else max_cost) if priced else None
    worst = NOTHING
    if first_cost != 0.0:
        worst = Tariff(price=first).most(most_tokens(prompt), max_output)
    return CostForecast(
        task=name,
        learner=learner,
        optimizer=optimizer,
        iterations=iterations,
        patience=patience,
        prompt=prompt,
        prompt_tokens=tokens,
        answer_tokens=max_output,
        first_cost=first_cost,
        max_cost=limit,
        max_tokens=max_tokens,
        first_needs=_needed(Budget(limit, max_tokens), worst),
        questions=work.questions,
        variations=variations,
        cost_once=once,
        cost_most=most,
        unknown_prices=tuple(dict.fromkeys(n for n in without if n not in own)),
        uncounted=tuple(dict.fromkeys(own)),
        prices_dated=prices.dated.isoformat(),
    )


def _needed(budget: Budget, worst: Amount) -> str:
    """The flag that a question needs; empty if the budget suffices."""
    try:
        budget.reserve("first", worst)
    except BudgetExhausted as error:
        return str(error.enough(worst))
    return ""
