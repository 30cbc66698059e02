"""Reference routes to a goal, and the next waypoint from any position."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tdac_envs.core.addresses import Addresses, Words, block, line, plane
from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.epuck.ground import Ground
from tdac_envs.grid.grid import BoolGrid, body_free
from tdac_envs.grid.plan import distance_field
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.map2d.terrain import Terrain

if TYPE_CHECKING:
    from tdac_envs.epuck.task import EPuckTask

Lengths = NDArray[np.float32]

MARGINS = (0.5, 0.25, 0.1)
"""Margins around the body that a route may keep, in body radii, widest first."""
REACH = 0.6
"""Distance of the next waypoint along the route, in body radii.

A robot that drives straight to a waypoint cuts corners, more so the farther ahead it
is; at this distance the body does not touch walls on any bundled map or world.
"""
# Largest ratio of the length of a route with a margin to that of the shortest path.
_DETOUR = 1.25
_SQRT2 = 2.0**0.5
# Distance from the goal within which its routes should end, grid points.
_BESIDE = 4


@dataclass(frozen=True, slots=True, eq=False)
class GuidedRoute:
    """Routes to a goal from all points of a map or a world.

    A route follows the shortest path for the body until there is room for a margin,
    then the shortest path that keeps this margin.

    Attributes:
        goal: Point (x, y), px or m.
        reach: Distance of a waypoint along the route, px or m.
        roomy: Shape (height, width), float32: length of the path with the margin from
            each grid point, in grid spacings; inf where there is none.
        shortest: The same for the shortest path.
        frame: x and y of the first grid point, and the grid spacing.
    """

    goal: tuple[float, float]
    reach: float
    roomy: Lengths
    shortest: Lengths
    frame: tuple[float, float, float]

    def ahead(self, places: ArrayLike) -> NDArray[np.float64]:
        """The next waypoint from each point.

        Args:
            places: Points or poses, shape (n, 2) or (n, 3).

        Returns:
            Shape (n, 2): points `reach` further along the route, or the goal if it is
            nearer or there is no route nearby.
        """
        left, low, spacing = self.frame
        points = np.asarray(places, np.float64)[:, :2]
        cells = np.ascontiguousarray((points - (left, low)) / spacing)
        found = np.empty_like(cells)
        routes = Addresses([(self.roomy, self.shortest)] * len(cells))
        reaches = np.full(len(cells), self.reach / spacing)
        batch = Addresses([(routes.words, cells, reaches, found)])
        look_ahead(batch.words[0], np.arange(len(cells)))
        at = found * spacing + (left, low)
        return np.where(np.isfinite(found), at, self.goal)


def route_to_goal(task: Map2DTask | EPuckTask, reach: float = REACH) -> GuidedRoute:
    """The reference route of a task.

    Its margin is the widest of `MARGINS` for which the route from the task's start is
    not much longer than the shortest path.

    Args:
        task: Task with map or world, body, start and goal.
        reach: Distance of the waypoints along the route, in body radii.
    """
    if isinstance(task, Map2DTask):
        place: Terrain | Ground = task.terrain
        frame = (0.0, 0.0, 1.0)
    else:
        place = task.ground
        frame = (*task.ground.bounds[:2], task.ground.spacing)
    spacing, radius = frame[2], task.body_radius
    shortest = _in_spacings(task.field, spacing)
    goal = _goal_cell(shortest, [(task.goal[k] - frame[k]) / spacing for k in (0, 1)])
    start = [(task.start[k] - frame[k]) / spacing for k in (0, 1)]
    roomy = shortest
    for margin in MARGINS:
        wide = _roomy(place, goal, radius, margin)
        if _length(wide, start, radius / spacing) <= _DETOUR * task.shortest / spacing:
            roomy = wide
            break
    return GuidedRoute(task.goal, reach * radius, roomy, shortest, frame)


def _in_spacings(field: Lengths, spacing: float) -> Lengths:
    return field if spacing == 1.0 else np.asarray(field / spacing, np.float32)


def _goal_cell(shortest: Lengths, at: Sequence[float]) -> tuple[int, int]:
    """Column and row of the grid point where routes end, if possible near a point."""
    top, left = (max(round(at[k]) - _BESIDE, 0) for k in (1, 0))
    part = shortest[top : top + 2 * _BESIDE + 1, left : left + 2 * _BESIDE + 1]
    if not part.size or part.min() > 0.0:
        top, left, part = 0, 0, shortest
    row, column = np.unravel_index(int(np.argmin(part)), part.shape)
    return left + int(column), top + int(row)


def _free(place: Terrain | Ground, radius: float) -> BoolGrid:
    if isinstance(place, Ground):
        return place.free(radius)
    return body_free(place.clear, radius)


# Cached, since episodes differ in their starts, but seldom in their goals.
@lru_cache(maxsize=8)
def _roomy(
    place: Terrain | Ground, goal: tuple[int, int], radius: float, margin: float
) -> Lengths:
    """Length of the path with a margin from each grid point, in spacings."""
    spacing = place.spacing if isinstance(place, Ground) else 1.0
    wide = radius * (1.0 + margin)
    free = _free(place, wide).copy()
    # No margin near the goal, which may be in a corner.
    reach, (column, row) = math.ceil(wide / spacing) + 2, goal
    near = np.s_[
        max(row - reach, 0) : row + reach + 1,
        max(column - reach, 0) : column + reach + 1,
    ]
    free[near] = _free(place, radius)[near]
    field = distance_field(free, goal).astype(np.float32)
    field.flags.writeable = False
    return field


def _length(field: Lengths, at: Any, far: float) -> float:
    """The shortest length from a point to the goal through a nearby grid point."""
    column, row, reach = round(at[0]), round(at[1]), math.ceil(far) + 1
    top, left = max(row - reach, 0), max(column - reach, 0)
    part = field[top : row + reach + 1, left : column + reach + 1]
    rows, columns = np.indices(part.shape)
    hops = np.hypot(columns + left - at[0], rows + top - at[1])
    return float((part + hops).min(initial=math.inf))


@subkernel
def _entry(shortest: Lengths, column: float, row: float) -> tuple[int, int, float]:
    """Column, row and distance of the nearest grid point with a route; -1, -1, inf."""
    height, width = shortest.shape
    x, y, best = -1, -1, math.inf
    at_x, at_y = round(column), round(row)
    # The body may be slightly off the points with a route.
    for j in range(max(at_y - 3, 0), min(at_y + 4, height)):
        for i in range(max(at_x - 3, 0), min(at_x + 4, width)):
            hop = math.hypot(i - column, j - row)
            if shortest[j, i] < math.inf and hop < best:
                best, x, y = hop, i, j
    return x, y, best


@subkernel
def _next(field: Lengths, x: int, y: int) -> tuple[int, int, float]:
    """The next grid point down a field, and the length of the step; 0 at the goal."""
    height, width = field.shape
    least, to_x, to_y, step = math.inf, x, y, 0.0
    for j in range(max(y - 1, 0), min(y + 2, height)):
        for i in range(max(x - 1, 0), min(x + 2, width)):
            straight = i == x or j == y
            # A diagonal step may not cut a corner.
            if straight or (field[y, i] < math.inf and field[j, x] < math.inf):
                length = 1.0 if straight else _SQRT2
                if field[j, i] < field[y, x] and field[j, i] + length < least:
                    least, to_x, to_y, step = field[j, i] + length, i, j, length
    return to_x, to_y, step


@subkernel
def _look_ahead(
    roomy: Lengths,
    shortest: Lengths,
    place: NDArray[np.float64],
    reach: float,
    found: NDArray[np.float64],
) -> None:
    """Finds the next waypoint from a point; all lengths in grid spacings.

    Args:
        roomy: See `GuidedRoute`.
        shortest: See `GuidedRoute`.
        place: Shape (2,), fractional column and row.
        reach: Distance of the waypoint along the route.
        found: Shape (2,), overwritten with a grid point; inf for the goal itself.
    """
    found[0] = found[1] = math.inf
    x, y, gone = _entry(shortest, place[0], place[1])
    step = 1.0
    while gone < reach and step > 0.0:
        if roomy[y, x] < math.inf:
            x, y, step = _next(roomy, x, y)
        else:
            x, y, step = _next(shortest, x, y)
        gone += step
    if gone < math.inf and step > 0.0:
        found[0], found[1] = x, y


@kernel
def look_ahead(batch: Words, rows: Words) -> None:
    """Finds the next waypoints of many robots, each on its own route.

    Args:
        batch: A row of `tdac_envs.core.addresses.Addresses` of four arrays: the
            `words` of `roomy` and `shortest` of each robot's route, shape (n, 2, 4);
            points, shape (n, 2), fractional columns and rows; reaches, shape (n,), in
            spacings; waypoints, shape (n, 2), overwritten with grid points, inf for the
            goal itself.
        rows: Indices of the robots, shape (k,).
    """
    words, places = block(batch[0], np.int64), plane(batch[1], np.float64)
    reaches, found = line(batch[2], np.float64), plane(batch[3], np.float64)
    for row in rows:
        roomy = plane(words[row, 0], np.float32)
        shortest = plane(words[row, 1], np.float32)
        _look_ahead(roomy, shortest, places[row], reaches[row], found[row])
