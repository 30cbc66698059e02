"""Rays in any direction: the first part of a world that each of them hits."""

from __future__ import annotations

import math

from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.epuck.infrared import crossing
from tdac_envs.epuck.prisms import HIGH, LOW, MID_X, MID_Y, REACH, Array, Index

_MARGIN = 1e-9
"""Parts are skipped only if a ray passes them at more than this distance, m."""


@subkernel
def _first_part(
    points: Array,
    first: Index,
    extent: Array,
    x: float,
    y: float,
    z: float,
    dir_x: float,
    dir_y: float,
    dir_z: float,
    least: float,
    longest: float,
) -> tuple[float, int]:
    """The least t in [least, longest) at which a line is in a part, and the part.

    Without such a part, `longest` and -1. The direction may have any length; t is
    measured in its length.
    """
    best, found = longest, -1
    speed = math.sqrt(dir_x * dir_x + dir_y * dir_y)
    for k in range(extent.shape[0]):
        off_x, off_y = extent[k, MID_X] - x, extent[k, MID_Y] - y
        reach = extent[k, REACH] + _MARGIN
        if math.sqrt(off_x * off_x + off_y * off_y) > reach + best * speed:
            continue
        if abs(off_x * dir_y - off_y * dir_x) > reach * speed:
            continue
        near, far = least, best
        if dir_z != 0.0:
            enter = (extent[k, LOW] - z) / dir_z
            leave = (extent[k, HIGH] - z) / dir_z
            near, far = max(near, min(enter, leave)), min(far, max(enter, leave))
        elif z < extent[k, LOW] or z > extent[k, HIGH]:
            continue
        if near > far:
            continue
        at = crossing(points, first, extent, k, x, y, dir_x, dir_y, near, far)
        if at < best:
            best, found = at, k
    return best, found


@kernel
def nearest_hit(
    points: Array,
    first: Index,
    extent: Array,
    x: float,
    y: float,
    z: float,
    dir_x: float,
    dir_y: float,
    dir_z: float,
    longest: float,
) -> tuple[float, int]:
    """The first part that a ray hits.

    Args:
        points: Vertices of the parts; see `tdac_envs.epuck.prisms.Prisms`.
        first: See `points`.
        extent: See `points`.
        x: Origin of the ray, m.
        y: See `x`.
        z: See `x`.
        dir_x: Direction, of length 1.
        dir_y: See `dir_x`.
        dir_z: See `dir_x`.
        longest: Length of the ray, m.

    Returns:
        Distance, m, and index of the part; `longest` and -1 if there is none.
    """
    return _first_part(
        points, first, extent, x, y, z, dir_x, dir_y, dir_z, 0.0, longest
    )


@kernel
def scan(
    points: Array,
    first: Index,
    extent: Array,
    place: Array,
    directions: Array,
    least: float,
    longest: float,
    ranges: Array,
) -> None:
    """Casts many rays from one point.

    Args:
        points: Vertices of the parts; see `tdac_envs.epuck.prisms.Prisms`.
        first: See `points`.
        extent: See `points`.
        place: Shape (3,): origin of the rays, m.
        directions: Shape (n, 3): directions, of any length.
        least: Smallest range that is looked at, in lengths of a direction.
        longest: Largest range, in lengths of a direction.
        ranges: Shape (n,), overwritten: range in lengths of the direction; inf if a
            ray hits nothing.
    """
    for n in range(directions.shape[0]):
        ranges[n], part = _first_part(
            points, first, extent, place[0], place[1], place[2],
            directions[n, 0], directions[n, 1], directions[n, 2], least, longest,
        )  # fmt: skip
        if part < 0:
            ranges[n] = math.inf
