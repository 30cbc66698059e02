"""Compiled geometry of the range sensor: exact rays over a padded map.

A *padded* map has one occupied pixel added on every side, so that pixel (i, j) of the
map is `padded[j + 1, i + 1]` and no ray needs a bounds test.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.compiled import kernel
from tdac_envs.grid import BoolGrid, FloatGrid

# From a point anywhere in a pixel, an obstacle is at most half a diagonal nearer
# than from the pixel's centre; the rest is for float32 rounding.
HALF_DIAGONAL = 0.708


def pad(cells: BoolGrid, clear: FloatGrid) -> tuple[BoolGrid, FloatGrid]:
    """The cells and their clearance with the occupied border the kernels expect.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        clear: Shape (height, width), float32, from `grid.clearance`.

    Returns:
        Both with shape (height + 2, width + 2).
    """
    return np.pad(cells, 1, constant_values=True), np.pad(clear, 1)


@kernel("b1[:,:] f4[:,:] f8 f8 f8 f8 -> f8")
def cast_ray(
    cells: BoolGrid,
    clear: FloatGrid,
    x: float,
    y: float,
    angle: float,
    range_max: float,
) -> float:
    """Distance from (x, y) along `angle` to the first occupied square, px.

    Grid traversal after Amanatides and Woo (1987), with leaps through open space by
    the clearance of the pixel under the ray. No hit gives `range_max`.

    Args:
        cells: Padded map, True = occupied.
        clear: Padded clearance, px.
        x: Column in map pixels.
        y: Row in map pixels.
        angle: Direction, rad, from +x towards +y.
        range_max: Longest distance, px.
    """
    u, v = x + 1.5, y + 1.5
    i, j = math.floor(u), math.floor(v)
    if i < 0 or j < 0 or j >= cells.shape[0] or i >= cells.shape[1] or cells[j, i]:
        return 0.0
    dx, dy = math.cos(angle), math.sin(angle)
    step_x, step_y = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
    ahead_x, ahead_y = (1 if dx > 0.0 else 0), (1 if dy > 0.0 else 0)
    inv_x = 1.0 / dx if dx != 0.0 else math.inf
    inv_y = 1.0 / dy if dy != 0.0 else math.inf
    t = 0.0
    while True:
        leap = clear[j, i] - HALF_DIAGONAL
        if leap > 1.0:
            t += leap
            if t >= range_max:
                return range_max
            i, j = math.floor(u + dx * t), math.floor(v + dy * t)
        next_x = (i + ahead_x - u) * inv_x if dx != 0.0 else math.inf
        next_y = (j + ahead_y - v) * inv_y if dy != 0.0 else math.inf
        while True:
            # A ray along a border may meet, after a leap, one that lies behind it.
            if next_x < next_y:
                t = max(t, next_x)
                i += step_x
                next_x = (i + ahead_x - u) * inv_x
            else:
                t = max(t, next_y)
                j += step_y
                next_y = (j + ahead_y - v) * inv_y
            if t >= range_max:
                return range_max
            if cells[j, i]:
                return t
            if clear[j, i] > 3.0:
                break


@kernel("b1[:,:] f4[:,:] f8 f8 f8 f8 f8 f4[:] ->")
def cast_rays(
    cells: BoolGrid,
    clear: FloatGrid,
    x: float,
    y: float,
    heading: float,
    field_of_view: float,
    range_max: float,
    out: NDArray[np.float32],
) -> None:
    """Fills `out` with the fan of ranges; `out[0]` is the robot's leftmost ray.

    Ray i points at `heading - field_of_view / 2 + i * field_of_view / (n - 1)`; a
    single ray points ahead.

    Args:
        cells: Padded map, True = occupied.
        clear: Padded clearance, px.
        x: Column in map pixels.
        y: Row in map pixels.
        heading: rad, from +x towards +y.
        field_of_view: Whole angle of the fan, rad.
        range_max: Range without a hit, px.
        out: Shape (n_rays,), float32, overwritten.
    """
    n = out.shape[0]
    first = heading - 0.5 * field_of_view if n > 1 else heading
    step = field_of_view / (n - 1) if n > 1 else 0.0
    for k in range(n):
        out[k] = cast_ray(cells, clear, x, y, first + k * step, range_max)


@kernel("b1[:,:] f4[:,:] f8 f8 f8 f8 -> b1")
def sees(
    cells: BoolGrid, clear: FloatGrid, x: float, y: float, to_x: float, to_y: float
) -> bool:
    """Whether the segment between two points crosses no occupied square."""
    distance = math.hypot(to_x - x, to_y - y)
    if distance == 0.0:
        return True
    angle = math.atan2(to_y - y, to_x - x)
    return bool(cast_ray(cells, clear, x, y, angle, distance) >= distance)
