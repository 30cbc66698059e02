"""Compiled motion of a disc among prisms, up to its first contact.

Lengths are metres, headings counter-clockwise. `tdac_envs.epuck.gaps` documents the
arguments `points`, `first`, `extent`, `listed`, `begin` and `end`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.drive.sliding import sliding
from tdac_envs.drive.stepping import (
    FRICTION,
    HEADING,
    RADIUS,
    STOPS,
    X,
    Y,
    contact_free_length,
    move,
    wrap_angle,
)
from tdac_envs.epuck.gaps import gap_of
from tdac_envs.epuck.prisms import MID_X, MID_Y, REACH, Array, Index

# As in `tdac_envs.map2d.contact`, but in metres.
SINK = 1e-11
DEEPEST = 1e-10
_CLOSE = 1e-12
# A stopped body is moved back along its arc by this distance, m.
CONTACT_GAP = 1e-9

Near = tuple[Array, Index, Array, Index, int, int]
"""The arguments `points`, `first`, `extent`, `listed`, `begin` and `end`."""


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
        points: See `tdac_envs.epuck.gaps`.
        first: See `tdac_envs.epuck.gaps`.
        extent: See `tdac_envs.epuck.gaps`.
        x: x of the disc's centre.
        y: y of the disc's centre.
        heading: Heading, rad.
        forward: Arc length of the step, negative backwards.
        turn: Change of heading over the step, rad.
        radius: Radius of the disc.

    Returns:
        In [0, 1), or 2.0 if the step is free. Moving away from or along a part that the
        disc already touches does not count as a contact.
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
    """`first_touch` for the listed parts."""
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
    """Arc length to the first part whose gap to the disc falls to `floor`.

    Returns:
        The arc length (that of the whole arc if there is no contact), and the gap at
        the start between the disc and the nearest of the checked parts.
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
def arc_touch(
    near: Near,
    x: float,
    y: float,
    heading: float,
    forward: float,
    turn: float,
    radius: float,
) -> float:
    """`touch_of` for the parts `near`."""
    points, first, extent, listed, begin, end = near
    return touch_of(
        points, first, extent, listed, begin, end,
        x, y, heading, forward, turn, radius,
    )  # fmt: skip


@subkernel
def near_normals(
    near: Near, x: float, y: float, reach: float, normals: NDArray[np.float64]
) -> int:
    """Unit vectors to a point from the listed parts within `reach` of it.

    Args:
        near: The arguments `points`, `first`, `extent`, `listed`, `begin` and `end`.
        x: x of the point.
        y: y of the point.
        reach: Distance.
        normals: Shape (n, 2); its first rows are overwritten.

    Returns:
        The number of vectors, at most n.
    """
    points, first, extent, listed, begin, end = near
    count = 0
    for n in range(begin, end):
        k = listed[n] if listed.shape[0] else n
        gap, away_x, away_y = gap_of(points, first, extent, k, x, y)
        if gap <= reach and count < normals.shape[0]:
            normals[count, 0], normals[count, 1] = away_x, away_y
            count += 1
    return count


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
    """Arc length at which the gap of disc and part falls to `floor`, at most `limit`.

    The method is that of `tdac_envs.map2d.contact._travel`.
    """
    length = abs(forward)
    curvature = abs(turn) / length
    travelled, at_x, at_y, at_heading = 0.0, x, y, heading
    while True:
        gap, away_x, away_y = gap_of(points, first, extent, part, at_x, at_y)
        rest = gap - radius - floor
        along = away_x * math.cos(at_heading) + away_y * math.sin(at_heading)
        approach = math.copysign(1.0, forward) * along
        if travelled == 0.0 and approach >= 0.0 and rest < SINK:
            # A disc that is too deep may still move away.
            floor -= SINK - rest
            rest = SINK
        if rest <= _CLOSE:
            return travelled
        travelled += contact_free_length(rest, approach, curvature)
        if travelled >= limit:
            return limit
        share = travelled / length
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
) -> tuple[bool, float]:
    """Moves a disc along an arc, up to a contact.

    Args:
        points: See `tdac_envs.epuck.gaps`.
        first: See `tdac_envs.epuck.gaps`.
        extent: See `tdac_envs.epuck.gaps`.
        listed: Indices of the parts to check.
        begin: First entry of `listed` to check.
        end: End of these entries.
        state: Begins with x, y and heading, which are overwritten.
        forward: Arc length, m, negative backwards.
        turn: Change of heading, rad.
        radius: Radius of the disc, m.

    Returns:
        Whether it touched a part, and the fraction of the arc that it moved. It is then
        placed `CONTACT_GAP` before the contact, with the heading that it had there.
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
    return bool(touch <= 1.0), share


_slide = sliding(arc_touch, near_normals)


@subkernel
def stop_at_contact(
    near: Near, state: Array, forward: float, turn: float, constants: Array
) -> tuple[bool, float]:
    """Moves the robot along an arc, up to a contact.

    Args:
        near: The arguments `points`, `first`, `extent`, `listed`, `begin` and `end`.
        state: Begins with x, y and heading, which are overwritten.
        forward: Arc length, m, negative backwards.
        turn: Change of heading, rad.
        constants: See `tdac_envs.epuck.robot.EPuckArrays`.

    Returns:
        Whether it touched a part, and the fraction of the arc that its wheels drove.
    """
    points, first, extent, listed, begin, end = near
    return advance(
        points, first, extent, listed, begin, end,
        state, forward, turn, constants[RADIUS],
    )  # fmt: skip


@subkernel
def stop_or_slide(
    near: Near, state: Array, forward: float, turn: float, constants: Array
) -> tuple[bool, float]:
    """As `stop_at_contact`, or along obstacles if contacts do not end the episode.

    The wheels of a robot that slides drive the whole arc.
    """
    if constants[STOPS] == 1.0:
        return stop_at_contact(near, state, forward, turn, constants)
    touched: bool = _slide(
        near, state, forward, turn, constants[RADIUS], constants[FRICTION], CONTACT_GAP
    )
    return touched, 1.0
