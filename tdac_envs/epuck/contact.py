"""Compiled distances to prisms, and motion of a disc up to its first contact.

Lengths are metres, headings counter-clockwise. A set of parts is given by the arrays
`points`, `first` and `extent` of `tdac_envs.epuck.prisms.Prisms`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.compiled import kernel
from tdac_envs.contact import free_way, move, wrap_angle
from tdac_envs.epuck.prisms import MID_X, MID_Y, REACH, ROUND, Array, Index

# As in `tdac_envs.contact`, but in metres: a disc in touch may get this much deeper
# in a step, and no deeper than that in all; a search ends this near.
SINK = 1e-11
DEEPEST = 1e-10
_CLOSE = 1e-12
# A body that was stopped goes back by this much of its way, m.
CONTACT_GAP = 1e-9

X, Y, HEADING = range(3)


@kernel()
def part_gap(
    points: Array, first: Index, extent: Array, part: int, x: float, y: float
) -> tuple[float, float, float]:
    """Signed distance from a point to a part, and the unit vector that leads away."""
    begin, end = first[part], first[part + 1]
    if end - begin == 1:
        off_x, off_y = x - points[begin, 0], y - points[begin, 1]
        far = math.sqrt(off_x * off_x + off_y * off_y)
        if far == 0.0:
            return -extent[part, ROUND], 1.0, 0.0
        return far - extent[part, ROUND], off_x / far, off_y / far
    outside, out_x, out_y = -math.inf, 1.0, 0.0
    square, near_x, near_y = math.inf, 0.0, 0.0
    for i in range(begin, end):
        j = i + 1 if i + 1 < end else begin
        edge_x, edge_y = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
        off_x, off_y = x - points[i, 0], y - points[i, 1]
        length2 = edge_x * edge_x + edge_y * edge_y
        length = math.sqrt(length2)
        side = (edge_y * off_x - edge_x * off_y) / length
        if side > outside:
            outside, out_x, out_y = side, edge_y / length, -edge_x / length
        share = min(max((off_x * edge_x + off_y * edge_y) / length2, 0.0), 1.0)
        off_x, off_y = off_x - share * edge_x, off_y - share * edge_y
        distance2 = off_x * off_x + off_y * off_y
        if distance2 < square:
            square, near_x, near_y = distance2, off_x, off_y
    distance = math.sqrt(square)
    if outside <= 0.0 or distance == 0.0:
        return min(outside, 0.0), out_x, out_y
    return distance, near_x / distance, near_y / distance


@kernel("f8[:,:] i8[:] f8[:,:] f8 f8 -> f8")
def nearest_gap(
    points: Array, first: Index, extent: Array, x: float, y: float
) -> float:
    """Distance from a point to the nearest part, negative within one; inf of none."""
    best = math.inf
    for k in range(extent.shape[0]):
        off = math.hypot(extent[k, MID_X] - x, extent[k, MID_Y] - y)
        if off - extent[k, REACH] < best:
            best = min(best, part_gap(points, first, extent, k, x, y)[0])
    return best


@kernel("f8[:,:] i8[:] f8[:,:] f8 f8 f8 f8[:,:] ->")
def clear_grid(
    points: Array,
    first: Index,
    extent: Array,
    left: float,
    low: float,
    spacing: float,
    clear: Array,
) -> None:
    """Lowers each entry of `clear` to the distance from its point to the parts.

    Args:
        points: See the module.
        first: See the module.
        extent: See the module.
        left: x of `clear[:, 0]`.
        low: y of `clear[0, :]`.
        spacing: Between neighbours.
        clear: Shape (height, width), filled with the largest distance of interest,
            overwritten.
    """
    height, width = clear.shape
    if height * width == 0:
        return
    most = clear[0, 0]
    for k in range(extent.shape[0]):
        reach = most + extent[k, ROUND]
        x0 = x1 = points[first[k], 0]
        y0 = y1 = points[first[k], 1]
        for i in range(first[k], first[k + 1]):
            x0, x1 = min(x0, points[i, 0]), max(x1, points[i, 0])
            y0, y1 = min(y0, points[i, 1]), max(y1, points[i, 1])
        for v in range(
            max(math.floor((y0 - reach - low) / spacing), 0),
            min(math.ceil((y1 + reach - low) / spacing) + 1, height),
        ):
            for u in range(
                max(math.floor((x0 - reach - left) / spacing), 0),
                min(math.ceil((x1 + reach - left) / spacing) + 1, width),
            ):
                x, y = left + u * spacing, low + v * spacing
                gap = part_gap(points, first, extent, k, x, y)[0]
                clear[v, u] = min(clear[v, u], gap)


@kernel("f8[:,:] i8[:] f8[:,:] f8 f8 f8 f8 f8 f8 -> f8")
def first_touch(
    points: Array,
    first: Index,
    extent: Array,
    x: float,
    y: float,
    heading: float,
    forward: float,
    turn: float,
    radius: float,
) -> float:
    """Fraction of a step at which a disc first touches a part.

    Exact for the arc of constant wheel speeds, to 1e-11 m.

    Args:
        points: See the module.
        first: See the module.
        extent: See the module.
        x: Of the disc's centre.
        y: Of the disc's centre.
        heading: rad.
        forward: Arc length of the step, negative backwards.
        turn: Change of heading over the step, rad.
        radius: Of the disc.

    Returns:
        In [0, 1); 2.0 where the step is free. A disc that starts in touch and moves
        away or along is free.
    """
    length = abs(forward)
    if length == 0.0:
        return 2.0
    best, gap = _scan(points, first, extent, x, y, heading, forward, turn, radius, 0.0)
    if gap < SINK:
        floor = max(gap - SINK, -DEEPEST)
        best, _ = _scan(
            points, first, extent, x, y, heading, forward, turn, radius, floor
        )
    return best / length if best < length else 2.0


@kernel()
def _scan(
    points: Array,
    first: Index,
    extent: Array,
    x: float,
    y: float,
    heading: float,
    forward: float,
    turn: float,
    radius: float,
    floor: float,
) -> tuple[float, float]:
    """Way to the first part that the disc gets into by more than `-floor`.

    Returns:
        The way along the arc, and the gap at its start to the nearest of the parts
        that were looked at.
    """
    best, nearest = abs(forward), math.inf
    for k in range(extent.shape[0]):
        off = math.hypot(extent[k, MID_X] - x, extent[k, MID_Y] - y)
        if off - extent[k, REACH] - radius < best:
            gap = part_gap(points, first, extent, k, x, y)[0] - radius
            nearest = min(nearest, gap)
            if gap < best:
                best = _travel(
                    points, first, extent, k,
                    x, y, heading, forward, turn, radius, floor, best,
                )  # fmt: skip
    return best, nearest


@kernel()
def _travel(
    points: Array,
    first: Index,
    extent: Array,
    part: int,
    x: float,
    y: float,
    heading: float,
    forward: float,
    turn: float,
    radius: float,
    floor: float,
    limit: float,
) -> float:
    """Way along the arc until the disc's gap to a part falls to `floor`.

    The distance to a convex body is convex along a straight line, and an arc leaves
    its tangent by at most k h^2 / 2; see `tdac_envs.contact` for the search.

    Returns:
        At most `limit`, where there is no contact before it.
    """
    length = abs(forward)
    curvature = abs(turn) / length
    way, at_x, at_y, at_heading = 0.0, x, y, heading
    while True:
        gap, away_x, away_y = part_gap(points, first, extent, part, at_x, at_y)
        rest = gap - radius - floor
        along = away_x * math.cos(at_heading) + away_y * math.sin(at_heading)
        approach = math.copysign(1.0, forward) * along
        if way == 0.0 and approach >= 0.0 and rest < SINK:
            # Even a disc that is too deep may leave.
            floor -= SINK - rest
            rest = SINK
        if rest <= _CLOSE:
            return way
        way += free_way(rest, approach, curvature)
        if way >= limit:
            return limit
        share = way / length
        at_x, at_y, at_heading = move(x, y, heading, share * forward, share * turn)


@kernel("f8[:,:] i8[:] f8[:,:] f8[:] f8 f8 f8 -> b1")
def advance(
    points: Array,
    first: Index,
    extent: Array,
    state: NDArray[np.float64],
    forward: float,
    turn: float,
    radius: float,
) -> bool:
    """Moves a disc along an arc, up to a contact.

    Args:
        points: See the module.
        first: See the module.
        extent: See the module.
        state: Begins with x, y and heading, which are overwritten.
        forward: Arc length, m, negative backwards.
        turn: Change of heading, rad.
        radius: Of the disc, m.

    Returns:
        Whether it touched a part. It then stands `CONTACT_GAP` before the touching
        pose, with the heading that it had there.
    """
    x, y, heading = state[X], state[Y], state[HEADING]
    touch = first_touch(points, first, extent, x, y, heading, forward, turn, radius)
    share = 1.0
    if touch <= 1.0:
        share = max(touch - CONTACT_GAP / abs(forward), 0.0)
    x, y, heading = move(x, y, heading, share * forward, share * turn)
    state[X], state[Y], state[HEADING] = x, y, wrap_angle(heading)
    return bool(touch <= 1.0)
