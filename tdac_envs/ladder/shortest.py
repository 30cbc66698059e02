"""The shortest path of a disc between two points: straight lines and arcs, exact."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import read_only
from tdac_envs.grid.grid import BoolGrid, FloatGrid
from tdac_envs.ladder import rolling, tangents
from tdac_envs.ladder.passages import touched_corners

Point = tuple[float, float]

_LABELS = 1 << 15
_ARC = 0.1
"""Angle between the points of an arc, rad."""


@dataclass(frozen=True, slots=True, eq=False)
class ShortestPath:
    """The shortest path of a disc.

    Attributes:
        length: Its length, px.
        points: Shape (n, 2): its points (x, y), px; arcs have a point every 0.1 rad.
    """

    length: float
    points: NDArray[np.float64]


def shortest_path(
    cells: BoolGrid,
    padded_clear: FloatGrid,
    start: Point,
    goal: Point,
    radius: float,
    bound: float = math.inf,
) -> ShortestPath | None:
    """The shortest path of all for a disc that may touch obstacles; exact to 1e-6 px.

    No motion of a disc that does not enter obstacles is shorter.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        padded_clear: Clearance, px, with a border of zeros; see `Terrain`.
        start: Point (x, y), px.
        goal: Point (x, y), px.
        radius: Radius of the disc, px.
        bound: Length of any path, px, if one is known; it makes the search faster.

    Returns:
        None if there is no path within the bound.
    """
    ends = read_only(np.array([start, goal], np.float64))
    corners, exposed = _corners(cells, ends, radius, bound + rolling.SLACK)
    clear, touched = read_only(padded_clear), read_only(touched_corners(cells))
    labels, found = _LABELS, tangents.FULL
    while found == tangents.FULL:
        labels *= 2
        values, links = np.empty((labels, 6)), np.empty((labels, 3), np.int64)
        heads, heap = np.full(2 * len(corners), -1), np.empty(labels, np.int64)
        found = tangents.search(
            clear,
            touched,
            read_only(corners),
            read_only(exposed),
            heads,
            ends,
            float(radius),
            float(bound) + rolling.SLACK,
            values,
            links,
            heap,
        )
    if found == tangents.NO_PATH:
        return None
    length = float(values[found, tangents.LENGTH])
    return ShortestPath(length, _points(found, values, links, corners, ends, radius))


def _corners(
    cells: BoolGrid, ends: NDArray[np.float64], radius: float, bound: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    # Not initialised: memory that is never written costs nothing.
    corners, exposed = np.empty((cells.size, 2)), np.empty((cells.size, 4))
    rows = np.empty(cells.shape[0] + 2, np.int64)
    numbers = float(radius), float(bound)
    count = rolling.exposed_corners(
        read_only(cells), ends, *numbers, corners, exposed, rows
    )
    return corners[:count], exposed[:count]


def _points(
    label: int,
    values: NDArray[np.float64],
    links: NDArray[np.int64],
    corners: NDArray[np.float64],
    ends: NDArray[np.float64],
    radius: float,
) -> NDArray[np.float64]:
    """The points of the path that a label ends, from the start on."""
    lines = []
    while links[label, tangents.PARENT] >= 0:
        lines.append((int(links[label, tangents.NODE]), values[label, :2].tolist()))
        label = int(links[label, tangents.PARENT])
    points = [tuple(ends[0].tolist())]
    for (node, (mx, my)), (_, (to_mx, to_my)) in zip(
        lines[:0:-1], lines[-2::-1], strict=True
    ):
        sense, (x, y) = 1 - 2 * (node & 1), corners[node >> 1].tolist()
        begin = math.atan2(sense * my, sense * mx)
        turn = math.atan2(mx * to_my - my * to_mx, mx * to_mx + my * to_my)
        steps = math.ceil(abs(turn) / _ARC) + 1
        for k in range(steps + 1):
            angle = begin + turn * k / steps
            points.append((x + radius * math.cos(angle), y + radius * math.sin(angle)))
    return np.array([*points, tuple(ends[1].tolist())])
