"""A world as an e-puck has it under its wheels, and the body's ways over it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.bodies import BODY_RADIUS, at_body_height, bodies, floor_under
from tdac_envs.epuck.contact import clear_grid, first_touch, nearest_gap
from tdac_envs.epuck.infrared import sees
from tdac_envs.epuck.prisms import FIXED, Owned, Prisms
from tdac_envs.errors import TaskError
from tdac_envs.footprint import Rectangle, frame
from tdac_envs.plan import Path, descend, distance_field
from tdac_envs.world import Obstacle, Part, World

Point = tuple[float, float]
Bounds = tuple[float, float, float, float]

SPACING = 0.005
"""Of the grid on which paths are planned, m, in worlds of up to 25 m²."""
MOST_POINTS = 1_000_000
_OPEN = 0.5
"""How far around its things a world without walls goes on, m."""
_FENCE = 0.1
_WIDEST = 0.1
"""Clearances are known up to this, m."""


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """A world and what is computed from it once.

    Attributes:
        world: The world.
        floor: Height of the ground under the robot, m.
        things: What may be in the way; see `bodies`.
        solid: What the body can hit, and a fence around the whole.
        bounds: (left, low, right, high) inside the fence, m.
        spacing: Of the grid points, m.
        clear: Shape (height, width): distance from grid point (u, v), which is at
            (left + u spacing, low + v spacing), to what is solid, up to 0.1 m.
        centres: Shape (k, 2): where the things are that can be pushed.
        masses: Shape (k,), kg.
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

    def __reduce__(self) -> tuple[Any, ...]:
        return Ground.of, (self.world,)

    @classmethod
    def of(cls, world: World) -> Ground:
        """The ground of a world; equal worlds share the one used last."""
        return _ground(world)

    def visible(self, webots: bool, goal_mark: bool) -> Prisms:
        """What the sensors see.

        Args:
            webots: With the reflectance that Webots gives each thing; else 1.
            goal_mark: Also a mark of the goal that is not solid.
        """
        seen = [t for t in self.things if goal_mark or t.solid or not t.is_goal]
        owners = _owners(self.things)
        return Prisms.of(
            Owned(part, owners.get(id(t), FIXED), t.reflectance if webots else 1.0)
            for t in seen
            for part in t.visible
        )

    def gap(self, x: float, y: float) -> float:
        """Distance from a point to what is solid, m; negative within it."""
        solid = self.solid
        return nearest_gap(solid.points, solid.first, solid.extent, x, y)

    def at(self, column: int, row: int) -> Point:
        """A grid point's place."""
        left, low, _, _ = self.bounds
        return left + column * self.spacing, low + row * self.spacing

    def free(self, radius: float) -> NDArray[np.bool_]:
        """Grid points from which a disc may step to a free neighbour.

        Between two such points it stays `radius` away from everything; see
        `grid.body_free`.
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
    owned += [Owned(Part(wall, floor, floor + 1.0)) for wall in _fence(bounds)]
    solid = Prisms.of(owned)
    spacing, clear = _clearances(solid, bounds)
    for array in (solid.points, solid.extent, clear):
        array.flags.writeable = False
    pushable = [thing for thing in things if id(thing) in owners]
    centres = np.array([_middle(thing) for thing in pushable]).reshape(-1, 2)
    masses = np.array([thing.mass for thing in pushable], np.float64)
    return Ground(world, floor, things, solid, bounds, spacing, clear, centres, masses)


def _owners(things: tuple[Obstacle, ...]) -> dict[int, int]:
    """Numbers of the things that can be pushed, by identity."""
    pushable = [t for t in things if t.mass is not None and t.solid]
    return {id(thing): number for number, thing in enumerate(pushable)}


def _middle(thing: Obstacle) -> Point:
    """Centre of area of a thing's parts."""
    areas = [part.shape.area for part in thing.solid]
    centres = np.array([_centre(part) for part in thing.solid])
    x, y = np.average(centres, axis=0, weights=areas).tolist()
    return x, y


def _centre(part: Part) -> Point:
    left, low, right, high = part.shape.bounds
    return (left + right) / 2, (low + high) / 2


def _bounds(world: World, things: tuple[Obstacle, ...]) -> Bounds:
    """Around the robot's arena, or where there is none, around everything."""
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


def _fence(bounds: Bounds) -> list[Any]:
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
    clear_grid(solid.points, solid.first, solid.extent, left, low, spacing, clear)
    return spacing, clear


def at_goal(ground: Ground, goal: Point, tolerance: float, x: float, y: float) -> bool:
    """Whether (x, y) is within the tolerance and nothing solid is in between."""
    gap, solid = math.hypot(goal[0] - x, goal[1] - y), ground.solid
    if gap > tolerance:
        return False
    return gap < ground.gap(x, y) or sees(
        solid.points, solid.first, solid.extent, x, y, *goal
    )


def check_stands(ground: Ground, name: str, x: float, y: float) -> None:
    """Refuses a place, called `name`, where an e-puck cannot stand.

    Raises:
        TaskError: It is outside, in an obstacle or too near to one; says what is near.
    """
    point = f"{name} ({x:g}, {y:g})"
    left, low, right, high = ground.bounds
    if not (left <= x <= right and low <= y <= high):
        raise TaskError(
            f"{point} lies outside the world, which reaches from ({left:.2f}, "
            f"{low:.2f}) to ({right:.2f}, {high:.2f})"
        )
    room = ground.gap(x, y)
    if room >= BODY_RADIUS:
        return
    problem = "lies in an obstacle"
    if room > 0.0:
        problem = (
            f"is {1e3 * room:.1f} mm from an obstacle, too near for a body of "
            f"{1e3 * BODY_RADIUS:g} mm"
        )
    raise TaskError(f"{point} {problem}; {_nearest_place(ground, x, y)}")


def _nearest_place(ground: Ground, x: float, y: float) -> str:
    rows, columns = np.nonzero(ground.free(BODY_RADIUS))
    if rows.size == 0:
        return "an e-puck fits nowhere"
    left, low, _, _ = ground.bounds
    u, v = (x - left) / ground.spacing, (y - low) / ground.spacing
    nearest = int(np.argmin((columns - u) ** 2 + (rows - v) ** 2))
    near_x, near_y = ground.at(int(columns[nearest]), int(rows[nearest]))
    return f"the nearest free place is ({near_x:.3f}, {near_y:.3f})"


def entry(
    ground: Ground, open_: NDArray[np.bool_], at: Point
) -> tuple[int, int] | None:
    """The nearest grid point (column, row) to which the body gets straight on.

    Args:
        ground: The ground.
        open_: Shape (height, width): which grid points come into question.
        at: Where it is.
    """
    for column, row in _near(ground, at):
        if open_[row, column] and _may_hop(ground, at, ground.at(column, row)):
            return column, row
    return None


def _near(ground: Ground, at: Point) -> Iterator[tuple[int, int]]:
    """Grid points within 3 of a place, the nearest first."""
    left, low, _, _ = ground.bounds
    u, v = (at[0] - left) / ground.spacing, (at[1] - low) / ground.spacing
    height, width = ground.clear.shape
    column, row = round(u), round(v)
    found = [
        (math.hypot(i - u, j - v), i, j)
        for j in range(max(row - 3, 0), min(row + 4, height))
        for i in range(max(column - 3, 0), min(column + 4, width))
    ]
    for _, i, j in sorted(found):
        yield i, j


def _may_hop(ground: Ground, begin: Point, end: Point) -> bool:
    """Whether the body touches nothing on the straight line between two points."""
    solid = ground.solid
    heading = math.atan2(end[1] - begin[1], end[0] - begin[0])
    touch = first_touch(
        solid.points, solid.first, solid.extent, *begin, heading,
        math.dist(begin, end), 0.0, BODY_RADIUS,
    )  # fmt: skip
    return touch > 1.0


def route(ground: Ground, start: Point, goal: Point) -> NDArray[np.float32]:
    """Length of the shortest path to the goal from each grid point, m.

    Paths lead along the grid in eight directions: they are at most 8.3 % longer than
    the shortest of all, and 5 % in the mean, but for some mm at corners.

    Returns:
        Shape (height, width), float32, read-only; inf where there is no path.

    Raises:
        TaskError: The body cannot get from start to goal; says how wide one could be.
    """
    end = entry(ground, ground.free(BODY_RADIUS), goal)
    if end is not None:
        field = field_to(ground, end)
        if entry(ground, np.isfinite(field), start) is not None:
            return field
    widest = widest_body(ground, start, goal)
    reason = f"the widest body that gets through has a radius of {1e3 * widest:.1f} mm"
    if widest <= 0.0:
        reason = "they are in separate rooms"
    raise TaskError(
        f"no free path for a body of {1e3 * BODY_RADIUS:g} mm from start "
        f"({start[0]:g}, {start[1]:g}) to goal ({goal[0]:g}, {goal[1]:g}): {reason}"
    )


@lru_cache(maxsize=4)
def field_to(ground: Ground, goal: tuple[int, int]) -> NDArray[np.float32]:
    """Length of the shortest path to a grid point (column, row); as of `route`."""
    steps = distance_field(ground.free(BODY_RADIUS), goal)
    field = (steps * ground.spacing).astype(np.float32)
    field.flags.writeable = False
    return field


def path_down(ground: Ground, field: NDArray[np.float32], start: Point) -> Path:
    """The path from a place down a field of `route`, shape (n, 2), m.

    It ends at the field's grid point; empty where there is none.
    """
    begin = entry(ground, np.isfinite(field), start)
    if begin is None:
        return np.empty((0, 2))
    steps = np.asarray(field, np.float64) / ground.spacing
    path = descend(ground.free(BODY_RADIUS), _exact(steps), begin)
    return np.vstack([start, path * ground.spacing + ground.bounds[:2]])


def _exact(steps: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(steps < 1e-6, 0.0, steps)


def widest_body(ground: Ground, start: Point, goal: Point) -> float:
    """Radius of the largest disc, m, that gets from start to goal; 0 if none does.

    To the spacing of the grid.
    """
    ends = [next(_near(ground, point))[::-1] for point in (start, goal)]
    low, high = 0.0, float(min(ground.clear[end] for end in ends))

    def joined(radius: float) -> bool:
        free = (ground.clear > radius).astype(np.uint8)
        _, labels = cv2.connectedComponents(free, connectivity=4)
        return bool(labels[ends[0]] == labels[ends[1]] != 0)

    if not joined(0.0):
        return 0.0
    while high - low > 1e-4:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if joined(middle) else (low, middle)
    return low
