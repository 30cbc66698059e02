"""What models cost, by a dated file that a user can replace."""

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
"""Providers that ask no model."""


class PriceError(TdacError):
    """A price file cannot be used."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Price(_Strict):
    """Of one model, USD per million tokens."""

    input: float = Field(ge=0)
    output: float = Field(ge=0)
    cache_read: float | None = Field(None, ge=0)
    cache_write: float | None = Field(None, ge=0)

    def most(self, tokens_in: int, tokens_out: int) -> float:
        """USD for so many tokens, whether or not they are written to a cache."""
        dearest = max(self.input, self.cache_write or 0.0)
        return (dearest * tokens_in + self.output * tokens_out) / 1e6

    def cost(self, reply: Reply) -> float:
        """USD of an answer, by what is reported of it; a cache costs its own price."""
        read = self.input if self.cache_read is None else self.cache_read
        written = self.input if self.cache_write is None else self.cache_write
        plain = reply.tokens_in - reply.tokens_cached - reply.tokens_written
        return (
            self.input * max(0, plain)
            + read * reply.tokens_cached
            + written * reply.tokens_written
            + self.output * reply.tokens_out
        ) / 1e6


class PriceList(_Strict):
    """Contents of a price file, schema 1."""

    schema_version: Literal[1] = Field(1, alias="schema")
    dated: date
    source: str = Field("", description="Where the prices are from.")
    models: dict[str, Price] = Field(description="By `anthropic:MODEL` and so on.")

    def price_of(self, model: str, base_url: str | None = None) -> Price | None:
        """Price of a model by its name for `--learner`; None where it is unknown.

        Somebody else's server has prices of its own, or none.
        """
        if model.partition(":")[0] in FREE:
            return Price(input=0.0, output=0.0)
        return None if base_url is not None else self.models.get(model)


def price_file() -> Path:
    """The file in use: `$TDAC_PRICES`, `~/.config/tdac/prices.yaml`, or the shipped."""
    named = os.environ.get("TDAC_PRICES")
    if named:
        return Path(named)
    settings = os.environ.get("XDG_CONFIG_HOME") or os.path.expanduser("~/.config")
    own = Path(settings, "tdac", "prices.yaml")
    # Without a home, as of a user id that the system does not know, it stays "~".
    return own if own.is_absolute() and own.is_file() else SHIPPED


def load_prices(path: Path | None = None) -> PriceList:
    """The prices in a file.

    Args:
        path: The file; the one in use by default.

    Raises:
        PriceError: It cannot be read, or has a wrong or unknown key.
    """
    file = path or price_file()
    return read_yaml(file, PriceList, "the prices in", PriceError)
