"""Generated static worlds: the same key makes the same world everywhere."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from tdac_envs.core.strict_model import StrictModel
from tdac_envs.drive.task import Pose
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.ladder.admission import (
    Admitted,
    Conditions,
    Rejection,
    admit,
    first_admitted,
)
from tdac_envs.ladder.difficulty import Difficulty
from tdac_envs.ladder.generators.registry import GENERATORS, AnyParameters, draw
from tdac_envs.ladder.random_stream import RandomStream
from tdac_envs.map2d.terrain import Terrain


class WorldSpec(StrictModel):
    """What a generated world is like, and what its task must fulfil."""

    generator: AnyParameters
    radius: float = Field(8.0, ge=1, le=100, description="Radius of the body, px.")
    step: float = Field(
        3.0, gt=0, le=100, description="Distance of one step at full speed, px."
    )
    tolerance: float = Field(
        4.0, gt=0, le=100, description="Distance at which the goal is reached, px."
    )
    min_gap: float = Field(1.1, ge=1, le=10, description="Least gap.")
    min_steps: float = Field(60.0, ge=1, description="Least number of steps, OT.")
    min_detour: float | None = Field(
        None, ge=1, description="Least detour; by default that of the generator."
    )
    tries: int = Field(200, ge=1, le=100_000, description="Largest number of drafts.")

    @cached_property
    def conditions(self) -> Conditions:
        """The conditions of admission."""
        detour = self.min_detour
        if detour is None:
            detour = GENERATORS[self.generator.name].min_detour
        task = (self.radius, self.step, self.tolerance)
        return Conditions(*task, self.min_gap, self.min_steps, detour)


@dataclass(frozen=True, slots=True, eq=False)
class LadderWorld:
    """A static world with a feasible task.

    Attributes:
        terrain: The map with its clearance and what rays need.
        start: Pose, px and rad.
        goal: Point (x, y), px.
        field: Shape (height, width), float32: length of the shortest path on the grid
            from each pixel to the goal, px, as in `Map2DTask`; inf if there is none.
        path: Shape (n, 2): points of the disc's shortest path, px.
        difficulty: How hard it is.
        rejected: Reasons of the drafts that were drawn before it.
        barn_steps: OT' of the BARN score, where the source of the world states one,
            steps; else it is L divided by the distance of a step.
    """

    terrain: Terrain
    start: Pose
    goal: tuple[float, float]
    field: NDArray[np.float32]
    path: NDArray[np.float64]
    difficulty: Difficulty
    rejected: tuple[Rejection, ...]
    barn_steps: float | None = None

    @classmethod
    def of(
        cls,
        found: Admitted,
        heading: float,
        rejected: tuple[Rejection, ...] = (),
        barn_steps: float | None = None,
    ) -> LadderWorld:
        """The world of an admitted task, with the heading at its start."""
        start, goal = found.start, found.goal
        return cls(
            found.terrain,
            Pose(float(start[0]), float(start[1]), heading),
            (float(goal[0]), float(goal[1])),
            found.field,
            found.path,
            found.difficulty,
            rejected,
            barn_steps,
        )

    @property
    def cells(self) -> BoolGrid:
        """The map, shape (height, width), bool, True = occupied."""
        return self.terrain.grid.cells


def make_world(spec: WorldSpec, key: bytes) -> LadderWorld:
    """Makes a world.

    Args:
        spec: What it is like.
        key: 32 bytes, from `world_key`. All that is random follows from it.

    Raises:
        TaskError: None of the drafts fulfils the conditions.
        ValueError: The key has another length.
    """
    random, name = RandomStream(key), spec.generator.name

    def attempt() -> Admitted | Rejection:
        draft = draw(random, spec.generator, 2.0 * spec.radius)
        return admit(draft, random, spec.conditions)

    found, rejected = first_admitted(spec.tries, name, attempt)
    return LadderWorld.of(found, random.uniform(-math.pi, math.pi), rejected)
