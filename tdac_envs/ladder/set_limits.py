"""Limits of a task set: horizon, admission of worlds, CPU time of a controller."""

from __future__ import annotations

import math
from typing import Self

from pydantic import Field, model_validator

from tdac_envs.core.arguments import MOST_STEPS
from tdac_envs.core.strict_model import StrictModel


class HorizonSpec(StrictModel):
    """The horizon: `factor` times OT, within `least` and `most` steps."""

    factor: float = Field(16.0, gt=0, le=1000)
    least: int = Field(400, ge=1, le=MOST_STEPS)
    most: int = Field(2000, ge=1, le=MOST_STEPS)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.least > self.most:
            raise ValueError(
                f"expected `least` to be at most `most`, got {self.least} and "
                f"{self.most}"
            )
        return self

    def steps(self, least_steps: float) -> int:
        """The horizon of a world whose OT is `least_steps`."""
        return min(max(math.ceil(self.factor * least_steps), self.least), self.most)


class AdmissionSpec(StrictModel):
    """What every world of the set must fulfil; see `docs/generated-worlds.md`."""

    gap: float = Field(1.1, ge=1, le=10, description="Least gap.")
    steps: float = Field(60.0, ge=1, le=MOST_STEPS, description="Least OT, steps.")
    detour: float | None = Field(
        None, ge=1, le=100, description="Least detour; by default the generator's."
    )
    tries: int = Field(200, ge=1, le=100_000, description="Most drafts of a world.")


class CpuSpec(StrictModel):
    """CPU time (user and system) that a controller may use in an episode, s."""

    start: float = Field(2.0, gt=0, le=600, description="Import and reset.")
    step: float = Field(0.02, gt=0, le=10, description="Mean of a step.")
    bank: float = Field(2.0, ge=0, le=600, description="What it may be ahead.")

    def of_steps(self, steps: int) -> float:
        """What the first `steps` steps may use together, s."""
        return self.bank + self.step * steps
