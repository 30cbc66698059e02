"""Retirement dates of models, from a dated file."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import yaml
from pydantic import Field

from tdac_envs.core.strict_model import StrictModel

FILE = Path(__file__).parent / "lifecycle.yaml"
SOON_DAYS = 90
URGENT_DAYS = 30


class Lifecycle(StrictModel):
    """Contents of `lifecycle.yaml`."""

    dated: date
    source: str
    ends: dict[str, date] = Field(description="Retirement date by model name.")
    successors: dict[str, str] = Field({}, description="Model to use instead, by name.")


@functools.cache
def load_lifecycle() -> Lifecycle:
    """Returns the contents of the shipped file."""
    # raw read: shipped
    return Lifecycle.model_validate(yaml.safe_load(FILE.read_text("utf-8")))


def retired(
    models: Iterable[str], today: date | None = None, *, within_days: int = 0
) -> list[str]:
    """Returns the given models that are retired, or will be within some days.

    Args:
        models: `--learner` names.
        today: The date to compare with; the present one by default.
        within_days: Days after `today` that count as well.
    """
    last = (today or datetime.now(UTC).date()) + timedelta(days=within_days)
    ends = load_lifecycle().ends
    return [m for m in dict.fromkeys(models) if m in ends and ends[m] <= last]


def model_warnings(models: Iterable[str], today: date | None = None) -> list[str]:
    """Returns a line for each model that is retired or will be within `SOON_DAYS`."""
    now = today or datetime.now(UTC).date()
    known = load_lifecycle()
    lines = []
    for model in retired(models, now, within_days=SOON_DAYS):
        end, successor = known.ends[model], known.successors.get(model)
        when = f"was retired on {end}" if end <= now else f"will be retired on {end}"
        instead = "" if successor is None else f"; its successor is {successor}"
        lines.append(f"{model} {when} (as of {known.dated}){instead}")
    return lines
