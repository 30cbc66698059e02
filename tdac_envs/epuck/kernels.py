"""Compiled step of TDAC-EPuck-v0: motion up to a contact, and all that follows."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.compiled import kernel
from tdac_envs.contact import move, wrap_angle
from tdac_envs.epuck.contact import advance
from tdac_envs.epuck.gaps import nearest_of
from tdac_envs.epuck.infrared import sees, sense
from tdac_envs.epuck.nearby import listed_at
from tdac_envs.epuck.prisms import Array, Index

WHEEL_RADIUS, AXLE = 0.02, 0.052
"""Of an e-puck, m."""
MOST_TURNED = 1e4
"""Limit of the wheels' angles, as observed, rad."""

# Entries of `constants`, `state`, `command` and `outcome`.
(
    LIMIT, DT, BODY, GOAL_X, GOAL_Y, TOLERANCE, KEEP, FLOOR, LEFT_END, LOW_END, SPACING,
    CELL,
) = range(12)  # fmt: skip
X, Y, HEADING, REMAINING, LEFT_TURNED, RIGHT_TURNED = range(6)
TOUCHED, REACHED, WAY, GAP, ROOM, FORWARD, TURN = range(7)


@kernel()
def way_left(
    field: NDArray[np.float32], constants: Array, x: float, y: float, previous: float
) -> float:
    """Length of the shortest path to the goal from any point, m.

    The least sum of the way to a grid point nearer than the body's radius (nothing can
    be in between) and that point's distance. Where there is none, `previous`.
    """
    height, width = field.shape
    spacing = constants[SPACING]
    u, v = (x - constants[LEFT_END]) / spacing, (y - constants[LOW_END]) / spacing
    column, row = math.floor(u), math.floor(v)
    for ring in range(4):
        best = math.inf
        for j in range(max(row - ring, 0), min(row + ring + 2, height)):
            for i in range(max(column - ring, 0), min(column + ring + 2, width)):
                hop = spacing * math.hypot(u - i, v - j)
                if ring == 0 or hop < constants[BODY]:
                    best = min(best, field[j, i] + hop)
        if best < math.inf:
            return best
    return previous


@kernel(
    "f8[:,:] i8[:] f8[:,:] i8[:,:] i8[:] f8[:,:] i8[:] f8[:,:] i8[:,:] i8[:] "
    "f4[:,:] f8[:] f8[:] f4[:] f4[:] f4[:] f8[:,:] f8[:] ->"
)
def observe(
    points: Array,
    first: Index,
    extent: Array,
    cells: Index,
    listed: Index,
    seen_points: Array,
    seen_first: Index,
    seen_extent: Array,
    seen_cells: Index,
    seen_listed: Index,
    field: NDArray[np.float32],
    constants: Array,
    state: Array,
    pose: NDArray[np.float32],
    turned: NDArray[np.float32],
    readings: NDArray[np.float32],
    hits: Array,
    outcome: Array,
) -> None:
    """Fills in what follows from where the robot is.

    Args:
        points: Of what is solid; see `tdac_envs.epuck.gaps`, as the next two.
        first: Of what is solid.
        extent: Of what is solid.
        cells: Of what is solid; see `tdac_envs.epuck.nearby.Nearby`, as the next.
        listed: Of what is solid.
        seen_points: The same five of what is visible.
        seen_first: Of what is visible.
        seen_extent: Of what is visible.
        seen_cells: Of what is visible.
        seen_listed: Of what is visible.
        field: Shape (height, width): way to the goal from each grid point, m.
        constants: Shape (12,): wheel limit (rad/s), dt (s), body radius (m), goal x
            and y, goal tolerance, share of its speed that a wheel keeps from one step
            to the next, height of the floor, x and y of the first point of the field
            and of the first cell, the spacing of that field, the width of those cells.
        state: Shape (6,): x, y, heading, way left to the goal (overwritten), angles
            of the wheels.
        pose: Shape (3,), overwritten with what the robot observes.
        turned: Shape (2,), overwritten with the angles of the wheels, as observed.
        readings: Shape (8,), overwritten, as `hits`; see `infrared.sense`.
        hits: Shape (8, 3).
        outcome: Shape (7,), of which are overwritten: whether the goal is reached, the
            way left to it, the straight distance to it, and from the robot's centre to
            the nearest solid part.
    """
    x, y, goal_x, goal_y = state[X], state[Y], constants[GOAL_X], constants[GOAL_Y]
    left, low, width = constants[LEFT_END], constants[LOW_END], constants[CELL]
    pose[0], pose[1], pose[2] = x, y, state[HEADING]
    turned[0] = min(max(state[LEFT_TURNED], -MOST_TURNED), MOST_TURNED)
    turned[1] = min(max(state[RIGHT_TURNED], -MOST_TURNED), MOST_TURNED)
    begin, end = listed_at(seen_cells, seen_extent.shape[0], left, low, width, x, y)
    sense(
        seen_points, seen_first, seen_extent, seen_listed, begin, end,
        constants[FLOOR], state, readings, hits,
    )  # fmt: skip
    state[REMAINING] = way_left(field, constants, x, y, state[REMAINING])
    gap = math.hypot(goal_x - x, goal_y - y)
    begin, end = listed_at(cells, extent.shape[0], left, low, width, x, y)
    room = nearest_of(points, first, extent, listed, begin, end, x, y)
    reached = gap <= constants[TOLERANCE] and (
        gap < room or sees(points, first, extent, x, y, goal_x, goal_y)
    )
    outcome[REACHED], outcome[WAY] = reached, state[REMAINING]
    outcome[GAP], outcome[ROOM] = gap, room


@kernel("f8[:] f8[:] f8[:] f4[:] f8[:] ->")
def turn_wheels(
    constants: Array,
    command: Array,
    state: Array,
    wheel_speeds: NDArray[np.float32],
    outcome: Array,
) -> None:
    """Sets the wheels' speeds and angles, and the arc that they wish to drive.

    Args:
        constants: See `observe`.
        command: Shape (4,): wanted speed of the left and the right wheel in [-1, 1];
            for each the factor between its speed and what it does on the ground.
        state: See `observe`; the angles of the wheels are overwritten.
        wheel_speeds: Shape (2,), fractions as last applied; overwritten.
        outcome: Shape (7,), whose last two are overwritten: length (m) and turn (rad)
            of the arc.
    """
    keep, dt = constants[KEEP], constants[DT]
    wheel_speeds[0] = command[0] + keep * (wheel_speeds[0] - command[0])
    wheel_speeds[1] = command[1] + keep * (wheel_speeds[1] - command[1])
    swept = constants[LIMIT] * dt
    left, right = float(wheel_speeds[0]), float(wheel_speeds[1])
    state[LEFT_TURNED] += swept * left
    state[RIGHT_TURNED] += swept * right
    left = swept * min(max(left * command[2], -1.0), 1.0)
    right = swept * min(max(right * command[3], -1.0), 1.0)
    outcome[FORWARD] = 0.5 * (left + right) * WHEEL_RADIUS
    outcome[TURN] = (right - left) * WHEEL_RADIUS / AXLE


@kernel(
    "f8[:,:] i8[:] f8[:,:] i8[:,:] i8[:] f8[:,:] i8[:] f8[:,:] i8[:,:] i8[:] "
    "f4[:,:] f8[:] f8[:] f8[:] f4[:] f4[:] f4[:] f4[:] f8[:,:] f8[:] ->"
)
def drive(
    points: Array,
    first: Index,
    extent: Array,
    cells: Index,
    listed: Index,
    seen_points: Array,
    seen_first: Index,
    seen_extent: Array,
    seen_cells: Index,
    seen_listed: Index,
    field: NDArray[np.float32],
    constants: Array,
    command: Array,
    state: Array,
    wheel_speeds: NDArray[np.float32],
    pose: NDArray[np.float32],
    turned: NDArray[np.float32],
    readings: NDArray[np.float32],
    hits: Array,
    outcome: Array,
) -> None:
    """One step in which nothing is pushed: the wheels, the arc, and what follows.

    Arguments as for `turn_wheels` and `observe`; `outcome[0]` then says whether the
    body touched something. What is in `outcome` is that of the place where the step
    begins.
    """
    turn_wheels(constants, command, state, wheel_speeds, outcome)
    forward, turn = outcome[FORWARD], outcome[TURN]
    x, y = state[X], state[Y]
    if outcome[ROOM] - constants[BODY] > abs(forward):
        # Nothing is within reach.
        x, y, heading = move(x, y, state[HEADING], forward, turn)
        state[X], state[Y], state[HEADING] = x, y, wrap_angle(heading)
        outcome[TOUCHED] = 0.0
    else:
        left, low, width = constants[LEFT_END], constants[LOW_END], constants[CELL]
        begin, end = listed_at(cells, extent.shape[0], left, low, width, x, y)
        outcome[TOUCHED] = advance(
            points, first, extent, listed, begin, end,
            state, forward, turn, constants[BODY],
        )  # fmt: skip
    observe(
        points, first, extent, cells, listed,
        seen_points, seen_first, seen_extent, seen_cells, seen_listed,
        field, constants, state, pose, turned, readings, hits, outcome,
    )  # fmt: skip
