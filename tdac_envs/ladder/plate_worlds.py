"""Generated worlds for the e-puck: the same key makes the same world everywhere."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from tdac_envs.core.strict_model import StrictModel
from tdac_envs.drive.task import Pose
from tdac_envs.ladder.admission import (
    Admitted,
    Conditions,
    Rejection,
    admit,
    first_admitted,
)
from tdac_envs.ladder.difficulty import Difficulty
from tdac_envs.ladder.generators.blocks import PIXEL, Block, centres, raster
from tdac_envs.ladder.generators.draft import WorldDraft
from tdac_envs.ladder.generators.plates import Plates, PlatesDraft, draw
from tdac_envs.ladder.random_stream import RandomStream
from tdac_envs.ladder.worlds import LadderWorld
from tdac_envs.worlds.bodies import BODY_RADIUS
from tdac_envs.worlds.footprint import Rectangle
from tdac_envs.worlds.world import Arena, EPuck, Obstacle, Part, World

_PIXEL = PIXEL / 1000
_WALL, _HEIGHT = 0.01, 0.1
"""Thickness of the arena's wall, and height of everything, m."""


class PlatesSpec(StrictModel):
    """What a generated world for the e-puck is like, and what its task must fulfil."""

    generator: Plates = Plates()
    step: float = Field(
        0.01256, gt=0, le=1, description="Distance of one step at full speed, m."
    )
    dt: float = Field(0.1, gt=0, le=10, description="Duration of a step, s.")
    tolerance: float = Field(
        0.08, gt=0, le=1, description="Distance at which the goal is reached, m."
    )
    min_gap: float = Field(1.3, ge=1, le=10, description="Least gap.")
    min_steps: float = Field(60.0, ge=1, description="Least number of steps, OT.")
    max_seconds: float = Field(40.0, gt=0, description="Largest OT, s.")
    min_detour: float = Field(1.3, ge=1, description="Least detour.")
    tries: int = Field(200, ge=1, le=100_000, description="Largest number of drafts.")

    @property
    def conditions(self) -> Conditions:
        """The conditions of admission, in pixels of the rasters."""
        task = (BODY_RADIUS / _PIXEL, self.step / _PIXEL, self.tolerance / _PIXEL)
        return Conditions(*task, self.min_gap, self.min_steps, self.min_detour)


@dataclass(frozen=True, slots=True, eq=False)
class PlatesWorld:
    """A world with a feasible task for an e-puck.

    Attributes:
        world: The world, with its e-puck at the start, and its goal.
        path: Shape (n, 2): points of the shortest path of the raster that has only
            pixels in blocks, m. It may cut turned blocks by some mm.
        difficulty: How hard it is; its `length` is in m. The gap is at most the true
            one, and `length` and `steps` are at most the true ones.
        rejected: Reasons of the drafts that were drawn before it.
        raster: The same as a map of pixels in blocks, of 5 mm.
    """

    world: World
    path: NDArray[np.float64]
    difficulty: Difficulty
    rejected: tuple[Rejection, ...]
    raster: LadderWorld
    barn_steps: ClassVar[None] = None

    @property
    def start(self) -> Pose:
        """Pose, m and rad."""
        return Pose(*self.world.robots[0].pose)

    @property
    def goal(self) -> tuple[float, float]:
        """Point (x, y), m."""
        assert self.world.goal is not None
        return self.world.goal


def make_plates(spec: PlatesSpec, key: bytes) -> PlatesWorld:
    """Makes a world for an e-puck.

    Args:
        spec: What it is like.
        key: 32 bytes, from `world_key`. All that is random follows from it.

    Raises:
        TaskError: None of the drafts fulfils the conditions.
        ValueError: The key has another length.
    """
    random = RandomStream(key)

    def attempt() -> tuple[PlatesDraft, Admitted] | Rejection:
        draft = draw(random, spec.generator)
        found = _admitted(draft, random, spec)
        return found if isinstance(found, Rejection) else (draft, found)

    made, rejected = first_admitted(spec.tries, spec.generator.name, attempt)
    return _made(*made, random, rejected)


def _admitted(
    draft: PlatesDraft, random: RandomStream, spec: PlatesSpec
) -> Admitted | Rejection:
    """Tests lengths on the pixels within blocks, and the gap on all that they touch."""
    blocks = (*draft.plates, *draft.things)
    inner, outer = (raster(draft.columns, draft.rows, blocks, t) for t in (False, True))
    found = admit(WorldDraft(inner, draft.places, outer), random, spec.conditions)
    if isinstance(found, Rejection):
        return found
    if found.difficulty.steps * spec.dt > spec.max_seconds:
        return Rejection.LONG
    return found


def _made(
    draft: PlatesDraft,
    found: Admitted,
    random: RandomStream,
    rejected: tuple[Rejection, ...],
) -> PlatesWorld:
    xs, ys = centres(draft.columns) / 1000, centres(draft.rows) / 1000
    start, goal = ((float(xs[i]), float(ys[j])) for i, j in (found.start, found.goal))
    heading = random.uniform(-math.pi, math.pi)
    sides = draft.columns * PIXEL / 1000, draft.rows * PIXEL / 1000
    floor = Rectangle(0.0, 0.0, 0.0, *sides)
    world = World(
        robots=(EPuck("e-puck", *start, heading),),
        goal=goal,
        arenas=(Arena(floor, _WALL, _HEIGHT),),
        obstacles=(
            *(_obstacle("plate", k, block) for k, block in enumerate(draft.plates)),
            *(_obstacle("thing", k, block) for k, block in enumerate(draft.things)),
        ),
    )
    path = found.path * _PIXEL + (xs[0], ys[0])
    length = found.difficulty.length * _PIXEL
    difficulty = replace(found.difficulty, length=length)
    return PlatesWorld(
        world, path, difficulty, rejected, LadderWorld.of(found, heading)
    )


def _obstacle(name: str, number: int, block: Block) -> Obstacle:
    """A fixed block that a body can hit and the sensors see."""
    shape = block.shape
    parts = (Part(shape, 0.0, _HEIGHT),)
    return Obstacle(f"{name} {number}", "Solid", shape.x, shape.y, parts, parts)
