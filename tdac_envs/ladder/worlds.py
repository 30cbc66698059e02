"""Generated static worlds: the same key makes the same world everywhere."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from tdac_envs.core.errors import TaskError
from tdac_envs.core.strict_model import StrictModel
from tdac_envs.drive.task import Pose
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.ladder.admission import Admitted, Conditions, Rejection, admit
from tdac_envs.ladder.difficulty import Difficulty
from tdac_envs.ladder.generators.registry import GENERATORS, AnyParameters, draw
from tdac_envs.ladder.words import Words
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

    @property
    def cells(self) -> BoolGrid:
        """The map, shape (height, width), bool, True = occupied."""
        return self.terrain.grid.cells


def make_world(spec: WorldSpec, key: bytes) -> LadderWorld:
    """Makes a world.

    Args:
        spec: What it is like.
        key: 32 bytes, from `words.world_key`. All that is random follows from it.

    Raises:
        TaskError: None of the drafts fulfils the conditions.
        ValueError: The key has another length.
    """
    words = Words(key)
    rejected: list[Rejection] = []
    while len(rejected) < spec.tries:
        draft = draw(words, spec.generator, 2.0 * spec.radius)
        found = admit(draft, words, spec.conditions)
        if isinstance(found, Admitted):
            return _world(found, words, tuple(rejected))
        rejected.append(found)
    reasons = ", ".join(f"{n} × {why}" for why, n in Counter(rejected).most_common())
    raise TaskError(
        f"no feasible world from {spec.tries} drafts of {spec.generator.name!r} "
        f"({reasons}); change the generator's sizes or the conditions"
    )


def _world(
    found: Admitted, words: Words, rejected: tuple[Rejection, ...]
) -> LadderWorld:
    heading = words.uniform(-math.pi, math.pi)
    start = Pose(float(found.start[0]), float(found.start[1]), heading)
    goal = float(found.goal[0]), float(found.goal[1])
    rest = (found.field, found.path, found.difficulty, rejected)
    return LadderWorld(found.terrain, start, goal, *rest)
