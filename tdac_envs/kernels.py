"""Compiled step of TDAC-Map2D-v0: motion up to a contact, rays, reward and ends.

`clear` and `leaps` are those of a `tdac_envs.terrain.Terrain`, which are padded; the
arrays of one robot are described in `tdac_envs.robot2d.Robot`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.compiled import kernel
from tdac_envs.contact import contact_before, move, wrap_angle
from tdac_envs.grid import FloatGrid
from tdac_envs.rays import LeapGrid, cast_rays, sees
from tdac_envs.stepping import (
    AXLE,
    DT,
    GAP,
    GOAL_X,
    GOAL_Y,
    HEADING,
    MAX_SPEED,
    RADIUS,
    RANGE_MAX,
    REACHED,
    REMAINING,
    ROOM,
    SLIP_LEFT,
    SLIP_RIGHT,
    TOLERANCE,
    TOUCHED,
    Array,
    X,
    Y,
    apply_command,
    settle,
    within,
)
from tdac_envs.stepping import clear as forget

# A body that was stopped by an obstacle goes back by this much of its way, px, so
# that the next step starts outside it.
CONTACT_GAP = 1e-6


@kernel("f4[:,:] f8[:] f8 f8 f8 f8 f8 -> b1")
def advance(
    clear: FloatGrid,
    state: Array,
    left: float,
    right: float,
    axle: float,
    dt: float,
    radius: float,
) -> bool:
    """Moves the robot by one step at constant wheel speeds, up to a contact.

    Args:
        clear: Padded clearance, px.
        state: Begins with x, y (px) and heading (rad), which are overwritten.
        left: Speed of the left wheel, px/s.
        right: Speed of the right wheel, px/s.
        axle: Distance of the wheels, px.
        dt: Duration, s.
        radius: Body radius, px.

    Returns:
        Whether the body touched an obstacle. It then stands `CONTACT_GAP` before
        the touching pose, with the heading it had there.
    """
    forward = 0.5 * (left + right) * dt
    # y points down, so a positive turn is clockwise on the screen.
    turn = (left - right) * dt / axle
    x, y, heading = state[X], state[Y], state[HEADING]
    end_x, end_y, end_heading = move(x, y, heading, forward, turn)
    touch = contact_before(
        clear, x, y, heading, forward, turn, radius, end_x, end_y
    )  # fmt: skip
    if touch <= 1.0:
        part = max(touch - CONTACT_GAP / abs(forward), 0.0)
        end_x, end_y, end_heading = move(x, y, heading, part * forward, part * turn)
    state[X], state[Y], state[HEADING] = end_x, end_y, wrap_angle(end_heading)
    return bool(touch <= 1.0)


@kernel("u1[:,:,:] f4[:,:] f8 f8 f8 -> f8")
def path_distance(
    leaps: LeapGrid,
    field: FloatGrid,
    x: float,
    y: float,
    previous: float,
) -> float:
    """Length of the shortest path to the goal from any point, px.

    The least sum of the way to a nearby pixel in sight and that pixel's distance.
    Where no pixel within 2 px has a path (the body is squeezed into a corner),
    `previous`.

    Args:
        leaps: From `rays.leaps_of`.
        field: Shape (height, width), float32, from `plan.distance_field`.
        x: Column, px.
        y: Row, px.
        previous: Value to fall back to.
    """
    height, width = field.shape
    column, row = math.floor(x), math.floor(y)
    for ring in range(3):
        best = math.inf
        for j in range(max(row - ring, 0), min(row + ring + 2, height)):
            for i in range(max(column - ring, 0), min(column + ring + 2, width)):
                off_x, off_y = x - i, y - j
                through = field[j, i] + math.sqrt(off_x * off_x + off_y * off_y)
                # The four pixels around a point are never behind a wall.
                if through < best and (ring == 0 or sees(leaps, x, y, i, j)):
                    best = through
        if best < math.inf:
            return best
    return previous


@kernel()
def _observe(
    leaps: LeapGrid,
    clear: FloatGrid,
    field: FloatGrid,
    directions: Array,
    constants: Array,
    state: Array,
    pose: NDArray[np.float32],
    ranges: NDArray[np.float32],
    outcome: Array,
) -> None:
    """Fills in what follows from where the robot is."""
    x, y, heading = state[X], state[Y], state[HEADING]
    pose[0], pose[1], pose[2] = x, y, heading
    cast_rays(leaps, directions, x, y, heading, constants[RANGE_MAX], ranges)
    goal_x, goal_y = constants[GOAL_X], constants[GOAL_Y]
    gap = math.hypot(goal_x - x, goal_y - y)
    near = gap <= constants[TOLERANCE]
    outcome[REACHED] = near and sees(leaps, x, y, goal_x, goal_y)
    outcome[GAP] = gap
    outcome[REMAINING] = path_distance(leaps, field, x, y, outcome[REMAINING])
    outcome[ROOM] = clear[math.floor(y + 1.5), math.floor(x + 1.5)]


_ARRAYS = (
    "u1[:,:,:] f4[:,:] f4[:,:] f8[:,:] f8[:] f8[:] f8[:,:] f4[:] f4[:] f4[:] f8[:] ->"
)


@kernel(_ARRAYS)
def begin(
    leaps: LeapGrid,
    clear: FloatGrid,
    field: FloatGrid,
    directions: Array,
    constants: Array,
    state: Array,
    queue: Array,
    pose: NDArray[np.float32],
    wheel_speeds: NDArray[np.float32],
    ranges: NDArray[np.float32],
    outcome: Array,
) -> None:
    """Begins an episode where `state` says; arguments as of `drive`.

    `outcome[REMAINING]` is given: the length of the shortest path from there.
    """
    forget(state, queue, wheel_speeds, outcome)
    remaining = outcome[REMAINING]
    _observe(
        leaps, clear, field, directions, constants, state, pose, ranges, outcome
    )  # fmt: skip
    outcome[REACHED], outcome[REMAINING] = 0.0, remaining


@kernel(_ARRAYS)
def drive(
    leaps: LeapGrid,
    clear: FloatGrid,
    field: FloatGrid,
    directions: Array,
    constants: Array,
    state: Array,
    queue: Array,
    pose: NDArray[np.float32],
    wheel_speeds: NDArray[np.float32],
    ranges: NDArray[np.float32],
    outcome: Array,
) -> None:
    """One step of the environment, all of it but the random numbers.

    Args:
        leaps: From `rays.leaps_of`.
        clear: Padded clearance, px.
        field: Shape (height, width), float32: way to the goal, px.
        directions: From `rays.fan`.
        constants: See `Robot`, as the following ones.
        state: Overwritten, but for the wanted speeds and the slip.
        queue: Overwritten.
        pose: Overwritten.
        wheel_speeds: Overwritten.
        ranges: Overwritten.
        outcome: Overwritten.
    """
    apply_command(constants, state, queue, wheel_speeds, outcome)
    limit, before = constants[MAX_SPEED], outcome[REMAINING]
    outcome[TOUCHED] = advance(
        clear,
        state,
        limit * within(wheel_speeds[0] * state[SLIP_LEFT]),
        limit * within(wheel_speeds[1] * state[SLIP_RIGHT]),
        constants[AXLE],
        constants[DT],
        constants[RADIUS],
    )
    _observe(
        leaps, clear, field, directions, constants, state, pose, ranges, outcome
    )  # fmt: skip
    settle(constants, state, outcome, before)
