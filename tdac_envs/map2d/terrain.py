"""A map with precomputed data, and the shortest paths of a body on it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, read_only
from tdac_envs.core.errors import TaskError, offer
from tdac_envs.grid.grid import (
    FloatGrid,
    OccupancyGrid,
    body_free,
    clearance,
    clearance_at,
)
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.grid.pieces import end_outside, nearest_free
from tdac_envs.grid.plan import distance_field
from tdac_envs.map2d.contact import first_contact, has_room
from tdac_envs.map2d.kernels import path_distance
from tdac_envs.map2d.rays import LeapGrid, in_sight, leaps_of, sees

Point = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Terrain:
    """A grid and data computed from it; read-only, 9 bytes per pixel.

    Attributes:
        grid: The map.
        clear: Shape (height, width), float32, from `grid.clearance`, px.
        padded_clear: `clear` with a border of zeros, for the kernels.
        leaps: Shape (4, height + 2, width + 2), uint8, from `rays.leaps_of`.
    """

    grid: OccupancyGrid
    clear: FloatGrid
    padded_clear: FloatGrid
    leaps: LeapGrid

    def __reduce__(self) -> tuple[Any, ...]:
        return Terrain.of, (self.grid,)

    @classmethod
    def of(cls, grid: OccupancyGrid) -> Terrain:
        """The terrain of a grid, from a cache of the last few grids."""
        return _terrain(grid)


# A process often loads the same map several times.
@lru_cache(maxsize=4)
def _terrain(grid: OccupancyGrid) -> Terrain:
    padded_clear = read_only(np.pad(clearance(grid.cells), 1))
    leaps = leaps_of(grid.cells)
    return Terrain(grid, padded_clear[1:-1, 1:-1], padded_clear, leaps)


def at_goal(
    terrain: Terrain, goal: Point, tolerance: float, x: float, y: float
) -> bool:
    """Whether (x, y) is within the tolerance of the goal with no wall in between."""
    if math.hypot(goal[0] - x, goal[1] - y) > tolerance:
        return False
    return bool(sees(terrain.leaps, *map(float, (x, y, *goal))))


def _near(x: float, y: float, shape: tuple[int, ...]) -> Iterator[tuple[int, int]]:
    """The pixels (i, j) at most 2 columns and 2 rows away from a point."""
    column, row = math.floor(x + 0.5), math.floor(y + 0.5)
    for j in range(max(row - 2, 0), min(row + 3, shape[0])):
        for i in range(max(column - 2, 0), min(column + 3, shape[1])):
            yield i, j


def path_entry(
    terrain: Terrain, field: NDArray[np.float32], x: float, y: float, radius: float
) -> tuple[int, int] | None:
    """The first pixel of the shortest path from (x, y), or None if there is no path.

    The body can drive from (x, y) to this pixel in a straight line.
    """
    # The pixels around the point have priority, as in `path_distance`.
    found = [
        (
            max(abs(i - x), abs(j - y)) >= 1,
            field[j, i] + math.dist((x, y), (i, j)),
            i,
            j,
        )
        for i, j in _near(x, y, field.shape)
        if field[j, i] < math.inf
    ]
    for _, _, i, j in sorted(found):
        if _is_free_line(terrain, (x, y), (i, j), radius):
            return i, j
    return None


def _is_free_line(
    terrain: Terrain,
    begin: Point,
    end: Point,
    radius: float,
) -> bool:
    """Whether the body touches nothing on the line between two nearby points."""
    touch = first_contact(
        terrain.padded_clear,
        float(begin[0]),
        float(begin[1]),
        math.atan2(end[1] - begin[1], end[0] - begin[0]),
        math.dist(begin, end),
        0.0,
        float(radius),
    )
    return bool(touch > 1.0)


def check_body_fits(
    terrain: Terrain,
    name: str,
    x: float,
    y: float,
    radius: float,
    units: MapUnits = PIXELS,
) -> None:
    """Checks that a disc of `radius` px fits at (x, y), the point called `name`.

    Raises:
        TaskError: The point is outside the map, in an obstacle or too near to one; the
            message begins with the nearest free pixel.
    """
    grid = terrain.grid
    point = f"{name} {units.point(x, y)}"
    if not (-0.5 <= x < grid.width - 0.5 and -0.5 <= y < grid.height - 0.5):
        extent = f"{grid.width} x {grid.height} px"
        if units != PIXELS:
            extent = f"{units.length(grid.width)} x {units.length(grid.height)}"
        raise TaskError(f"{point} lies outside the map of {extent}")
    if grid.is_occupied(x, y):
        problem = "lies in an obstacle"
    elif (room := clearance_at(grid.cells, x, y, radius)) < radius:
        problem = (
            f"is {units.length(room, 1)} from a wall, too near for a body of "
            f"{units.length(radius)} radius"
        )
    else:
        return
    problem = f"{point} {problem}"
    nearest = nearest_free(body_free(terrain.clear, radius), x, y)
    if nearest is None:
        raise TaskError(
            f"{problem}; the body fits nowhere; the largest clearance is "
            f"{units.length(float(terrain.clear.max()), 1)}"
        )
    place, which = units.point(*nearest), f"the nearest free {units.place}"
    raise TaskError(offer(name, place, which, problem))


@kernel
def may_start(
    clear: FloatGrid,
    leaps: LeapGrid,
    field: NDArray[np.float32],
    x: float,
    y: float,
    radius: float,
    goal_x: float,
    goal_y: float,
    tolerance: float,
) -> bool:
    """Whether an episode may start at (x, y).

    The body must fit there, must not be at the goal yet, and must have a path to it.

    Args:
        clear: `Terrain.padded_clear`.
        leaps: `Terrain.leaps`.
        field: From `field_to`.
        x: Column, px.
        y: Row, px.
        radius: Radius of the body, px.
        goal_x: Column of the goal, px.
        goal_y: Row of the goal, px.
        tolerance: Distance at which the goal is reached, px.
    """
    body = math.sqrt(radius * radius + 0.5)
    if not has_room(clear, x, y, body):
        return False
    near = math.hypot(goal_x - x, goal_y - y) <= tolerance
    if near and in_sight(leaps, x, y, goal_x, goal_y):
        return False
    height, width = field.shape
    column, row = math.floor(x + 0.5), math.floor(y + 0.5)
    for j in range(max(row - 2, 0), min(row + 3, height)):
        for i in range(max(column - 2, 0), min(column + 3, width)):
            if field[j, i] < math.inf:
                length, bearing = math.hypot(i - x, j - y), math.atan2(j - y, i - x)
                if first_contact(clear, x, y, bearing, length, 0.0, radius) > 1.0:
                    return True
    return False


def route(
    terrain: Terrain,
    start: Point,
    goal: Point,
    radius: float,
    units: MapUnits = PIXELS,
) -> NDArray[np.float32]:
    """Length of the shortest path to the goal from each pixel; see `field_to`.

    Raises:
        TaskError: No path joins start and goal; the message gives the largest radius
            for which there is one.
    """
    free = body_free(terrain.clear, radius)
    # The pixel under a goal in a tight place may itself be too near to a wall.
    near = [(math.dist(goal, pixel), *pixel) for pixel in _near(*goal, free.shape)]
    for _, i, j in sorted(near):
        if free[j, i] and _is_free_line(terrain, goal, (i, j), radius):
            field = _shared_field(terrain, (i, j), radius)
            if path_entry(terrain, field, *start, radius) is not None:
                return field
            break
    widest = widest_connected_radius(terrain.clear, start, goal)
    radius_text = units.at_most(widest) if units != PIXELS else f"{widest:.1f} px"
    reason = f"the widest body that gets through has a radius of {radius_text}"
    if widest <= 0.0:
        reason = _apart(terrain, start, goal)
    raise TaskError(
        f"no free path for a body of {units.length(radius)} radius from start "
        f"{units.point(*start)} to goal {units.point(*goal)}: {reason}"
    )


def _apart(terrain: Terrain, start: Point, goal: Point) -> str:
    """Why no body at all gets from start to goal."""
    first, last = ((math.floor(x + 0.5), math.floor(y + 0.5)) for x, y in (start, goal))
    beyond = end_outside(terrain.grid.cells, first, last)
    if beyond is None:
        return "they are in separate rooms"
    other = "goal" if beyond == "start" else "start"
    return f"the {beyond} lies outside of the closed wall around the {other}"


def field_to(
    terrain: Terrain, goal: tuple[int, int], radius: float
) -> NDArray[np.float32]:
    """Lengths of the shortest paths for a disc of `radius` px to a pixel (x, y).

    Returns:
        Shape (height, width), float32, px, read-only; inf if there is no path.
    """
    free = body_free(terrain.clear, radius)
    return read_only(distance_field(free, goal), np.float32)


_shared_field = lru_cache(maxsize=4)(field_to)


def path_length_from(
    terrain: Terrain, field: NDArray[np.float32], x: float, y: float
) -> float:
    """Length of the shortest path from a point, px, given a field of `field_to`."""
    return float(path_distance(terrain.leaps, field, float(x), float(y), math.inf))


def widest_connected_radius(clear: FloatGrid, start: Point, goal: Point) -> float:
    """Radius of the largest disc that can move from start to goal, px; 0 if none can.

    Found by bisection over the connected components of the clearance.
    """
    ends = [(math.floor(y + 0.5), math.floor(x + 0.5)) for x, y in (start, goal)]
    low, high = 0.0, float(min(clear[ends[0]], clear[ends[1]]))

    def joined(radius: float) -> bool:
        free = body_free(clear, radius).astype(np.uint8)
        _, labels = cv2.connectedComponents(free, connectivity=4)
        return bool(labels[ends[0]] == labels[ends[1]] != 0)

    if not joined(0.0):
        return 0.0
    while high - low > 0.05:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if joined(middle) else (low, middle)
    return low
