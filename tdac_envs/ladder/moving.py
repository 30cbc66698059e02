"""Movers of the worlds of a task set: how they are drawn, and which are admitted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    model_validator,
)

from tdac_envs.core.errors import TaskError
from tdac_envs.core.models import StrictModel
from tdac_envs.ladder.generators.draft import ordered
from tdac_envs.map2d.placing import MoversSetup
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
"""Number of draws of a world's movers before half of them are left out."""


def _both_ends(given: Any) -> Any:
    """A single number stands for both ends."""
    return (given, given) if isinstance(given, int | float) else given


Count = Annotated[int, Field(ge=0, le=MOST_MOVERS)]
ENDS = AfterValidator(ordered), BeforeValidator(_both_ends)
"""Validators of the two ends between which a number is drawn."""


class MoversOfSet(StrictModel):
    """A group of movers of a set; numbers are drawn between two ends for each world."""

    kind: Literal["bounce", "crowd"]
    count: Annotated[tuple[Count, Count], *ENDS]
    speed: Annotated[tuple[Speed, Speed], *ENDS] = Field(description="px/s")
    radius: Annotated[tuple[Length, Length], *ENDS] = Field(description="px")

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


def draw_movers(
    groups: tuple[MoversOfSet, ...],
    task: Map2DTask,
    key: bytes,
    arrives: Callable[[Map2DTask], bool],
) -> Movers:
    """The movers of a world, among which a robot that knows all can reach the goal.

    Where they block every way, they start elsewhere; after `TRIES` draws, half of them
    are left out.

    Args:
        groups: What the movers are like.
        task: The task of the world; its movers are ignored.
        key: 32 bytes; all that is random follows from them.
        arrives: Whether such a robot reaches the goal of a task with movers.
    """
    seed = int.from_bytes(key[:16], "little")
    random = np.random.Generator(np.random.Philox(key=seed))
    specs = [spec for group in groups for spec in group.draw(random)]
    while True:
        for movers in _starts(specs, task, random):
            if not specs or arrives(replace(task, movers=movers)):
                return movers
        specs = specs[: len(specs) // 2]


def _starts(
    specs: list[AnySpec], task: Map2DTask, random: np.random.Generator
) -> Iterator[Movers]:
    """Draws where movers start, up to `TRIES` times, where there is room for them."""
    with suppress(TaskError):
        movers_setup = MoversSetup.of(specs, task)
        for _ in range(TRIES):
            with suppress(TaskError):
                yield movers_setup.start(task, random)
