"""Compiled test of a moving disc for its first contact with occupied squares.

`clear` is the clearance of a map, from `grid.clearance`, padded with zeros.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.drive.stepping import contact_free_length, move
from tdac_envs.grid.grid import FloatGrid

# A disc that starts in contact is stopped once it sinks in by this much, px, so that
# it can slide along a wall.
SINK = 1e-8
# Repeated steps never sink deeper than this in total, px.
DEEPEST = 1e-7
# The search for a contact stops at this distance, px.
_CLOSE = 1e-9
# Margin for the float32 rounding of the clearance field, px.
ROUNDING = 1e-3


@kernel
def first_contact(
    clear: FloatGrid,
    x: float,
    y: float,
    heading: float,
    forward: float,
    turn: float,
    radius: float,
) -> float:
    """Fraction of a step at which a disc first touches an occupied square.

    Exact for the arc of constant wheel speeds, to 1e-8 px.

    Args:
        clear: Padded clearance, px.
        x: Column of the disc's centre, px.
        y: Row of the disc's centre, px.
        heading: rad, from +x towards +y.
        forward: Arc length of the step, px, negative backwards.
        turn: Change of heading over the step, rad.
        radius: Disc radius, px.

    Returns:
        In [0, 1), or 2.0 if the step is free. Moving away from or along a wall that the
        disc already touches does not count as a contact.
    """
    return arc_contact(clear, x, y, heading, forward, turn, radius)


@subkernel
def contact_before(
    clear: FloatGrid,
    x: float,
    y: float,
    heading: float,
    forward: float,
    turn: float,
    radius: float,
    end_x: float,
    end_y: float,
) -> float:
    """`first_contact`, given the point where the step ends."""
    length = abs(forward)
    if length == 0.0:
        return 2.0
    # The arc is free within the clearance of each end.
    open_at_start = max(least_room(clear, x, y) - radius, 0.0)
    open_at_end = max(least_room(clear, end_x, end_y) - radius, 0.0)
    if open_at_start + open_at_end > length:
        return 2.0
    best, gap = _scan(clear, x, y, heading, forward, turn, radius, 0.0)
    if gap < SINK:
        floor = max(gap - SINK, -DEEPEST)
        best, _ = _scan(clear, x, y, heading, forward, turn, radius, floor)
    return best / length if best < length else 2.0


@subkernel
def _scan(
    clear: FloatGrid,
    x: float,
    y: float,
    heading: float,
    forward: float,
    turn: float,
    radius: float,
    floor: float,
) -> tuple[float, float]:
    """Arc length to the first square whose gap to the disc falls to `floor` px.

    Returns:
        The arc length, px (that of the whole arc if there is no contact), and the gap
        at the start between the disc and the nearest of the checked squares, px.
    """
    end_x, end_y, _ = move(x, y, heading, forward, turn)
    best = abs(forward)
    # Bound on how far the arc leaves the bounding box of its two ends.
    swing = 0.5 * best * min(1.0, 0.25 * abs(turn))
    reach = radius + swing + ROUNDING
    left, right = min(x, end_x), max(x, end_x)
    top, bottom = min(y, end_y), max(y, end_y)
    first_row = max(math.ceil(top - reach - 0.5), -1)
    last_row = min(math.floor(bottom + reach + 0.5), clear.shape[0] - 2)
    nearest = math.inf
    for j in range(first_row, last_row + 1):
        above = max(j - 0.5 - bottom, top - j - 0.5, 0.0)
        span = math.sqrt(max(reach * reach - above * above, 0.0)) + 0.5
        i = max(math.ceil(left - span), -1)
        last = min(math.floor(right + span), clear.shape[1] - 2)
        while i <= last:
            room = clear[j + 1, i + 1]
            if room > 0.0:
                # No square in this row can be nearer than the clearance.
                i += max(math.ceil(room + 0.5 - ROUNDING), 1)
                continue
            if is_edge(clear, i + 1, j + 1):
                gap = math.sqrt(square_distance2(x, y, i, j)) - radius
                nearest = min(nearest, gap)
                if gap < best:
                    best = _travel(
                        x, y, heading, forward, turn, i, j, radius, floor, best
                    )
            i += 1
    return best, nearest


@subkernel
def arc_contact(
    clear: FloatGrid,
    x: float,
    y: float,
    heading: float,
    forward: float,
    turn: float,
    radius: float,
) -> float:
    """`first_contact` for other compiled code."""
    end_x, end_y, _ = move(x, y, heading, forward, turn)
    return contact_before(clear, x, y, heading, forward, turn, radius, end_x, end_y)


@subkernel
def near_normals(
    clear: FloatGrid, x: float, y: float, reach: float, normals: NDArray[np.float64]
) -> int:
    """Unit vectors to a point from the occupied squares within `reach` px of it.

    Args:
        clear: Padded clearance, px.
        x: Column of the point, px.
        y: Row of the point, px.
        reach: Distance, px.
        normals: Shape (n, 2); its first rows are overwritten.

    Returns:
        The number of vectors, at most n.
    """
    count = 0
    for j in range(math.ceil(y - reach - 0.5), math.floor(y + reach + 0.5) + 1):
        for i in range(math.ceil(x - reach - 0.5), math.floor(x + reach + 0.5) + 1):
            inside = -1 <= i < clear.shape[1] - 1 and -1 <= j < clear.shape[0] - 1
            if not inside or clear[j + 1, i + 1] > 0.0 or count == normals.shape[0]:
                continue
            distance = math.sqrt(square_distance2(x, y, i, j))
            if 0.0 < distance <= reach:
                normals[count, 0] = (x - max(i - 0.5, min(x, i + 0.5))) / distance
                normals[count, 1] = (y - max(j - 0.5, min(y, j + 0.5))) / distance
                count += 1
    return count


@subkernel
def opposing_normal(
    clear: FloatGrid, x: float, y: float, reach: float, vx: float, vy: float
) -> tuple[float, float]:
    """Unit vector to a point from the nearest square that is in the way of a velocity.

    Args:
        clear: Padded clearance, px.
        x: Column of the point, px.
        y: Row of the point, px.
        reach: Largest distance of the square, px.
        vx: Velocity, in any unit.
        vy: Velocity.

    Returns:
        (0, 0) if there is no such square.
    """
    nearest, best_x, best_y = reach, 0.0, 0.0
    for j in range(math.ceil(y - reach - 0.5), math.floor(y + reach + 0.5) + 1):
        for i in range(math.ceil(x - reach - 0.5), math.floor(x + reach + 0.5) + 1):
            inside = -1 <= i < clear.shape[1] - 1 and -1 <= j < clear.shape[0] - 1
            if not inside or clear[j + 1, i + 1] > 0.0:
                continue
            off_x = x - max(i - 0.5, min(x, i + 0.5))
            off_y = y - max(j - 0.5, min(y, j + 0.5))
            distance = math.sqrt(off_x * off_x + off_y * off_y)
            if 0.0 < distance <= nearest and off_x * vx + off_y * vy < 0.0:
                nearest, best_x, best_y = distance, off_x / distance, off_y / distance
    return best_x, best_y


@subkernel
def square_distance2(x: float, y: float, i: int, j: int) -> float:
    """Square of the distance from a point to pixel (i, j)."""
    dx = max(abs(x - i) - 0.5, 0.0)
    dy = max(abs(y - j) - 0.5, 0.0)
    return dx * dx + dy * dy


@subkernel
def has_room(clear: FloatGrid, x: float, y: float, radius: float) -> bool:
    """Whether a point is at least `radius` px from every occupied square."""
    for j in range(math.ceil(y - radius - 0.5), math.floor(y + radius + 0.5) + 1):
        for i in range(math.ceil(x - radius - 0.5), math.floor(x + radius + 0.5) + 1):
            inside = -1 <= i < clear.shape[1] - 1 and -1 <= j < clear.shape[0] - 1
            occupied = not inside or clear[j + 1, i + 1] == 0.0
            if occupied and square_distance2(x, y, i, j) < radius * radius:
                return False
    return True


@subkernel
def least_room(clear: FloatGrid, x: float, y: float) -> float:
    """Lower bound of the distance from a point to the nearest occupied square."""
    i, j = math.floor(x + 0.5), math.floor(y + 0.5)
    if i < 0 or j < 0 or j >= clear.shape[0] - 2 or i >= clear.shape[1] - 2:
        return 0.0
    off_x, off_y = x - i, y - j
    off = math.sqrt(off_x * off_x + off_y * off_y)
    return float(clear[j + 1, i + 1]) - off - ROUNDING


@subkernel
def most_room(clear: FloatGrid, x: float, y: float) -> float:
    """Upper bound of the distance from a point to the nearest occupied square."""
    i, j = math.floor(x + 0.5), math.floor(y + 0.5)
    if i < 0 or j < 0 or j >= clear.shape[0] - 2 or i >= clear.shape[1] - 2:
        return float(clear.shape[0] + clear.shape[1])
    off_x, off_y = x - i, y - j
    off = math.sqrt(off_x * off_x + off_y * off_y)
    return float(clear[j + 1, i + 1]) + off + ROUNDING


@subkernel
def is_edge(clear: FloatGrid, i: int, j: int) -> bool:
    """Whether pixel (i, j) of the padded map has a free 4-neighbour.

    The first contact with a union of squares is always with such a square.
    """
    height, width = clear.shape
    return bool(
        (i > 0 and clear[j, i - 1] > 0.0)
        or (j > 0 and clear[j - 1, i] > 0.0)
        or (i + 1 < width and clear[j, i + 1] > 0.0)
        or (j + 1 < height and clear[j + 1, i] > 0.0)
    )


@subkernel
def _travel(
    x: float,
    y: float,
    heading: float,
    forward: float,
    turn: float,
    i: int,
    j: int,
    radius: float,
    floor: float,
    limit: float,
) -> float:
    """Arc length at which the gap of disc and square falls to `floor`, at most `limit`.

    The distance to a convex body is convex along a straight line, and an arc of
    curvature k is at most k h^2 / 2 away from its tangent after h px. So
    `d + d' h - k h^2 / 2` bounds the distance from below, and going from root to
    root of this bound never jumps over a contact and converges quadratically.
    """
    length = abs(forward)
    curvature = abs(turn) / length
    travelled, at_x, at_y, at_heading = 0.0, x, y, heading
    while True:
        off_x = at_x - max(i - 0.5, min(at_x, i + 0.5))
        off_y = at_y - max(j - 0.5, min(at_y, j + 0.5))
        distance = math.sqrt(off_x * off_x + off_y * off_y)
        rest = distance - radius - floor
        approach = -1.0
        if distance > 0.0:
            along = off_x * math.cos(at_heading) + off_y * math.sin(at_heading)
            approach = math.copysign(1.0, forward) * along / distance
        if travelled == 0.0 and approach >= 0.0 and rest < SINK:
            # A disc that is too deep may still move away.
            floor -= SINK - rest
            rest = SINK
        if rest <= _CLOSE:
            return travelled
        travelled += contact_free_length(rest, approach, curvature)
        if travelled >= limit:
            return limit
        part = travelled / length
        at_x, at_y, at_heading = move(x, y, heading, part * forward, part * turn)
