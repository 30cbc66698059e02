"""Base of the pydantic models of files and arguments."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class StrictModel(BaseModel):
    """A value that does not change, without unknown keys and infinite numbers."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class LenientModel(BaseModel):
    """The same for files of others, whose further keys are not read."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)
