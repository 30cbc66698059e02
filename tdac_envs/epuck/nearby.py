"""Which parts of a world count where: lists for the cells of a coarse grid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.epuck.gaps import gap_of
from tdac_envs.epuck.ground import Ground
from tdac_envs.epuck.infrared import FARTHEST, at_ray_height
from tdac_envs.epuck.prisms import FIXED, Array, Index, Prisms

_CELL = 0.04
"""Width of a cell, m; more where there would be more distances than these."""
_MOST_DISTANCES = 1_000_000
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Nearby:
    """The parts that count for a robot whose centre is in a cell.

    Attributes:
        cells: Shape (rows, columns + 1): where in `listed` the parts of a cell begin;
            they end where those of the next one begin.
        listed: Numbers of parts in ascending order: first all of them, then those of
            each cell.
    """

    cells: Index
    listed: Index


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What a robot may touch and what it may see at each place of a ground.

    Attributes:
        width: Of a cell, m; the first one begins at the corner of the ground's bounds.
        visible: What the infra-red sensors see.
        solid: Of the ground's solid parts those that a step may touch, those that may
            be the nearest, and all that can be pushed.
        seen: Of the visible parts those that may be in reach of the sensors, and all
            that can be pushed.
    """

    width: float
    visible: Prisms
    solid: Nearby
    seen: Nearby


@lru_cache(maxsize=8)
def surroundings(
    ground: Ground, webots: bool, goal_mark: bool, reach: float
) -> Surroundings:
    """The surroundings of a robot on a ground; equal ones are shared.

    Args:
        ground: The world.
        webots: See `Ground.visible`, as the next.
        goal_mark: Whether a mark of the goal is seen.
        reach: How far from its centre the body may get in a step, m.
    """
    visible, solid = ground.visible(webots, goal_mark), ground.solid
    left, low, right, high = ground.bounds
    most = len(solid.extent) + len(visible.extent)
    area = (right - left) * (high - low)
    width = max(_CELL, math.sqrt(area * most / _MOST_DISTANCES))
    shape = math.ceil((high - low) / width), math.ceil((right - left) / width)
    half = width / math.sqrt(2.0) + _ROUNDING

    gaps = _gaps(solid, ground, width, shape)
    fixed = solid.owner == FIXED
    surely = gaps[..., fixed].min(axis=2, initial=math.inf) + half
    near = gaps - half <= np.maximum(surely, reach)[..., None]
    sighted = _gaps(visible, ground, width, shape) - half <= FARTHEST
    sighted |= visible.owner != FIXED
    return Surroundings(
        width,
        visible,
        _listed(near | ~fixed),
        _listed(sighted & at_ray_height(visible.extent, ground.floor)),
    )


def _gaps(
    prisms: Prisms, ground: Ground, width: float, shape: tuple[int, int]
) -> NDArray[np.float64]:
    """Distance from the middle of each cell to each part, shape (rows, columns, n)."""
    gaps = np.empty((*shape, len(prisms.extent)))
    left, low, _, _ = ground.bounds
    cell_gaps(*prisms.arrays(), left, low, width, gaps)
    return gaps


def _listed(counts: NDArray[np.bool_]) -> Nearby:
    """The lists of the parts that count, from shape (rows, columns, n)."""
    rows, columns, n = counts.shape
    ends = n + np.cumsum(counts.sum(axis=2)).reshape(rows, columns)
    cells = np.empty((rows, columns + 1), np.int64)
    cells[:, 1:] = ends
    cells[0, 0], cells[1:, 0] = n, ends[:-1, -1]
    return Nearby(cells, np.append(np.arange(n), np.nonzero(counts)[2]))


@kernel
def cell_gaps(
    points: Array,
    first: Index,
    extent: Array,
    left: float,
    low: float,
    width: float,
    gaps: NDArray[np.float64],
) -> None:
    """Fills `gaps` with the distances from the cells' middles to the parts."""
    rows, columns, count = gaps.shape
    for row in range(rows):
        for column in range(columns):
            x, y = left + (column + 0.5) * width, low + (row + 0.5) * width
            for k in range(count):
                gaps[row, column, k] = gap_of(points, first, extent, k, x, y)[0]


@subkernel
def listed_at(
    cells: Index, count: int, left: float, low: float, width: float, x: float, y: float
) -> tuple[int, int]:
    """Begin and end in `Nearby.listed` of the parts that count at a place.

    Outside the cells they all do, of which there are `count`.
    """
    column, row = math.floor((x - left) / width), math.floor((y - low) / width)
    if 0 <= row < cells.shape[0] and 0 <= column < cells.shape[1] - 1:
        return cells[row, column], cells[row, column + 1]
    return 0, count
