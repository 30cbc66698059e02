"""Finds the place on a map where a task is infeasible, for a picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from tdac_envs.grid.grid import BoolGrid, FloatGrid, body_free, clearance
from tdac_envs.grid.map_units import MapUnits
from tdac_envs.grid.pieces import (
    connected_with,
    end_outside,
    nearest_free,
    pieces_of,
)
from tdac_envs.grid.plan import plan_path
from tdac_envs.mapping.params import MapParams
from tdac_envs.mapping.score import widest_radius

Point = tuple[float, float]
Pixel = tuple[int, int]
Sides = tuple[BoolGrid, BoolGrid]


@dataclass(frozen=True, slots=True, eq=False)
class MapFault:
    """The place on a map where a task is infeasible.

    Attributes:
        label: What is wrong there, for the legend.
        at: The place, px.
        better: The nearest suitable place, px, or None.
        start_side: Shape (height, width), bool: where the body can get from the start;
            all False if it does not fit there.
        goal_side: The same, from the goal.
    """

    label: str
    at: Point
    better: Pixel | None
    start_side: BoolGrid
    goal_side: BoolGrid


def fault_of(cells: BoolGrid, params: MapParams, units: MapUnits) -> MapFault | None:
    """Finds where a task is infeasible for the body; None if it is feasible.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        params: Start, goal and robot.
        units: Units of the label.
    """
    if params.start is None or params.goal is None:
        return None
    ends = {"start": params.start, "goal": params.goal}
    off = _off_the_map(cells, ends)
    if off is not None:
        return off
    clear = clearance(cells)
    free = body_free(clear, params.robot.radius)
    start, goal = _pixel(params.start), _pixel(params.goal)
    labels = pieces_of(free)
    numbers = labels[start[::-1]], labels[goal[::-1]]
    sides = (labels == numbers[0]) & free, (labels == numbers[1]) & free
    misplaced = _misplaced(cells, free, (start, goal), sides)
    if misplaced is not None:
        return misplaced
    if numbers[0] == numbers[1]:
        return None
    widest = widest_radius(clear, start, goal)
    if widest < 0.5:
        return MapFault("closed here", _wall(clear, start, goal), None, *sides)
    label = f"narrowest gap: a radius of {units.at_most(widest)} gets through"
    return MapFault(label, _gap(clear, widest, start, goal), None, *sides)


def _misplaced(
    cells: BoolGrid, free: BoolGrid, ends: tuple[Pixel, Pixel], sides: Sides
) -> MapFault | None:
    """The fault of an end that is walled off or where the body does not fit."""
    beyond = end_outside(cells, *ends)
    for name, (x, y), there, other in zip(
        ("start", "goal"), ends, ends[::-1], sides[::-1], strict=True
    ):
        if name == beyond:
            what, places = (
                "outside of the closed wall",
                free & connected_with(~cells, there),
            )
        elif beyond is None and not free[y, x]:
            what = "in an obstacle" if cells[y, x] else "too near to an obstacle"
            places = free
        else:
            continue
        better = nearest_free(other if other.any() else places, x, y)
        return MapFault(f"{name} {what}", (x, y), better, *sides)
    return None


def _pixel(point: Point) -> Pixel:
    return math.floor(point[0] + 0.5), math.floor(point[1] + 0.5)


def _off_the_map(cells: BoolGrid, ends: dict[str, Point]) -> MapFault | None:
    """The fault of the first end outside the map, at the nearest border."""
    height, width = cells.shape
    none = np.zeros_like(cells)
    for name, (x, y) in ends.items():
        column, row = _pixel((x, y))
        if not (0 <= column < width and 0 <= row < height):
            at = min(max(x, 0.0), width - 1.0), min(max(y, 0.0), height - 1.0)
            label = f"{name} outside the map, in this direction"
            return MapFault(label, at, None, none, none)
    return None


def _gap(clear: FloatGrid, widest: float, start: Pixel, goal: Pixel) -> Point:
    """The narrowest place between two pixels that a body of `widest` px gets through.

    A slightly wider body cannot leave the part of the map around the start. The gap is
    the place where a path for the narrower body leaves this part.
    """
    path = plan_path(body_free(clear, widest), start, goal).astype(np.intp)
    labels = pieces_of(body_free(clear, widest + 0.2))
    along = labels[path[:, 1], path[:, 0]]
    inside = np.flatnonzero(along == along[0])
    leaves = int(inside[-1]) if along[0] else 0
    beyond = np.flatnonzero((along != 0) & (np.arange(len(along)) > leaves))
    enters = int(beyond[0]) if beyond.size else len(path) - 1
    tight = path[leaves : enters + 1]
    x, y = tight[int(np.argmin(clear[tight[:, 1], tight[:, 0]]))].tolist()
    return float(x), float(y)


def _wall(clear: FloatGrid, start: Pixel, goal: Pixel) -> Point:
    """The middle of the thinnest wall between the parts around two pixels.

    Of equally thin places, the one nearest to the midpoint of the pixels is chosen.
    """
    labels = pieces_of(body_free(clear, 0.0))
    here, there = (labels == labels[end[::-1]] for end in (start, goal))
    distance = cv2.distanceTransform((~there).astype(np.uint8), cv2.DIST_L2, 5)
    distance[~here] = np.inf
    rows, columns = np.nonzero(distance <= distance.min() + 0.5)
    middle = np.add(start, goal) / 2
    best = int(np.argmin(np.hypot(columns - middle[0], rows - middle[1])))
    x, y = int(columns[best]), int(rows[best])
    near = nearest_free(there, x, y) or goal
    return (x + near[0]) / 2, (y + near[1]) / 2
