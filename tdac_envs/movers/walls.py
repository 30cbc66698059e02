"""Walls as straight segments, for discs that keep away from them.

The outline of the occupied pixels is simplified to polygons within `TOLERANCE`. People
of a crowd choose their velocities by these; what they cannot enter are the squares.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.movers.orca import POINT_X, POINT_Y, Array, add_plane

Cells = NDArray[np.int64]

TOLERANCE = 1.0
"""Largest distance between the outline and the polygons, px."""
CELL = 8
"""Side of the square cells that list the segments in reach, px."""
MOST_WALLS = 8
"""Largest number of walls of which a person takes notice at a time."""
# The polygons go through the centres of pixels.
_HALF = 0.5

FROM_X, FROM_Y, UNIT_X, UNIT_Y, LENGTH, BEFORE_X, BEFORE_Y = range(7)
N_WALL = 7


def segments_of(occupied: NDArray[np.bool_]) -> Array:
    """The segments around the free regions of a map.

    Args:
        occupied: Shape (height, width); everything outside is occupied, too.

    Returns:
        Shape (n, 7): x, y of one end (px), unit vector to the other end, length (px),
        and the unit vector of the segment before it. Free space lies on the side of
        (-unit_y, unit_x).
    """
    padded = np.pad(occupied, 1, constant_values=True).astype(np.uint8)
    outlines, _ = cv2.findContours(padded, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    rows = []
    for outline in outlines:
        if (outline == 0).all(axis=2).any():
            continue  # The outer side of the border.
        corners = cv2.approxPolyDP(outline, TOLERANCE, True)[:, 0].astype(float) - 1.0
        if len(corners) == 1:
            # A single pixel: a wall of no length has no direction.
            corners = np.add(corners, [[-0.25, 0.0], [0.25, 0.0]])
        steps = np.roll(corners, -1, axis=0) - corners
        lengths = np.hypot(*steps.T)
        units = steps / lengths[:, None]
        before = np.roll(units, 1, axis=0)
        rows.append(np.column_stack([corners, units, lengths, before]))
    return np.concatenate(rows) if rows else np.zeros((0, N_WALL))


def cells_of(walls: Array, shape: tuple[int, ...], reach: float) -> tuple[Cells, Cells]:
    """Which segments are within `reach` px of some point of each cell.

    Args:
        walls: From `segments_of`.
        shape: Height and width of the map, px.
        reach: Distance, px.

    Returns:
        `first`, shape (rows, columns + 1), and `listed`: the cell in column c of a row
        has the segments `listed[first[row, c] : first[row, c + 1]]`.
    """
    rows, columns = (math.ceil(side / CELL) + 1 for side in shape)
    within = reach + CELL * math.sqrt(0.5)
    counts = np.zeros((rows, columns), np.int64)
    _visit(walls, within, counts, np.empty(0, np.int64))
    ends = np.cumsum(counts).reshape(rows, columns)
    first = np.column_stack([ends[:, 0] - counts[:, 0], ends])
    listed = np.empty(int(ends[-1, -1]), np.int64)
    _visit(walls, within, first[:, :-1].copy(), listed)
    return first, listed


@kernel
def _visit(walls: Array, within: float, places: Cells, listed: Cells) -> None:
    """Lists each segment in the cells whose centre is within a distance of it.

    Args:
        walls: From `segments_of`.
        within: The distance, px.
        places: Shape (rows, columns): where the next segment of a cell is listed;
            counted up.
        listed: Overwritten, unless it is empty.
    """
    rows, columns = places.shape
    for k in range(walls.shape[0]):
        x, y, length = walls[k, FROM_X], walls[k, FROM_Y], walls[k, LENGTH]
        unit_x, unit_y = walls[k, UNIT_X], walls[k, UNIT_Y]
        to_x, to_y = x + length * unit_x, y + length * unit_y
        left, right = min(x, to_x) - within, max(x, to_x) + within
        top, bottom = min(y, to_y) - within, max(y, to_y) + within
        for row in range(
            max(math.ceil(top / CELL - 0.5), 0),
            min(math.floor(bottom / CELL + 0.5), rows - 1) + 1,
        ):
            for column in range(
                max(math.ceil(left / CELL - 0.5), 0),
                min(math.floor(right / CELL + 0.5), columns - 1) + 1,
            ):
                # From the centre of the cell.
                off_x, off_y = (column + 0.5) * CELL - x, (row + 0.5) * CELL - y
                along = min(max(off_x * unit_x + off_y * unit_y, 0.0), length)
                off_x, off_y = off_x - along * unit_x, off_y - along * unit_y
                if off_x * off_x + off_y * off_y <= within * within:
                    if listed.size:
                        listed[places[row, column]] = k
                    places[row, column] += 1


@subkernel
def wall_planes(
    walls: Array, first: Cells, listed: Cells, x: float, y: float, radius: float,
    speed: float, horizon: float, planes: Array,
) -> int:  # fmt: skip
    """Writes the half-planes of the walls near a disc; returns their number.

    The speed towards each nearest point of a wall is limited to the gap divided by the
    horizon. Corners count where they are nearer than the walls on both sides.

    Args:
        walls: From `segments_of`.
        first: From `cells_of`.
        listed: From `cells_of`.
        x: Column of the centre, px.
        y: Row, px.
        radius: px.
        speed: Largest speed, px/s.
        horizon: s.
        planes: Half-planes of `tdac_envs.movers.orca`; the first rows are overwritten.
    """
    row = min(max(int(y / CELL), 0), first.shape[0] - 1)
    column = min(max(int(x / CELL), 0), first.shape[1] - 2)
    count, farthest = 0, speed * horizon
    for index in range(first[row, column], first[row, column + 1]):
        k = listed[index]
        unit_x, unit_y = walls[k, UNIT_X], walls[k, UNIT_Y]
        off_x, off_y = x - walls[k, FROM_X], y - walls[k, FROM_Y]
        along = off_x * unit_x + off_y * unit_y
        if along > walls[k, LENGTH]:
            continue
        if along >= 0.0:
            far = unit_x * off_y - unit_y * off_x
            if far < 0.0:
                continue
            away_x, away_y = -unit_y, unit_x
        else:
            if off_x * walls[k, BEFORE_X] + off_y * walls[k, BEFORE_Y] < 0.0:
                continue
            far = math.sqrt(off_x * off_x + off_y * off_y)
            if far == 0.0:
                continue
            away_x, away_y = off_x / far, off_y / far
        gap = max(far - radius - _HALF, 0.0)
        if gap >= farthest:
            continue
        at = count if count < MOST_WALLS else _farthest(planes)
        if at < count and _gap_of(planes, at) <= gap / horizon:
            continue
        rate = -gap / horizon
        add_plane(planes, at, rate * away_x, rate * away_y, away_y, -away_x)
        count = min(count + 1, MOST_WALLS)
    return count


@subkernel
def _gap_of(planes: Array, k: int) -> float:
    """The gap to a wall, divided by the horizon."""
    return math.hypot(planes[k, POINT_X], planes[k, POINT_Y])


@subkernel
def _farthest(planes: Array) -> int:
    """The plane of the farthest wall."""
    at = 0
    for other in range(1, MOST_WALLS):
        if _gap_of(planes, other) > _gap_of(planes, at):
            at = other
    return at
