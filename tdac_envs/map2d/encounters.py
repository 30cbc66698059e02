"""Compiled encounters of a robot with moving discs: first contacts, and rays.

`tdac_envs.movers` describes the phases of a step, `tdac_envs.movers.state` the arrays.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.drive.stepping import Array, contact_free_length, move
from tdac_envs.grid.grid import FloatGrid
from tdac_envs.map2d.contact import (
    arc_contact,
    has_room,
    near_normals,
    opposing_normal,
)
from tdac_envs.map2d.rays import LeapGrid, in_sight
from tdac_envs.movers import state as at
from tdac_envs.movers.crowd import crowding
from tdac_envs.movers.motion import moving
from tdac_envs.movers.state import hold, stop
from tdac_envs.movers.walls import Cells

# The search for a contact stops at this distance, px: the time of a contact that is
# 1e-6 px deep is then exact to 1e-9 of a step.
_CLOSE = 1e-12
# ... or at this part of a step.
_SHORT = 1e-14
# Discs that touch and move apart may come closer by this, px, on an arc.
_SINK = 1e-9
# Discs touch within this distance, px.
TOUCH = 1e-6
NEVER = 2.0
# A coordinate far outside of any map, px.
_FAR = 1e9
LOOK = 0.05
"""Duration of the steps with which a mover's future is computed, s."""

plan, plan_one, advance_straight = moving(arc_contact, opposing_normal)
plan_crowd = crowding(advance_straight, opposing_normal, in_sight)


@subkernel
def begin_arc(
    path: Array,
    row: int,
    time: float,
    x: float,
    y: float,
    heading: float,
    forward: float,
    turn: float,
) -> None:
    """Writes a row of `Movers.path`; see there."""
    path[row, at.TIME], path[row, at.FROM_X], path[row, at.FROM_Y] = time, x, y
    path[row, at.HEADING], path[row, at.FORWARD], path[row, at.TURN] = (
        heading, forward, turn,
    )  # fmt: skip


@subkernel
def pose_at(path: Array, time: float) -> tuple[int, float, float, float]:
    """The arc in which the robot is at a fraction of the step, and its pose."""
    row = 0
    while path[row + 1, at.TIME] < time:
        row += 1
    since = time - path[row, at.TIME]
    x, y, heading = move(
        path[row, at.FROM_X], path[row, at.FROM_Y], path[row, at.HEADING],
        since * path[row, at.FORWARD], since * path[row, at.TURN],
    )  # fmt: skip
    return row, x, y, heading


@subkernel
def meeting(
    path: Array,
    pieces: Array,
    m: int,
    reach: float,
    begin: float,
    until: float,
) -> float:
    """Fraction of the step at which the robot and mover m first touch, or `NEVER`.

    Discs that touch and move apart do not count as a contact.

    Args:
        path: `Movers.path`.
        pieces: `Movers.pieces`.
        m: The mover.
        reach: Sum of the two radii, px.
        begin: Fraction of the step at which the search begins.
        until: Fraction at which it ends.
    """
    time, arc, piece = begin, 0, 0
    while time < until:
        while path[arc + 1, at.TIME] <= time:
            arc += 1
        while pieces[m, piece + 1, at.TIME] <= time:
            piece += 1
        end = min(path[arc + 1, at.TIME], pieces[m, piece + 1, at.TIME], until)
        touch = _meeting_of_pieces(path, arc, pieces, m, piece, reach, time, end)
        if touch <= end:
            return touch
        time = end
    return NEVER


@subkernel
def _meeting_of_pieces(
    path: Array,
    arc: int,
    pieces: Array,
    m: int,
    piece: int,
    reach: float,
    time: float,
    end: float,
) -> float:
    """`meeting` during one arc of the robot and one piece of mover m.

    The distance of two points is convex while both move straight. The robot leaves its
    tangent by at most `forward * turn * h**2 / 2` in the time h, which bounds the
    distance from below. Going from root to root of this bound never jumps over a
    contact and converges quadratically.
    """
    forward, turn = path[arc, at.FORWARD], path[arc, at.TURN]
    rate_x, rate_y = pieces[m, piece, at.RATE_X], pieces[m, piece, at.RATE_Y]
    bend = abs(forward * turn)
    while True:
        since = time - path[arc, at.TIME]
        x, y, heading = move(
            path[arc, at.FROM_X], path[arc, at.FROM_Y], path[arc, at.HEADING],
            since * forward, since * turn,
        )  # fmt: skip
        since = time - pieces[m, piece, at.TIME]
        off_x = x - (pieces[m, piece, at.FROM_X] + since * rate_x)
        off_y = y - (pieces[m, piece, at.FROM_Y] + since * rate_y)
        distance = math.sqrt(off_x * off_x + off_y * off_y)
        along_x = forward * math.cos(heading) - rate_x
        along_y = forward * math.sin(heading) - rate_y
        approach = off_x * along_x + off_y * along_y
        approach = approach / distance if distance > 0.0 else -1.0
        rest = distance - reach
        if rest <= _CLOSE:
            if approach < 0.0:
                return time
            reach = distance - _SINK
            rest = _SINK
        free = contact_free_length(rest, approach, bend)
        if free < _SHORT:
            return time
        time += free
        if time >= end:
            return NEVER


@subkernel
def first_meeting(
    traits: Array, now: Array, pieces: Array, path: Array, radius: float,
    length: float, dt: float, until: float,
) -> tuple[float, int]:  # fmt: skip
    """Fraction of the step at which the robot first touches a mover, and which one.

    Args:
        traits: `Movers.traits`; the arrays after it are those of `Movers`, too.
        now: Places at the start of the step.
        pieces: Motion of the movers.
        path: Motion of the robot.
        radius: Radius of the robot, px.
        length: Largest distance of the robot from its start, px.
        dt: Duration of the step, s.
        until: Fraction of the step at which the search ends.

    Returns:
        `NEVER` and -1 without a contact.
    """
    x, y, first, who = path[0, at.FROM_X], path[0, at.FROM_Y], NEVER, -1
    for m in range(traits.shape[0]):
        off_x, off_y = now[m, at.X] - x, now[m, at.Y] - y
        reach = radius + traits[m, at.RADIUS]
        far = reach + length + traits[m, at.SPEED] * dt + TOUCH
        if off_x * off_x + off_y * off_y <= far * far:
            touch = meeting(path, pieces, m, reach, 0.0, until)
            if touch < first:
                first = until = touch
                who = m
    return first, who


@subkernel
def hold_pressing(
    traits: Array, now: Array, pieces: Array, x: float, y: float, radius: float
) -> bool:
    """Stops the movers that touch the robot and move towards it.

    Otherwise a faster mover would stop the robot for as long as it follows it.

    Returns:
        Whether there are such movers.
    """
    found = False
    for m in range(traits.shape[0]):
        off_x, off_y = x - now[m, at.X], y - now[m, at.Y]
        reach = radius + traits[m, at.RADIUS] + TOUCH
        if off_x * off_x + off_y * off_y <= reach * reach:
            rate_x, rate_y = pieces[m, 0, at.RATE_X], pieces[m, 0, at.RATE_Y]
            if rate_x * off_x + rate_y * off_y > 0.0:
                hold(pieces, m, 0.0)
                found = True
    return found


@subkernel
def hold_arriving(
    traits: Array, now: Array, pieces: Array, path: Array, radius: float,
    length: float, dt: float, since: float,
) -> None:  # fmt: skip
    """Stops movers at their contact with a robot that has stood still since a time.

    Args:
        traits: As for `first_meeting`.
        now: As for `first_meeting`.
        pieces: Overwritten.
        path: Motion of the robot.
        radius: Radius of the robot, px.
        length: Largest distance of the robot from its start, px.
        dt: Duration of the step, s.
        since: Fraction of the step.
    """
    x, y = path[0, at.FROM_X], path[0, at.FROM_Y]
    for m in range(traits.shape[0]):
        off_x, off_y = now[m, at.X] - x, now[m, at.Y] - y
        reach = radius + traits[m, at.RADIUS]
        far = reach + length + traits[m, at.SPEED] * dt + TOUCH
        if off_x * off_x + off_y * off_y <= far * far:
            touch = meeting(path, pieces, m, reach, since, 1.0)
            if touch <= 1.0:
                hold(pieces, m, touch)


@subkernel
def end_ranges_at_discs(
    directions: Array,
    traits: Array,
    now: Array,
    x: float,
    y: float,
    heading: float,
    range_max: float,
    out: NDArray[np.float32],
) -> None:
    """Shortens the ranges of rays that hit a mover before the first wall.

    Args:
        directions: From `rays.directions_of`.
        traits: `Movers.traits`.
        now: `Movers.now`.
        x: Column of the robot's centre, px.
        y: Row, px.
        heading: rad, from +x towards +y.
        range_max: Range without a hit, px.
        out: Shape (n_rays,), ranges of the walls, px; overwritten.
    """
    cos, sin = math.cos(heading), math.sin(heading)
    for m in range(traits.shape[0]):
        off_x, off_y, radius = now[m, at.X] - x, now[m, at.Y] - y, traits[m, at.RADIUS]
        far2, radius2 = off_x * off_x + off_y * off_y, radius * radius
        if far2 >= (range_max + radius) * (range_max + radius):
            continue
        if far2 <= radius2:
            out[:] = 0.0
            return
        ahead, aside = cos * off_x + sin * off_y, cos * off_y - sin * off_x
        for k in range(out.shape[0]):
            along = directions[0, k] * ahead + directions[1, k] * aside
            inside2 = radius2 - (far2 - along * along)
            if along > 0.0 and inside2 > 0.0:
                hit = along - math.sqrt(inside2)
                out[k] = min(out[k], hit)


@kernel
def fits(clear: FloatGrid, x: float, y: float, radius: float) -> bool:
    """Whether a disc touches no occupied square; `clear` is the padded clearance."""
    return bool(has_room(clear, x, y, radius))


@kernel
def nearest_approaches(
    clear: FloatGrid, traits: Array, now: Array, points: Array, pieces: Array,
    x: float, y: float, seconds: float, least: Array,
) -> None:  # fmt: skip
    """Least distance of each mover's centre from a point within a time.

    Args:
        clear: Padded clearance, px.
        traits: `Movers.traits`; the arrays after it are those of `Movers`, too.
        now: Overwritten.
        points: Way-points.
        pieces: Overwritten.
        x: Column of the point, px.
        y: Row of the point, px.
        seconds: The time, s.
        least: Shape (n,), overwritten with the distances, px.
    """
    for m in range(traits.shape[0]):
        nearest = math.hypot(now[m, at.X] - x, now[m, at.Y] - y)
        for _ in range(math.ceil(seconds / LOOK)):
            plan_one(clear, traits, now, points, pieces, m, LOOK)
            nearest = min(nearest, _distance_of_pieces(pieces, m, x, y))
            stop(now, pieces, m, 1.0, LOOK)
        least[m] = nearest


@kernel
def foresee(
    clear: FloatGrid, leaps: LeapGrid, traits: Array, now: Array, points: Array,
    pieces: Array, _path: Array, _past: Array, people: Array, planes: Array,
    walls: Array, first: Cells, listed: Cells, fields: FloatGrid, spacing: Array,
    dt: float, places: Array,
) -> None:  # fmt: skip
    """Where movers will be, as if there were no robot.

    Args:
        clear: Padded clearance, px.
        leaps: From `rays.leaps_of`.
        traits: `Movers.traits`; the arrays up to `spacing` are those of `Movers`, too.
        now: Overwritten.
        points: Way-points.
        pieces: Overwritten.
        _path: Not used.
        _past: Not used.
        people: Overwritten.
        planes: Overwritten.
        walls: Only read.
        first: Only read.
        listed: Only read.
        fields: Only read.
        spacing: Only read.
        dt: Duration of a step, s.
        places: Shape (steps + 1, n, 2), overwritten with x, y at each step, px.
    """
    for step in range(places.shape[0]):
        if step > 0:
            plan(clear, traits, now, points, pieces, dt)
            if people.shape[0] > 0:
                plan_crowd(
                    clear, leaps, traits, now, pieces, people, planes, walls, first,
                    listed, fields, spacing, _FAR, _FAR, 0.0, 0.0, 0.0, dt,
                )  # fmt: skip
        for m in range(traits.shape[0]):
            if step > 0:
                stop(now, pieces, m, 1.0, dt)
            places[step, m, 0], places[step, m, 1] = now[m, at.X], now[m, at.Y]


@subkernel
def _distance_of_pieces(pieces: Array, m: int, x: float, y: float) -> float:
    """Least distance of mover m's centre from a point in a step, px."""
    row, least = 0, math.inf
    while pieces[m, row, at.TIME] < 1.0:
        begin_x, begin_y = pieces[m, row, at.FROM_X], pieces[m, row, at.FROM_Y]
        row += 1
        along_x = pieces[m, row, at.FROM_X] - begin_x
        along_y = pieces[m, row, at.FROM_Y] - begin_y
        length2 = along_x * along_x + along_y * along_y
        part = (x - begin_x) * along_x + (y - begin_y) * along_y
        part = min(max(part / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
        off_x, off_y = begin_x + part * along_x - x, begin_y + part * along_y - y
        least = min(least, math.sqrt(off_x * off_x + off_y * off_y))
    return least


@subkernel
def note_arc(
    ground: tuple[FloatGrid, Array],
    row: int,
    time: float,
    x: float,
    y: float,
    heading: float,
    forward: float,
    turn: float,
) -> None:
    """Notes the robot's motion; `ground` is the padded clearance and `Movers.path`."""
    begin_arc(ground[1], row, time, x, y, heading, forward, turn)


@subkernel
def arc_contact_on(
    ground: tuple[FloatGrid, Array],
    x: float,
    y: float,
    heading: float,
    forward: float,
    turn: float,
    radius: float,
) -> float:
    """`contact.arc_contact` on a ground of `note_arc`."""
    return arc_contact(ground[0], x, y, heading, forward, turn, radius)


@subkernel
def near_normals_on(
    ground: tuple[FloatGrid, Array],
    x: float,
    y: float,
    reach: float,
    normals: Array,
) -> int:
    """`contact.near_normals` on a ground of `note_arc`."""
    return near_normals(ground[0], x, y, reach, normals)
