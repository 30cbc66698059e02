"""A world with data precomputed for an e-puck."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_envs.epuck.gaps import clear_grid, nearest_gap
from tdac_envs.epuck.prisms import FIXED, Owned, Prisms
from tdac_envs.worlds.bodies import (
    at_body_height,
    bodies,
    floor_under,
    material_under,
)
from tdac_envs.worlds.footprint import Rectangle, frame
from tdac_envs.worlds.materials import MATERIAL, friction_between
from tdac_envs.worlds.world import Obstacle, Part, World

Point = tuple[float, float]
Bounds = tuple[float, float, float, float]

SPACING = 0.005
"""Spacing of the path-planning grid, m, in worlds of up to 25 m²."""
MOST_POINTS = 1_000_000
_OPEN = 0.5
"""Margin around the objects of a world without walls, m."""
_FENCE = 0.1
_WIDEST = 0.1
"""Clearances are capped at this distance, m."""


class Frictions(NamedTuple):
    """Coulomb friction coefficients of a world whose objects can be pushed.

    Attributes:
        tyres: Of the robot's tyres on the ground.
        sliding: Shape (k,): of each object on the ground.
        touching: Shape (k + 1, k + 1): between objects; the last row and column are
            the robot's body and everything fixed.
    """

    tyres: float
    sliding: NDArray[np.float64]
    touching: NDArray[np.float64]

    @classmethod
    def of(cls, world: World, pushable: Iterable[Obstacle]) -> Frictions:
        """The frictions of the objects that can be pushed in a world."""
        names = [*(thing.material for thing in pushable), MATERIAL]
        between = partial(friction_between, world.contacts)
        ground = [between(name, material_under(world)) for name in names]
        touching = [[between(one, other) for other in names] for one in names]
        return cls(ground[-1], np.array(ground[:-1]), np.array(touching))


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """A world and data computed from it.

    Attributes:
        world: The world.
        floor: Height of the ground under the robot, m.
        things: Obstacles, walls and other robots; see `bodies`.
        solid: Parts that the body can hit, with a fence around the world.
        bounds: (left, low, right, high) inside the fence, m.
        spacing: Distance between grid points, m.
        clear: Shape (height, width): distance from each grid point to the nearest solid
            part, at most 0.1 m; `clear[v, u]` is at left + u spacing, low + v spacing.
        centres: Shape (k, 2): initial centres of the objects that can be pushed, m.
        masses: Shape (k,): masses of these objects, kg.
        frictions: Friction of these objects and of the robot.
    """

    world: World
    floor: float
    things: tuple[Obstacle, ...]
    solid: Prisms
    bounds: Bounds
    spacing: float
    clear: NDArray[np.float64]
    centres: NDArray[np.float64]
    masses: NDArray[np.float64]
    frictions: Frictions

    def __reduce__(self) -> tuple[Any, ...]:
        return Ground.of, (self.world,)

    @classmethod
    def of(cls, world: World) -> Ground:
        """The ground of a world, from a cache of the last few worlds."""
        return _ground(world)

    def visible(self, webots: bool, goal_mark: bool) -> Prisms:
        """The parts that the sensors see.

        Args:
            webots: Whether to use Webots' reflectance of each object instead of 1.
            goal_mark: Whether to include a goal marker that is not solid.
        """
        seen = [t for t in self.things if goal_mark or t.solid or not t.is_goal]
        owners = _owners(self.things)
        return Prisms.of(
            Owned(part, owners.get(id(t), FIXED), t.reflectance if webots else 1.0)
            for t in seen
            for part in t.visible
        )

    def gap(self, x: float, y: float) -> float:
        """Distance from a point to the nearest solid part, m; negative inside."""
        return nearest_gap(*self.solid.arrays(), float(x), float(y))

    def at(self, column: int, row: int) -> Point:
        """Position of a grid point, m."""
        left, low, _, _ = self.bounds
        return left + column * self.spacing, low + row * self.spacing

    def free(self, radius: float) -> NDArray[np.bool_]:
        """Grid points where a disc fits, shape (height, width), bool.

        It also fits on the straight line between two neighbouring ones.
        """
        return np.asarray(self.clear >= math.hypot(radius, self.spacing / 2**0.5))


@lru_cache(maxsize=4)
def _ground(world: World) -> Ground:
    floor, things = floor_under(world), bodies(world)
    bounds = _bounds(world, things)
    owners = _owners(things)
    owned = [
        Owned(part, owners.get(id(thing), FIXED))
        for thing in things
        for part in at_body_height(thing.solid, floor)
    ]
    owned += [Owned(Part(wall, floor, floor + 1.0)) for wall in fence(bounds)]
    solid = Prisms.of(owned)
    spacing, clear = _clearances(solid, bounds)
    for array in (solid.points, solid.extent, clear):
        array.flags.writeable = False
    pushable = [thing for thing in things if id(thing) in owners]
    centres = np.array([_middle(thing) for thing in pushable]).reshape(-1, 2)
    masses = np.array([thing.mass for thing in pushable], np.float64)
    frictions = Frictions.of(world, pushable)
    return Ground(
        world, floor, things, solid, bounds, spacing, clear, centres, masses, frictions
    )


def _owners(things: tuple[Obstacle, ...]) -> dict[int, int]:
    """Indices of the objects that can be pushed, by `id`."""
    pushable = [t for t in things if t.mass is not None and t.solid]
    return {id(thing): number for number, thing in enumerate(pushable)}


def _middle(thing: Obstacle) -> Point:
    """Centre of area of an object's solid parts."""
    areas = [part.shape.area for part in thing.solid]
    centres = np.array([_centre(part) for part in thing.solid])
    x, y = np.average(centres, axis=0, weights=areas).tolist()
    return x, y


def _centre(part: Part) -> Point:
    left, low, right, high = part.shape.bounds
    return (left + right) / 2, (low + high) / 2


def _bounds(world: World, things: tuple[Obstacle, ...]) -> Bounds:
    """Bounds of the arena that contains robot and goal, else of the whole world."""
    points = [(robot.x, robot.y) for robot in world.robots[:1]]
    points += [world.goal] if world.goal else []
    arena = world.arena
    if arena is not None and all(arena.inside.contains(*point) for point in points):
        left, low, right, high = arena.inside.bounds
        edge = arena.wall_thickness + 0.01
        return left - edge, low - edge, right + edge, high + edge
    edges = [part.shape.bounds for thing in things for part in thing.solid]
    edges += [arena.inside.bounds for arena in world.arenas]
    edges += [(x, y, x, y) for x, y in points]
    box = np.array(edges or [(0.0, 0.0, 0.0, 0.0)])
    left, low = (box[:, :2].min(axis=0) - _OPEN).tolist()
    right, high = (box[:, 2:].max(axis=0) + _OPEN).tolist()
    return left, low, right, high


def fence(bounds: Bounds) -> list[Any]:
    """Footprints of the four walls around a world, which no sensor sees."""
    left, low, right, high = bounds
    inside = Rectangle(
        (left + right) / 2, (low + high) / 2, 0.0, right - left, high - low
    )
    return list(frame(inside, _FENCE))


def _clearances(solid: Prisms, bounds: Bounds) -> tuple[float, NDArray[np.float64]]:
    """Spacing of the grid, and the clearance at each of its points."""
    left, low, right, high = bounds
    width, height = right - left, high - low
    spacing = max(SPACING, math.sqrt(width * height / MOST_POINTS))
    shape = (math.floor(height / spacing) + 1, math.floor(width / spacing) + 1)
    clear = np.full(shape, _WIDEST)
    clear_grid(*solid.arrays(), left, low, spacing, clear)
    return spacing, clear
