"""Base class of what is read from files and of settings."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class StrictModel(BaseModel):
    """An immutable record of finite numbers, without unknown fields."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class LenientModel(BaseModel):
    """The same for files of others, whose further keys are not read."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)
