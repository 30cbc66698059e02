"""Retirement dates of models, from a dated file."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from datetime import UTC, date, datetime
from pathlib import Path

import yaml
from pydantic import BaseModel, ConfigDict, Field

FILE = Path(__file__).parent / "lifecycle.yaml"
SOON_DAYS = 90


class Lifecycle(BaseModel):
    """Contents of `lifecycle.yaml`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    dated: date
    source: str
    ends: dict[str, date] = Field(description="Retirement date by model name.")


@functools.cache
def load_lifecycle() -> Lifecycle:
    """Returns the contents of the shipped file."""
    return Lifecycle.model_validate(yaml.safe_load(FILE.read_text("utf-8")))


def retired(models: Iterable[str], today: date | None = None) -> list[str]:
    """Returns the given models (`--learner` names) that are retired."""
    now = today or datetime.now(UTC).date()
    ends = load_lifecycle().ends
    return [model for model in models if model in ends and ends[model] <= now]


def model_warnings(models: Iterable[str], today: date | None = None) -> list[str]:
    """Returns a line for each model that is retired or will be within `SOON_DAYS`."""
    now = today or datetime.now(UTC).date()
    known = load_lifecycle()
    lines = []
    for model in dict.fromkeys(models):
        end = known.ends.get(model)
        if end is None or (end - now).days > SOON_DAYS:
            continue
        when = f"was retired on {end}" if end <= now else f"will be retired on {end}"
        lines.append(f"{model} {when} (as of {known.dated})")
    return lines
