"""Movers of the worlds of a task set: how they are drawn, and which are admitted."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.generators.draft import ordered
from tdac_envs.ladder.space_time import earliest_arrival
from tdac_envs.map2d.placing import Cast
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.movers.spec import (
    MOST_MOVERS,
    MOST_PEOPLE,
    AnySpec,
    BounceSpec,
    CrowdSpec,
    Length,
    Speed,
)
from tdac_envs.movers.state import Movers

TRIES = 10
"""Movers of a world are drawn so often before there are fewer of them."""


Count = Annotated[int, Field(ge=0, le=MOST_MOVERS)]


class MoversOfSet(BaseModel):
    """A group of movers of a set; numbers are drawn between two ends for each world."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    kind: Literal["bounce", "crowd"]
    count: Annotated[tuple[Count, Count], AfterValidator(ordered)]
    speed: Annotated[tuple[Speed, Speed], AfterValidator(ordered)] = Field(
        description="px/s"
    )
    radius: Annotated[tuple[Length, Length], AfterValidator(ordered)] = Field(
        description="px"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.kind == "crowd" and self.count[1] > MOST_PEOPLE:
            raise ValueError(f"count: a crowd has at most {MOST_PEOPLE} people")
        return self

    def draw(self, random: np.random.Generator) -> list[AnySpec]:
        """The movers of a world."""
        kind = BounceSpec if self.kind == "bounce" else CrowdSpec
        count = int(random.integers(self.count[0], self.count[1] + 1))
        return [
            kind(
                speed=float(random.uniform(*self.speed)),
                radius=float(random.uniform(*self.radius)),
            )
            for _ in range(count)
        ]


def draw_movers(groups: tuple[MoversOfSet, ...], task: Map2DTask, key: bytes) -> Movers:
    """The movers of a world, among which a robot that knows all can reach the goal.

    Where bouncing movers block every way, they are drawn again; after `TRIES` draws,
    half of them are left out.

    Args:
        groups: What the movers are like.
        task: The task of the world; its movers are ignored.
        key: 32 bytes; all that is random follows from them.
    """
    seed = int.from_bytes(key[:16], "little")
    random = np.random.Generator(np.random.Philox(key=seed))
    part = 1.0
    while True:
        for _ in range(TRIES):
            specs = [spec for group in groups for spec in group.draw(random)]
            specs = specs[: int(part * len(specs))]
            try:
                movers = Cast.of(specs, task).start(task, random)
            except TaskError:
                continue  # There is no room for all of them.
            if not specs or earliest_arrival(task, movers) is not None:
                return movers
        part *= 0.5
