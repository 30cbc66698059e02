"""Compiled ray casting of the range sensor: exact, in leaps over free squares.

All functions use a *padded* map with one occupied pixel added on every side: pixel
(i, j) of the map is `[j + 1, i + 1]`, and no ray needs a bounds test.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, read_only, subkernel
from tdac_envs.grid.grid import BoolGrid

LeapGrid = NDArray[np.uint8]

# Whether x and y grow along the rays of each quadrant.
_GROWS_X = np.array([True, False, True, False])
_GROWS_Y = np.array([True, True, False, False])
_LONGEST = 255


def leaps_of(cells: BoolGrid) -> LeapGrid:
    """The free square that a ray may cross in one leap, per pixel and quadrant.

    Args:
        cells: Shape (height, width), bool, True = occupied.

    Returns:
        Shape (4, height + 2, width + 2), uint8: side of the largest free square that
        has the pixel as a corner and extends into the quadrant, at most 255 px; 0 in
        obstacles. A ray in the pixel leaves this square through one of its two far
        sides.
    """
    height, width = cells.shape
    leaps = np.zeros((4, height + 2, width + 2), np.uint8)
    _fill_leaps(read_only(cells), leaps)
    return read_only(leaps)


@kernel
def _fill_leaps(cells: BoolGrid, leaps: LeapGrid) -> None:
    """Fills `leaps`: 1 + the smallest square of the three neighbours ahead.

    Two of these are in the row ahead: for them, the pixels of a row are independent.
    """
    height, width = cells.shape
    most = np.empty(width, np.uint8)
    for quadrant in range(4):
        dx = 1 if _GROWS_X[quadrant] else -1
        dy = 1 if _GROWS_Y[quadrant] else -1
        for row in range(height):
            j = height - row if dy > 0 else row + 1
            out, ahead = leaps[quadrant, j], leaps[quadrant, j + dy]
            occupied = cells[j - 1]
            for i in range(width):
                beside = min(ahead[i + 1], ahead[i + 1 + dx])
                side = beside + 1 if beside < _LONGEST else _LONGEST
                most[i] = 0 if occupied[i] else side
            side = 0
            for column in range(width):
                i = width - 1 - column if dx > 0 else column
                side = min(side + 1, int(most[i]))
                out[i + 1] = side


@subkernel
def _cast(
    leaps: LeapGrid, u: float, v: float, dx: float, dy: float, range_max: float
) -> float:
    """Distance from (u, v) of the padded map to an obstacle along a unit vector."""
    i, j, t = math.floor(u), math.floor(v), 0.0
    quadrant, flip_x, flip_y = 0, 0, 0
    # After mirroring, both coordinates grow along the ray; pixel i becomes ~i.
    if dx < 0.0:
        quadrant, flip_x, u, dx, i = 1, -1, -u, -dx, ~i
    if dy < 0.0:
        quadrant, flip_y, v, dy, j = quadrant + 2, -1, -v, -dy, ~j
    inv_x = 1.0 / dx if dx > 0.0 else math.inf
    inv_y = 1.0 / dy if dy > 0.0 else math.inf
    squares = leaps[quadrant]
    while True:
        # Unsigned indices avoid numba's wraparound test.
        side = int(squares[np.uint64(j ^ flip_y), np.uint64(i ^ flip_x)])
        if side == 0:
            return t
        out_i, out_j = i + side, j + side
        t_x, t_y = (out_i - u) * inv_x, (out_j - v) * inv_y
        # Rounding must not move the ray out of the square through another side.
        if t_x < t_y:
            t, i, j = t_x, out_i, min(max(math.floor(v + dy * t_x), j), out_j - 1)
        else:
            t, j, i = t_y, out_j, min(max(math.floor(u + dx * t_y), i), out_i - 1)
        if t >= range_max:
            return range_max


@subkernel
def cast_ray(
    leaps: LeapGrid, x: float, y: float, angle: float, range_max: float
) -> float:
    """Distance from (x, y) along `angle` to the first occupied square, px.

    Args:
        leaps: From `leaps_of`.
        x: Column in map pixels.
        y: Row in map pixels.
        angle: Direction, rad, from +x towards +y.
        range_max: Range without a hit, px.
    """
    return _cast_from(leaps, x, y, math.cos(angle), math.sin(angle), range_max)


@subkernel
def _cast_from(
    leaps: LeapGrid, x: float, y: float, dx: float, dy: float, range_max: float
) -> float:
    """`_cast` from a point in map pixels; 0 outside the padded map."""
    u, v = x + 1.5, y + 1.5
    return _cast(leaps, u, v, dx, dy, range_max) if _is_on(leaps, u, v) else 0.0


@subkernel
def _is_on(leaps: LeapGrid, u: float, v: float) -> bool:
    """Whether (u, v) lies on the padded map."""
    return bool(0.0 <= u < leaps.shape[2] and 0.0 <= v < leaps.shape[1])


def directions_of(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Directions of rays in the robot's frame, shape (2, n_rays): cosines, sines.

    Args:
        angles: Angles of the rays from the heading, rad; `RobotParams.angles`.
    """
    # Bit for bit as in `tdac_envs.controller_kit.sensors`.
    turns = angles.tolist()
    return np.array([[math.cos(v) for v in turns], [math.sin(v) for v in turns]])


@subkernel
def cast_rays(
    leaps: LeapGrid,
    directions: NDArray[np.float64],
    x: float,
    y: float,
    heading: float,
    range_max: float,
    out: NDArray[np.float32],
) -> None:
    """Fills `out` with the ranges of all rays, in their order.

    Args:
        leaps: From `leaps_of`.
        directions: From `directions_of`.
        x: Column in map pixels.
        y: Row in map pixels.
        heading: rad, from +x towards +y.
        range_max: Range without a hit, px.
        out: Shape (n_rays,), float32, overwritten.
    """
    u, v = x + 1.5, y + 1.5
    if not _is_on(leaps, u, v):
        out[:] = 0.0
        return
    cos, sin = math.cos(heading), math.sin(heading)
    for k in range(out.shape[0]):
        ahead, aside = directions[0, k], directions[1, k]
        dx, dy = cos * ahead - sin * aside, sin * ahead + cos * aside
        out[k] = _cast(leaps, u, v, dx, dy, range_max)


@subkernel
def in_sight(leaps: LeapGrid, x: float, y: float, to_x: float, to_y: float) -> bool:
    """Whether the segment between two points crosses no occupied square."""
    off_x, off_y = to_x - x, to_y - y
    distance = math.sqrt(off_x * off_x + off_y * off_y)
    if distance == 0.0:
        return True
    dx, dy = off_x / distance, off_y / distance
    return bool(_cast_from(leaps, x, y, dx, dy, distance) >= distance)


@kernel
def sees(leaps: LeapGrid, x: float, y: float, to_x: float, to_y: float) -> bool:
    """`in_sight` for calls from Python."""
    return bool(in_sight(leaps, x, y, to_x, to_y))
