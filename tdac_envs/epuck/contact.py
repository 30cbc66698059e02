"""Compiled motion of a disc among prisms, up to its first contact.

Headings are counter-clockwise; lengths and sets of parts are as in
`tdac_envs.epuck.gaps`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.drive.stepping import free_way, move, wrap_angle
from tdac_envs.epuck.gaps import gap_of
from tdac_envs.epuck.prisms import MID_X, MID_Y, REACH, Array, Index

# As in `tdac_envs.map2d.contact`, but in metres: a disc in touch may get this much
# deeper  in a step, and no deeper than that in all; a search ends this near.
SINK = 1e-11
DEEPEST = 1e-10
_CLOSE = 1e-12
# A body that was stopped goes back by this much of its way, m.
CONTACT_GAP = 1e-9

X, Y, HEADING = range(3)


@kernel
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
    return touch_of(
        points, first, extent, first[:0], 0, extent.shape[0],
        x, y, heading, forward, turn, radius,
    )  # fmt: skip


@subkernel
def touch_of(
    points: Array,
    first: Index,
    extent: Array,
    listed: Index,
    begin: int,
    end: int,
    x: float,
    y: float,
    heading: float,
    forward: float,
    turn: float,
    radius: float,
) -> float:
    """As `first_touch`, of the listed parts."""
    length = abs(forward)
    if length == 0.0:
        return 2.0
    best, gap = _scan(
        points, first, extent, listed, begin, end,
        x, y, heading, forward, turn, radius, 0.0,
    )  # fmt: skip
    if gap < SINK:
        floor = max(gap - SINK, -DEEPEST)
        best, _ = _scan(
            points, first, extent, listed, begin, end,
            x, y, heading, forward, turn, radius, floor,
        )  # fmt: skip
    return best / length if best < length else 2.0


@subkernel
def _scan(
    points: Array,
    first: Index,
    extent: Array,
    listed: Index,
    begin: int,
    end: int,
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
    for n in range(begin, end):
        k = listed[n] if listed.shape[0] else n
        off_x, off_y = extent[k, MID_X] - x, extent[k, MID_Y] - y
        off = math.sqrt(off_x * off_x + off_y * off_y)
        if off - extent[k, REACH] - radius < best:
            gap = gap_of(points, first, extent, k, x, y)[0] - radius
            nearest = min(nearest, gap)
            if gap < best:
                best = _travel(
                    points, first, extent, k,
                    x, y, heading, forward, turn, radius, floor, best,
                )  # fmt: skip
    return best, nearest


@subkernel
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
    its tangent by at most k h^2 / 2; see `tdac_envs.map2d.contact` for the search.

    Returns:
        At most `limit`, where there is no contact before it.
    """
    length = abs(forward)
    curvature = abs(turn) / length
    way, at_x, at_y, at_heading = 0.0, x, y, heading
    while True:
        gap, away_x, away_y = gap_of(points, first, extent, part, at_x, at_y)
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


@subkernel
def advance(
    points: Array,
    first: Index,
    extent: Array,
    listed: Index,
    begin: int,
    end: int,
    state: NDArray[np.float64],
    forward: float,
    turn: float,
    radius: float,
) -> bool:
    """Moves a disc along an arc, up to a contact.

    Args:
        points: See the module, as the next five.
        first: Of the parts.
        extent: Of the parts.
        listed: Numbers of the parts that count.
        begin: In `listed`.
        end: In `listed`.
        state: Begins with x, y and heading, which are overwritten.
        forward: Arc length, m, negative backwards.
        turn: Change of heading, rad.
        radius: Of the disc, m.

    Returns:
        Whether it touched a part. It then stands `CONTACT_GAP` before the touching
        pose, with the heading that it had there.
    """
    x, y, heading = state[X], state[Y], state[HEADING]
    touch = touch_of(
        points, first, extent, listed, begin, end,
        x, y, heading, forward, turn, radius,
    )  # fmt: skip
    share = 1.0
    if touch <= 1.0:
        share = max(touch - CONTACT_GAP / abs(forward), 0.0)
    x, y, heading = move(x, y, heading, share * forward, share * turn)
    state[X], state[Y], state[HEADING] = x, y, wrap_angle(heading)
    return bool(touch <= 1.0)
