"""Lists of nearby parts of a world, for each cell of a coarse grid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel
from tdac_envs.epuck.gaps import gap_of
from tdac_envs.epuck.ground import Ground
from tdac_envs.epuck.infrared import FARTHEST, at_ray_height
from tdac_envs.epuck.prisms import FIXED, Array, Index, Prisms

_CELL = 0.04
"""Minimum width of a cell, m; `_MOST_DISTANCES` may require wider cells."""
_MOST_DISTANCES = 1_000_000
"""Maximum number of cells times parts."""
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Nearby:
    """The parts that are relevant to a robot whose centre is in a cell.

    Attributes:
        cells: Shape (rows, columns + 1): index in `listed` at which the parts of a cell
            begin; they end where those of the next cell begin.
        listed: Indices of parts in ascending order: first all parts, then those of each
            cell.
    """

    cells: Index
    listed: Index


@dataclass(frozen=True, slots=True, eq=False)
class NearbyParts:
    """The parts that a robot may touch and see, depending on its position.

    Attributes:
        width: Width of a cell, m; the first cell begins at the lower left corner of the
            ground's bounds.
        visible: Parts that the infra-red sensors see.
        solid: Solid parts that a step may touch, that may be the nearest or that can
            be pushed.
        seen: Visible parts at the height of the rays that may be in range or that can
            be pushed.
    """

    width: float
    visible: Prisms
    solid: Nearby
    seen: Nearby


@lru_cache(maxsize=8)
def surroundings(
    ground: Ground, webots: bool, goal_mark: bool, reach: float
) -> NearbyParts:
    """The surroundings of a robot on a ground, from a cache.

    Args:
        ground: The world.
        webots: See `Ground.visible`.
        goal_mark: See `Ground.visible`.
        reach: Largest distance of the body from the robot's initial centre during a
            step, m.
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
    return NearbyParts(
        width,
        visible,
        _listed(near | ~fixed),
        _listed(sighted & at_ray_height(visible.extent, ground.floor)),
    )


def _gaps(
    prisms: Prisms, ground: Ground, width: float, shape: tuple[int, int]
) -> NDArray[np.float64]:
    """Distance from the centre of each cell to each part, shape (rows, columns, n)."""
    gaps = np.empty((*shape, len(prisms.extent)))
    left, low, _, _ = ground.bounds
    cell_gaps(*prisms.arrays(), left, low, width, gaps)
    return gaps


def _listed(counts: NDArray[np.bool_]) -> Nearby:
    """The lists for a mask of relevant parts, shape (rows, columns, n), bool."""
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
    """Fills `gaps` with the distances from the centres of the cells to the parts."""
    rows, columns, count = gaps.shape
    for row in range(rows):
        for column in range(columns):
            x, y = left + (column + 0.5) * width, low + (row + 0.5) * width
            for k in range(count):
                gaps[row, column, k] = gap_of(points, first, extent, k, x, y)[0]
