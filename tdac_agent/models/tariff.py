"""Cost of a model's answers, as far as it is known, and the limits of a run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from tdac_agent.errors import ProviderError
from tdac_agent.models.budget import NOTHING, Amount
from tdac_agent.models.prices import Price, load_prices
from tdac_agent.models.provider import (
    Provider,
    Reply,
    Request,
    missing_for,
    served_at,
)
from tdac_agent.models.tokens import most_tokens
from tdac_agent.models.vendors import vendor_of

MAX_COST = 2.0
"""Default limit of a run, USD."""
UNPRICED_TOKENS = 1_000_000
"""Default token limit of a run with a model of unknown price."""
UNKNOWN_COST = frozenset({"command", "manual"})
"""Providers whose cost cannot be known."""


@dataclass(frozen=True, slots=True)
class Tariff:
    """Tariff of one model.

    Attributes:
        free: Whether no language model is asked at all.
        price: Price of the model; None if it is unknown.
    """

    free: bool = False
    price: Price | None = None

    def worst(self, request: Request) -> Amount:
        """Returns the worst-case amount of an answer."""
        if self.free:
            return NOTHING
        return self.most(most_tokens(request.prompt), request.max_tokens)

    def most(self, tokens_in: int, tokens_out: int) -> Amount:
        """Returns the highest amount for these tokens, cached or not."""
        usd = self.price.most(tokens_in, tokens_out) if self.price else 0.0
        return Amount(tokens_in + tokens_out, usd)

    def spent(self, request: Request, reply: Reply) -> Amount:
        """Returns the amount an answer took; the worst case if it reports no tokens."""
        tokens = reply.tokens_in + reply.tokens_out
        if self.free or tokens == 0:
            return self.worst(request)
        return Amount(tokens, 0.0 if self.price is None else self.price.cost(reply))

    def cost(self, spent: Amount) -> float | None:
        """Returns the cost of an amount in USD; None if the price is unknown."""
        return spent.usd if self.free or self.price is not None else None


class CostBounds(NamedTuple):
    """Limits of a run, and notes on them for the user."""

    max_cost: float | None
    max_tokens: int | None
    notes: tuple[str, ...] = ()


def tariffs_of(models: Iterable[Provider]) -> dict[str, Tariff]:
    """Returns the tariff of each model, by its name.

    Raises:
        PriceError: The user's price file cannot be used.
    """
    return {model.name: _tariff(model) for model in models}


def _tariff(model: Provider) -> Tariff:
    if not model.paid:
        return Tariff(free=True)
    return Tariff(price=load_prices().price_of(model.name, served_at(model)))


def bounds_of(
    models: Iterable[Provider],
    tariffs: Mapping[str, Tariff],
    max_cost: float | None,
    max_tokens: int | None,
) -> CostBounds:
    """Returns the limits of a run.

    Args:
        models: Models that are asked.
        tariffs: Tariff of each model, by its name.
        max_cost: Limit given by the user, USD; `MAX_COST` if None.
        max_tokens: Limit given by the user. If it is None and a price is unknown, a
            vendor's model is refused; for other models it is `UNPRICED_TOKENS`.

    Raises:
        ProviderError: A model lacks its key or package, or nothing bounds the cost of
            a vendor's model; the message lists all problems.
    """
    cost = MAX_COST if max_cost is None else max_cost
    notes: list[str] = []
    problems: list[str] = []
    for model in {model.name: model for model in models}.values():
        problems += missing_for(model)
        kind = model.name.partition(":")[0]
        tariff = tariffs[model.name]
        if tariff.free or tariff.price is not None or kind in UNKNOWN_COST:
            continue
        address = served_at(model)
        if max_tokens is None and address is None and vendor_of(model.name):
            problems.append(
                f"no price is known for {model.name}, so --max-cost cannot bound it: "
                "give --max-tokens N, or enter its price (docs/models.md)"
            )
            continue
        max_tokens = UNPRICED_TOKENS if max_tokens is None else max_tokens
        place = "" if address is None else f" at {address}"
        notes.append(
            f"no price is known for {model.name}{place}: its cost is not counted; "
            f"the run is limited to {max_tokens} tokens (--max-tokens)"
        )
    if problems:
        raise ProviderError("; and ".join(dict.fromkeys(problems)))
    return CostBounds(cost, max_tokens, tuple(notes))
