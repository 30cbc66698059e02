"""Compiled geometry of a disc that rolls around the corners of occupied squares.

Directions are unit vectors. The disc rolls around a corner with a *sense* of 1 (from
+x towards +y) or -1.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.grid.grid import BoolGrid, FloatGrid
from tdac_envs.map2d.contact import arc_contact, has_room

Values = NDArray[np.float64]
Links = NDArray[np.int64]

SLACK = 1e-6
"""The disc is tested with a radius smaller by this, px: it may touch corners."""
ANGLE = 1e-9
"""Tolerance of directions, rad."""
ROUNDING = 1e-5
"""Margin for the float32 rounding of the clearance field, px."""
_SHORT = 0.5
"""Distance between tests where the clearance does not decide, px."""
_PIECE = 8.0
"""Length of the pieces of a line that are tested exactly, px."""


@kernel
def exposed_corners(
    cells: BoolGrid,
    ends: Values,
    radius: float,
    bound: float,
    corners: Values,
    exposed: Values,
    rows: Links,
) -> int:
    """Convex corners of obstacles, and the directions in which a disc may touch them.

    Directions at the ends of a corner's quarter circle are dropped where a disc that
    touches the corner covers another corner. Corners that are too far away for a path
    within the bound are left out.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        ends: Start and goal, [[x, y], [x, y]].
        radius: Radius of the disc, px.
        bound: Length of the longest path of interest, px.
        corners: Shape (n, 2); its first rows become the corners (x, y).
        exposed: Shape (n, 4); its first rows become the first and last direction.
        rows: Shape (height + 2,), overwritten.

    Returns:
        The number of corners.
    """
    found = _convex_corners(cells, corners, exposed, rows)
    kept = np.zeros(found, np.bool_)
    for k in range(found):
        way = 0.0
        for end in range(2):
            dx, dy = corners[k, 0] - ends[end, 0], corners[k, 1] - ends[end, 1]
            way += math.sqrt(dx * dx + dy * dy)
        # The disc touches a corner from at most its radius away.
        if way <= bound + 2.0 * radius + ROUNDING:
            kept[k] = _is_exposed(corners, exposed, rows, k, radius)
    count = 0
    for k in range(found):
        if kept[k]:
            corners[count], exposed[count] = corners[k], exposed[k]
            count += 1
    return count


@subkernel
def _is_exposed(
    corners: Values, exposed: Values, rows: Links, k: int, radius: float
) -> bool:
    """Drops the directions in which the disc at a corner covers any other corner.

    Returns:
        False if no direction is left.
    """
    x, y, reach = corners[k, 0], corners[k, 1], math.ceil(2.0 * radius)
    row = math.floor(y + 0.5)
    first = rows[max(row - reach, 0)]
    last = rows[min(row + reach + 1, rows.shape[0] - 1)]
    # A second pass, since what covers the middle may then be at an end.
    for _ in range(2):
        for other in range(first, last):
            dx, dy = corners[other, 0] - x, corners[other, 1] - y
            if other == k or dx * dx + dy * dy >= 4.0 * radius * radius:
                continue
            if not _trim(exposed, k, dx, dy, radius):
                return False
    return True


@subkernel
def _convex_corners(
    cells: BoolGrid, corners: Values, exposed: Values, rows: Links
) -> int:
    """Points with one occupied pixel of four; `rows` gets each row's first corner."""
    height, width = cells.shape
    count = 0
    rows[0] = 0
    for j in range(1, height):
        rows[j] = count
        for i in range(1, width):
            above, below = cells[j - 1], cells[j]
            occupied = int(above[i - 1]) + above[i] + below[i - 1] + below[i]
            if occupied != 1:
                continue
            away_x = 1.0 if above[i - 1] or below[i - 1] else -1.0
            away_y = 1.0 if above[i - 1] or above[i] else -1.0
            corners[count, 0], corners[count, 1] = i - 0.5, j - 0.5
            exposed[count] = 0.0
            first = 0 if away_x * away_y > 0.0 else 2
            exposed[count, first], exposed[count, 3 - first] = away_x, away_y
            count += 1
    rows[height:] = count
    return count


@subkernel
def _trim(exposed: Values, k: int, dx: float, dy: float, radius: float) -> bool:
    """Drops the directions in which the disc at a corner covers another corner.

    Args:
        exposed: Directions of all corners.
        k: The corner.
        dx: x of the other corner, seen from this one, px.
        dy: y of the other corner.
        radius: Radius of the disc, px.

    Returns:
        False if no direction is left.
    """
    cos = _half_angle(math.sqrt(dx * dx + dy * dy), radius)
    if cos >= 1.0:
        return True
    ax, ay = _rotated(dx, dy, cos, -1.0)
    bx, by = _rotated(dx, dy, cos, 1.0)
    low_x, low_y = exposed[k, 0], exposed[k, 1]
    high_x, high_y = exposed[k, 2], exposed[k, 3]
    low = cross(ax, ay, low_x, low_y) > 0.0 and cross(low_x, low_y, bx, by) > 0.0
    high = cross(ax, ay, high_x, high_y) > 0.0 and cross(high_x, high_y, bx, by) > 0.0
    if low and high:
        return False
    if low:
        exposed[k, 0], exposed[k, 1] = bx, by
    if high:
        exposed[k, 2], exposed[k, 3] = ax, ay
    return True


@subkernel
def _half_angle(distance: float, radius: float) -> float:
    """Cosine of the angle to a point at which a disc on a circle begins to cover it.

    The disc's centre is on a circle of `radius` around a corner. Above 1 if the disc
    never covers a point at this distance from the corner.
    """
    body = radius - SLACK
    return (radius * radius - body * body + distance * distance) / (
        2.0 * radius * distance
    )


@subkernel
def _rotated(x: float, y: float, cos: float, sense: float) -> tuple[float, float]:
    """The direction of (x, y), rotated by the angle of this cosine, as unit vector."""
    sin, norm = sense * math.sqrt(1.0 - cos * cos), math.sqrt(x * x + y * y)
    return (x * cos - y * sin) / norm, (x * sin + y * cos) / norm


@subkernel
def cross(ax: float, ay: float, bx: float, by: float) -> float:
    """Cross product of (ax, ay) and (bx, by)."""
    return ax * by - ay * bx


@subkernel
def roll_limit(
    touched: BoolGrid,
    x: float,
    y: float,
    from_x: float,
    from_y: float,
    to_x: float,
    to_y: float,
    sense: float,
    radius: float,
) -> tuple[float, float]:
    """How far a disc rolls around a corner before it covers another corner.

    Args:
        touched: Shape (height + 1, width + 1), from `passages.touched_corners`.
        x: Column of the corner.
        y: Row of the corner.
        from_x: Direction from the corner to the disc's centre at first.
        from_y: Its y.
        to_x: The last direction that is wanted.
        to_y: Its y.
        sense: Sense of the roll.
        radius: Radius of the disc, px.

    Returns:
        The last direction that is possible.
    """
    column, row = math.floor(x + 0.5), math.floor(y + 0.5)
    step_x = 1 if from_x + to_x > 0.0 else -1
    step_y = 1 if from_y + to_y > 0.0 else -1
    reach = math.ceil(2.0 * radius)
    for b in range(reach + 1):
        j = row + step_y * b
        if j < 0 or j >= touched.shape[0]:
            break
        for a in range(reach + 1):
            i = column + step_x * a
            if i < 0 or i >= touched.shape[1]:
                break
            if not touched[j, i] or a + b == 0:
                continue
            dx, dy = float(step_x * a), float(step_y * b)
            if sense * cross(from_x, from_y, dx, dy) <= ANGLE:
                continue
            if sense * cross(dx, dy, to_x, to_y) <= ANGLE:
                continue
            cos = _half_angle(math.sqrt(dx * dx + dy * dy), radius)
            if cos >= 1.0:
                continue
            end_x, end_y = _rotated(dx, dy, cos, -sense)
            if sense * cross(from_x, from_y, end_x, end_y) <= 0.0:
                return from_x, from_y
            if sense * cross(end_x, end_y, to_x, to_y) > 0.0:
                to_x, to_y = end_x, end_y
    return to_x, to_y


@subkernel
def is_line_free(
    clear: FloatGrid,
    x: float,
    y: float,
    dx: float,
    dy: float,
    length: float,
    body: float,
) -> bool:
    """Whether a disc of radius `body` touches nothing on a straight line."""
    if not has_room(clear, x, y, body):
        return False
    far, in_doubt = 0.0, False
    while far < length:
        at_x, at_y = x + far * dx, y + far * dy
        i, j = math.floor(at_x + 0.5), math.floor(at_y + 0.5)
        off = math.sqrt((at_x - i) ** 2 + (at_y - j) ** 2) + ROUNDING
        room = clear[j + 1, i + 1] - body
        if room + off < 0.0:
            return False
        if room - off < _SHORT:
            in_doubt = True
        far += max(room - off, _SHORT)
    if not in_doubt:
        return has_room(clear, x + length * dx, y + length * dy, body)
    pieces = math.ceil(length / _PIECE)
    heading, piece = math.atan2(dy, dx), length / pieces
    for k in range(pieces):
        at_x, at_y = x + k * piece * dx, y + k * piece * dy
        if arc_contact(clear, at_x, at_y, heading, piece, 0.0, body) <= 1.0:
            return False
    return True
