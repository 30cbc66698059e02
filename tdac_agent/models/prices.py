"""Prices of models, from a dated file that a user can replace."""

from __future__ import annotations

import os
from datetime import date
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from tdac_agent.models.provider import Reply
from tdac_agent.storage.yaml_file import read_yaml
from tdac_envs.core.errors import TdacError

SHIPPED = Path(__file__).parent / "prices.yaml"
FREE = frozenset({"builtin", "replay", "scripted"})
"""Providers that use no language model."""


class PriceError(TdacError):
    """A price file cannot be used."""


class _PriceModel(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Price(_PriceModel):
    """Prices of one model, USD per million tokens."""

    input: float = Field(ge=0)
    output: float = Field(ge=0)
    cache_read: float | None = Field(None, ge=0)
    cache_write: float | None = Field(None, ge=0)

    def most(self, tokens_in: int, tokens_out: int) -> float:
        """Returns the highest possible cost in USD, cache writes included."""
        dearest = max(self.input, self.cache_write or 0.0)
        return (dearest * tokens_in + self.output * tokens_out) / 1e6

    def cost(self, reply: Reply) -> float:
        """Returns the cost of an answer in USD, from the tokens that it reports."""
        read = self.input if self.cache_read is None else self.cache_read
        written = self.input if self.cache_write is None else self.cache_write
        plain = reply.tokens_in - reply.tokens_cached - reply.tokens_written
        return (
            self.input * max(0, plain)
            + read * reply.tokens_cached
            + written * reply.tokens_written
            + self.output * reply.tokens_out
        ) / 1e6


class PriceList(_PriceModel):
    """Contents of a price file, schema 1."""

    schema_version: Literal[1] = Field(1, alias="schema")
    dated: date
    source: str = Field("", description="Source of the prices.")
    models: dict[str, Price] = Field(description="Prices by model name.")

    def price_of(self, model: str, base_url: str | None = None) -> Price | None:
        """Returns the price of a model (a `--learner` name); None if it is unknown.

        The listed prices do not apply to models on another server (`base_url`).
        """
        if model.partition(":")[0] in FREE:
            return Price(input=0.0, output=0.0)
        return None if base_url is not None else self.models.get(model)


def price_file() -> Path:
    """Returns $TDAC_PRICES, else ~/.config/tdac/prices.yaml, else the shipped file."""
    named = os.environ.get("TDAC_PRICES")
    if named:
        return Path(named)
    settings = os.environ.get("XDG_CONFIG_HOME") or os.path.expanduser("~/.config")
    own = Path(settings, "tdac", "prices.yaml")
    # For a user without a home `expanduser` keeps the "~".
    return own if own.is_absolute() and own.is_file() else SHIPPED


def load_prices(path: Path | None = None) -> PriceList:
    """Returns the prices in a file.

    Args:
        path: Price file; by default the one in use.

    Raises:
        PriceError: It cannot be read, or has a wrong or unknown key.
    """
    file = path or price_file()
    return read_yaml(file, PriceList, "the prices in", PriceError)
