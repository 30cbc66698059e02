"""Compiled ORCA: the velocity that avoids others who avoid one in turn.

Optimal reciprocal collision avoidance (van den Berg, Guy, Lin and Manocha, 2011): each
neighbour forbids a half-plane of velocities, and a linear program finds the permitted
velocity nearest to the preferred one. If there is none, it finds the velocity that
enters the forbidden half-planes by the least distance; those of walls stay forbidden.

A half-plane is a row of an array: a point on its border, and the unit vector along the
border that has the permitted velocities on its left, in a frame whose y axis points up.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, subkernel

Array = NDArray[np.float64]

POINT_X, POINT_Y, ALONG_X, ALONG_Y = range(4)
N_PLANE = 4
# Borders are parallel below this sine of their angle.
_PARALLEL = 1e-9


@subkernel
def neighbour_plane(
    off_x: float, off_y: float, rate_x: float, rate_y: float, reach: float,
    horizon: float, dt: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """By how much the relative velocity of two discs must change for no contact.

    Args:
        off_x: Place of the other disc, seen from this one, px.
        off_y: px.
        rate_x: Velocity of this disc less that of the other, px/s.
        rate_y: px/s.
        reach: Sum of the radii, px.
        horizon: Time for which there must be no contact, s.
        dt: Time within which discs that overlap must part, s.

    Returns:
        The smallest change that reaches the border of the velocity obstacle, px/s, and
        the unit vector along this border, as in a half-plane.
    """
    far2, reach2 = off_x * off_x + off_y * off_y, reach * reach
    apart = far2 > reach2
    time = horizon if apart else dt
    # Relative to the centre of the disc that cuts off the cone.
    cut_x, cut_y = rate_x - off_x / time, rate_y - off_y / time
    cut2 = cut_x * cut_x + cut_y * cut_y
    ahead = cut_x * off_x + cut_y * off_y
    if not apart or (ahead < 0.0 and ahead * ahead > reach2 * cut2):
        cut = math.sqrt(cut2)
        unit_x, unit_y = (cut_x / cut, cut_y / cut) if cut > 0.0 else (1.0, 0.0)
        short = reach / time - cut
        return short * unit_x, short * unit_y, unit_y, -unit_x
    leg = math.sqrt(far2 - reach2)
    if off_x * cut_y - off_y * cut_x > 0.0:
        along_x = (off_x * leg - off_y * reach) / far2
        along_y = (off_x * reach + off_y * leg) / far2
    else:
        along_x = -(off_x * leg + off_y * reach) / far2
        along_y = -(off_y * leg - off_x * reach) / far2
    on_leg = rate_x * along_x + rate_y * along_y
    return on_leg * along_x - rate_x, on_leg * along_y - rate_y, along_x, along_y


@subkernel
def add_plane(
    planes: Array, count: int, x: float, y: float, along_x: float, along_y: float
) -> int:
    """Writes a half-plane in row `count`; returns the number of rows then in use."""
    planes[count, POINT_X], planes[count, POINT_Y] = x, y
    planes[count, ALONG_X], planes[count, ALONG_Y] = along_x, along_y
    return count + 1


@subkernel
def add_neighbour(
    planes: Array, count: int, off_x: float, off_y: float, rate_x: float,
    rate_y: float, other_x: float, other_y: float, reach: float, share: float,
    horizon: float, dt: float,
) -> int:  # fmt: skip
    """Writes the half-plane of another disc; returns the number of rows then in use.

    Args:
        planes: The half-planes.
        count: The row to write.
        off_x: Place of the other disc, seen from this one, px.
        off_y: px.
        rate_x: Velocity of this disc, px/s.
        rate_y: px/s.
        other_x: Velocity of the other disc, px/s.
        other_y: px/s.
        reach: Sum of the radii, px.
        share: Part of the change that this disc takes.
        horizon: As for `neighbour_plane`.
        dt: As for `neighbour_plane`.
    """
    more_x, more_y, along_x, along_y = neighbour_plane(
        off_x, off_y, rate_x - other_x, rate_y - other_y, reach, horizon, dt
    )
    x, y = rate_x + share * more_x, rate_y + share * more_y
    return add_plane(planes, count, x, y, along_x, along_y)


@subkernel
def _outside(planes: Array, k: int, x: float, y: float) -> float:
    """Distance by which a velocity is in the forbidden half; negative if permitted."""
    off_x, off_y = planes[k, POINT_X] - x, planes[k, POINT_Y] - y
    return float(planes[k, ALONG_X] * off_y - planes[k, ALONG_Y] * off_x)


@subkernel
def _best_on_border(
    planes: Array, first: int, k: int, limit: float, x: float, y: float, far: bool
) -> tuple[bool, float, float]:
    """`_best` on the border of plane k, with the planes from `first` up to k."""
    at_x, at_y = planes[k, POINT_X], planes[k, POINT_Y]
    along_x, along_y = planes[k, ALONG_X], planes[k, ALONG_Y]
    middle = at_x * along_x + at_y * along_y
    half2 = middle * middle + limit * limit - at_x * at_x - at_y * at_y
    if half2 < 0.0:
        return False, 0.0, 0.0
    half = math.sqrt(half2)
    low, high = -middle - half, half - middle
    for other in range(first, k):
        other_x, other_y = planes[other, ALONG_X], planes[other, ALONG_Y]
        sine = along_x * other_y - along_y * other_x
        excess = other_x * (at_y - planes[other, POINT_Y])
        excess -= other_y * (at_x - planes[other, POINT_X])
        if abs(sine) <= _PARALLEL:
            if excess < 0.0:
                return False, 0.0, 0.0
            continue
        cross = excess / sine
        if sine > 0.0:
            high = min(high, cross)
        else:
            low = max(low, cross)
        if low > high:
            return False, 0.0, 0.0
    if far:
        part = high if x * along_x + y * along_y > 0.0 else low
    else:
        part = along_x * (x - at_x) + along_y * (y - at_y)
        part = min(max(part, low), high)
    return True, at_x + part * along_x, at_y + part * along_y


@subkernel
def _best(
    planes: Array, first: int, end: int, limit: float, x: float, y: float, far: bool
) -> tuple[int, float, float]:
    """The permitted velocity nearest to (x, y), or the farthest in that direction.

    Args:
        planes: The half-planes.
        first: Row of the first one.
        end: The row after the last one.
        limit: Largest speed.
        x: The preferred velocity, or a unit vector.
        y: The other component.
        far: Whether (x, y) is a direction.

    Returns:
        `end` and the velocity; or the row of the plane that permits nothing, and the
        best velocity for those before it.
    """
    speed2 = x * x + y * y
    best_x, best_y = x, y
    if far:
        best_x, best_y = limit * x, limit * y
    elif speed2 > limit * limit:
        scale = limit / math.sqrt(speed2)
        best_x, best_y = scale * x, scale * y
    for k in range(first, end):
        if _outside(planes, k, best_x, best_y) > 0.0:
            found, new_x, new_y = _best_on_border(planes, first, k, limit, x, y, far)
            if not found:
                return k, best_x, best_y
            best_x, best_y = new_x, new_y
    return end, best_x, best_y


@subkernel
def _relaxed(
    planes: Array, walls: int, count: int, begin: int, limit: float, x: float, y: float
) -> tuple[float, float]:
    """The velocity that enters the half-planes by the least distance.

    Args:
        planes: The half-planes, those of walls first; rows from `count` on are
            overwritten.
        walls: Number of walls.
        count: Number of half-planes.
        begin: The first one that permits nothing.
        limit: Largest speed.
        x: The best velocity for those before it.
        y: The other component.
    """
    depth = 0.0
    for k in range(begin, count):
        if _outside(planes, k, x, y) <= depth:
            continue
        at_x, at_y = planes[k, POINT_X], planes[k, POINT_Y]
        along_x, along_y = planes[k, ALONG_X], planes[k, ALONG_Y]
        end = count
        for other in range(walls):
            end = add_plane(
                planes, end, planes[other, POINT_X], planes[other, POINT_Y],
                planes[other, ALONG_X], planes[other, ALONG_Y],
            )  # fmt: skip
        # Where it is entered no deeper than plane k.
        for other in range(walls, k):
            other_x, other_y = planes[other, ALONG_X], planes[other, ALONG_Y]
            sine = along_x * other_y - along_y * other_x
            if abs(sine) <= _PARALLEL:
                if along_x * other_x + along_y * other_y > 0.0:
                    continue
                mid_x = 0.5 * (at_x + planes[other, POINT_X])
                mid_y = 0.5 * (at_y + planes[other, POINT_Y])
            else:
                cross = other_x * (at_y - planes[other, POINT_Y])
                cross -= other_y * (at_x - planes[other, POINT_X])
                cross /= sine
                mid_x, mid_y = at_x + cross * along_x, at_y + cross * along_y
            off_x, off_y = other_x - along_x, other_y - along_y
            off = math.sqrt(off_x * off_x + off_y * off_y)
            end = add_plane(planes, end, mid_x, mid_y, off_x / off, off_y / off)
        stopped, new_x, new_y = _best(
            planes, count, end, limit, -along_y, along_x, True
        )
        if stopped == end:
            x, y = new_x, new_y
        depth = _outside(planes, k, x, y)
    return x, y


@subkernel
def chosen_velocity(
    planes: Array, walls: int, count: int, limit: float, x: float, y: float
) -> tuple[float, float]:
    """The velocity that ORCA chooses.

    Args:
        planes: Shape (at least 2 * count, 4): the half-planes, those of walls first;
            rows from `count` on are overwritten.
        walls: Number of half-planes of walls.
        count: Number of half-planes.
        limit: Largest speed, px/s.
        x: The preferred velocity, px/s.
        y: px/s.
    """
    stopped, new_x, new_y = _best(planes, 0, count, limit, x, y, False)
    if stopped < count:
        return _relaxed(planes, walls, count, stopped, limit, new_x, new_y)
    return new_x, new_y


@kernel
def velocity_among(
    discs: Array, preferred: Array, horizon: float, limit: float, dt: float, out: Array
) -> None:
    """The velocity of the first of some discs, all of which take half of a change.

    Args:
        discs: Shape (n, 5): x, y, velocity, radius; the neighbours in the order of
            their distances.
        preferred: Shape (2,): preferred velocity of the first disc, px/s.
        horizon: Time for which there must be no contact, s.
        limit: Largest speed, px/s.
        dt: Duration of a step, s.
        out: Shape (2,), overwritten with the velocity, px/s.
    """
    planes = np.empty((2 * len(discs), N_PLANE))
    x, y, rate_x, rate_y, radius = discs[0]
    count = 0
    for k in range(1, len(discs)):
        count = add_neighbour(
            planes, count, discs[k, 0] - x, discs[k, 1] - y, rate_x, rate_y,
            discs[k, 2], discs[k, 3], radius + discs[k, 4], 0.5, horizon, dt,
        )  # fmt: skip
    out[0], out[1] = chosen_velocity(
        planes, 0, count, limit, preferred[0], preferred[1]
    )
