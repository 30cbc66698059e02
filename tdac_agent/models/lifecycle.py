"""Which models are gone, or soon will be, by a dated file."""

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
    """Contents of the file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    dated: date
    source: str
    ends: dict[str, date] = Field(description="By `anthropic:MODEL` and so on.")


@functools.cache
def load_lifecycle() -> Lifecycle:
    """What the shipped file says."""
    return Lifecycle.model_validate(yaml.safe_load(FILE.read_text("utf-8")))


def retired(models: Iterable[str], today: date | None = None) -> list[str]:
    """Those of some models that are gone, by their names for `--learner`."""
    now = today or datetime.now(UTC).date()
    ends = load_lifecycle().ends
    return [model for model in models if model in ends and ends[model] <= now]


def model_warnings(models: Iterable[str], today: date | None = None) -> list[str]:
    """A line for each model that is gone, or will be within `SOON_DAYS`."""
    now = today or datetime.now(UTC).date()
    known = load_lifecycle()
    lines = []
    for model in dict.fromkeys(models):
        end = known.ends.get(model)
        if end is None or (end - now).days > SOON_DAYS:
            continue
        when = f"was retired on {end}" if end <= now else f"will be retired on {end}"
        lines.append(f"{model} {when} (as known on {known.dated})")
    return lines
