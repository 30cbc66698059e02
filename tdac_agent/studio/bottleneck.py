"""The narrowest passage of a path: the smallest gap between walls that it crosses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tdac_agent.tasks.units import Point
from tdac_envs.epuck.prisms import ROUND, Prisms
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.map2d.task import Map2DTask

Points = NDArray[np.float64]
BETWEEN = 0.002
"""Distance between two points of a wall of a world, m."""
SAMPLES, LEAST_STEP = 12, 0.5
"""Samples of a path on the length of a body radius, but at least half a px apart."""


@dataclass(frozen=True, slots=True)
class Bottleneck:
    """The narrowest passage of a path.

    Attributes:
        width: Its width, in the unit of the path. No wider disc gets through.
        ends: The two points between which it is that wide: on two walls, or, at the
            start or the goal, there and on the nearest wall.
        at: Where it is. A disc must also fit at start and goal.
    """

    width: float
    ends: tuple[Point, Point]
    at: Literal["path", "start", "goal"]


def bottleneck_on(nominal: Any, path: Points) -> Bottleneck | None:
    """The narrowest passage of a path of a task; None without a path.

    Args:
        nominal: The task of a map or a world.
        path: Its corners, shape (n, 2).
    """
    if isinstance(nominal, EPuckTask):
        walls = outlines_of(nominal.ground.solid, BETWEEN)
        radius, least = nominal.body_radius, BETWEEN
    elif isinstance(nominal, Map2DTask):
        walls = corners_of(nominal.terrain.grid.cells)
        radius, least = nominal.robot.radius, LEAST_STEP
    else:
        return None
    step = max(radius / SAMPLES, least)
    return narrowest(path, walls, step) if len(path) > 1 else None


def narrowest(path: Points, walls: Points, step: float) -> Bottleneck:
    """The narrowest passage of a path between walls.

    A gap that the path crosses is also crossed by each path that can be deformed into
    it. From each point of the path, the gap goes to the nearest wall on its left and
    to the nearest on its right.

    Args:
        path: Its corners, shape (n, 2). It touches no wall.
        walls: Points of the walls, shape (m, 2).
        step: Distance between two points of the path at which gaps are measured.
    """
    tree = cKDTree(walls)
    best = min(_at_end(tree, path[0], "start"), _at_end(tree, path[-1], "goal"),
               key=lambda end: end.width)  # fmt: skip
    points, legs = _sampled(path, step)
    near = np.asarray(tree.query(points)[0])
    for i in np.argsort(near).tolist():
        if 2.0 * near[i] >= best.width:
            break
        reach = tree.query_ball_point(points[i], best.width - near[i])
        sides = _nearest_on_sides(points[i], legs[i], walls[reach], path)
        if sides is None:
            continue
        left, right = sides
        width = float(np.hypot(*(left - points[i])) + np.hypot(*(right - points[i])))
        if width < best.width:
            best = Bottleneck(width, (_point(left), _point(right)), "path")
    return best


def corners_of(cells: BoolGrid) -> Points:
    """The corners of pixels between occupied and free ones, shape (n, 2), px.

    Args:
        cells: Shape (height, width), bool, True = occupied.
    """
    padded = np.pad(cells, 1, constant_values=True)
    around = np.stack(
        [padded[:-1, :-1], padded[:-1, 1:], padded[1:, :-1], padded[1:, 1:]]
    )
    rows, columns = np.nonzero(around.any(axis=0) & ~around.all(axis=0))
    return np.column_stack([columns, rows]).astype(np.float64) - 0.5


def outlines_of(solid: Prisms, between: float) -> Points:
    """Points on the outlines of the parts of a world, shape (n, 2), m.

    Args:
        solid: The parts.
        between: Largest distance between neighbours.
    """
    points = []
    for part in range(len(solid.extent)):
        outline, radius = solid.outline(part), float(solid.extent[part, ROUND])
        if radius > 0.0:
            count = int(np.ceil(2.0 * np.pi * radius / between)) + 3
            angles = np.linspace(0.0, 2.0 * np.pi, count)
            ring = np.column_stack([np.cos(angles), np.sin(angles)])
            outline = outline[0] + radius * ring
        closed = np.vstack([outline, outline[:1]])
        points.append(_sampled(closed, between)[0])
        points.append(outline)
    return np.concatenate(points)


def _at_end(tree: Any, end: Points, name: Literal["start", "goal"]) -> Bottleneck:
    """The room at an end of the path."""
    near, index = tree.query(end)
    return Bottleneck(2.0 * float(near), (_point(end), _point(tree.data[index])), name)


def _sampled(path: Points, step: float) -> tuple[Points, NDArray[np.int64]]:
    """Points inside the legs of a path, and the number of the leg of each."""
    lengths = np.hypot(*np.diff(path, axis=0).T)
    counts = np.maximum(1, np.ceil(lengths / step)).astype(np.int64)
    legs = np.repeat(np.arange(len(counts)), counts)
    before = np.repeat(np.cumsum(counts) - counts, counts)
    share = (np.arange(len(legs)) - before + 0.5) / counts[legs]
    return path[legs] + share[:, None] * np.diff(path, axis=0)[legs], legs


def _nearest_on_sides(
    point: Points, leg: int, walls: Points, path: Points
) -> tuple[Points, Points] | None:
    """The nearest points of walls on both sides of a path; None if one has none.

    What lies beyond another leg of the path is not on the side from which it is seen.

    Args:
        point: A point of the path.
        leg: The leg on which it is.
        walls: Points near it, shape (m, 2).
        path: Corners of the path.
    """
    begins, ends = np.delete(path[:-1], leg, 0), np.delete(path[1:], leg, 0)
    side = _cross(path[leg + 1] - path[leg], walls - point)
    points = []
    for here in (side > 0, side < 0):
        own = walls[here][np.argsort(np.hypot(*(walls[here] - point).T))]
        seen = np.flatnonzero(~_crosses(point, own, begins, ends))
        if not seen.size:
            return None
        points.append(own[seen[0]])
    return points[0], points[1]


def _crosses(point: Points, to: Points, begins: Points, ends: Points) -> Any:
    """Whether the straight lines from a point to others cross a leg, shape (m,)."""
    ray, leg = to - point, ends - begins
    begin_side = _cross(ray[:, None], (begins - point)[None])
    end_side = _cross(ray[:, None], (ends - point)[None])
    here = _cross(leg, point - begins)
    there = _cross(leg[None], to[:, None] - begins[None])
    return ((begin_side * end_side < 0) & (here * there < 0)).any(axis=1)


def _cross(one: Points, other: Points) -> Points:
    return np.asarray(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0])


def _point(place: Points) -> Point:
    return float(place[0]), float(place[1])
