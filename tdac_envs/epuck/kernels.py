"""Compiled step of TDAC-EPuck-v0: motion up to a contact, sensors, reward and ends.

The arrays of one robot are described in `tdac_envs.epuck.robot.Robot`.
"""

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
from tdac_envs.stepping import (
    AXLE,
    DT,
    GAP,
    GOAL_X,
    GOAL_Y,
    HEADING,
    MAX_SPEED,
    RADIUS,
    REACHED,
    REMAINING,
    ROOM,
    SLIP_LEFT,
    SLIP_RIGHT,
    TOLERANCE,
    TOUCHED,
    X,
    Y,
    apply_command,
    clear,
    settle,
    within,
)

WHEEL_RADIUS, AXLE_LENGTH = 0.02, 0.052
"""Of an e-puck, m."""
MOST_TURNED = 1e4
"""Limit of the wheels' angles, as observed, rad."""

# Entries of `constants`, `state` and `outcome` beyond those of `tdac_envs.stepping`.
FLOOR, LEFT_END, LOW_END, SPACING, CELL = range(17, 22)
N_CONSTANTS = 22
LEFT_TURNED, RIGHT_TURNED = range(8, 10)
N_STATE = 10
FORWARD, TURN = range(10, 12)
N_OUTCOME = 12


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
                off_u, off_v = u - i, v - j
                hop = spacing * math.sqrt(off_u * off_u + off_v * off_v)
                if ring == 0 or hop < constants[RADIUS]:
                    best = min(best, field[j, i] + hop)
        if best < math.inf:
            return best
    return previous


@kernel()
def _observe(
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
    """Fills in what follows from where the robot is; arguments as for `drive`."""
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
    outcome[REMAINING] = way_left(field, constants, x, y, outcome[REMAINING])
    off_x, off_y = goal_x - x, goal_y - y
    gap = math.sqrt(off_x * off_x + off_y * off_y)
    begin, end = listed_at(cells, extent.shape[0], left, low, width, x, y)
    room = nearest_of(points, first, extent, listed, begin, end, x, y)
    outcome[REACHED] = gap <= constants[TOLERANCE] and (
        gap < room or sees(points, first, extent, x, y, goal_x, goal_y)
    )
    outcome[GAP], outcome[ROOM] = gap, room


_ARRAYS = (
    "f8[:,:] i8[:] f8[:,:] i8[:,:] i8[:] f8[:,:] i8[:] f8[:,:] i8[:,:] i8[:] f4[:,:] "
    "f8[:] f8[:] f8[:,:] f4[:] f4[:] f4[:] f4[:] f8[:,:] f8[:] ->"
)


@kernel(_ARRAYS)
def begin(
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
    queue: Array,
    pose: NDArray[np.float32],
    wheel_speeds: NDArray[np.float32],
    turned: NDArray[np.float32],
    readings: NDArray[np.float32],
    hits: Array,
    outcome: Array,
) -> None:
    """Begins an episode where `state` says; arguments as for `drive`.

    `outcome[REMAINING]` is given: the length of the shortest path from there.
    """
    clear(state, queue, wheel_speeds, outcome)
    state[LEFT_TURNED] = state[RIGHT_TURNED] = 0.0
    remaining = outcome[REMAINING]
    _observe(
        points, first, extent, cells, listed,
        seen_points, seen_first, seen_extent, seen_cells, seen_listed,
        field, constants, state, pose, turned, readings, hits, outcome,
    )  # fmt: skip
    outcome[REACHED], outcome[REMAINING] = 0.0, remaining


@kernel("f8[:] f8[:] f8[:,:] f4[:] f8[:] ->")
def turn_wheels(
    constants: Array,
    state: Array,
    queue: Array,
    wheel_speeds: NDArray[np.float32],
    outcome: Array,
) -> None:
    """Sets the wheels' speeds and angles, and in `outcome` the arc that they wish.

    Arguments as for `drive`.
    """
    apply_command(constants, state, queue, wheel_speeds, outcome)
    swept = constants[MAX_SPEED] * constants[DT]
    left, right = float(wheel_speeds[0]), float(wheel_speeds[1])
    state[LEFT_TURNED] += swept * left
    state[RIGHT_TURNED] += swept * right
    left, right = left * state[SLIP_LEFT], right * state[SLIP_RIGHT]
    left, right = swept * within(left), swept * within(right)
    outcome[FORWARD] = 0.5 * (left + right) * WHEEL_RADIUS
    outcome[TURN] = (right - left) * WHEEL_RADIUS / constants[AXLE]


@kernel(_ARRAYS)
def finish(
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
    queue: Array,  # noqa: ARG001 - the same arrays as the others take
    pose: NDArray[np.float32],
    wheel_speeds: NDArray[np.float32],  # noqa: ARG001
    turned: NDArray[np.float32],
    readings: NDArray[np.float32],
    hits: Array,
    outcome: Array,
) -> None:
    """Ends a step after `turn_wheels`, when the robot is where it gets to.

    Arguments as for `drive`; `outcome[TOUCHED]` is given.
    """
    before = outcome[REMAINING]
    _observe(
        points, first, extent, cells, listed,
        seen_points, seen_first, seen_extent, seen_cells, seen_listed,
        field, constants, state, pose, turned, readings, hits, outcome,
    )  # fmt: skip
    settle(constants, state, outcome, before)


@kernel(_ARRAYS)
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
    state: Array,
    queue: Array,
    pose: NDArray[np.float32],
    wheel_speeds: NDArray[np.float32],
    turned: NDArray[np.float32],
    readings: NDArray[np.float32],
    hits: Array,
    outcome: Array,
) -> None:
    """One step in which nothing is pushed, all of it but the random numbers.

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
        constants: See `Robot`, as the following ones.
        state: Overwritten, but for the wanted speeds and the slip.
        queue: Overwritten.
        pose: Overwritten.
        wheel_speeds: Overwritten.
        turned: Overwritten.
        readings: Overwritten.
        hits: Overwritten.
        outcome: Overwritten; what it says of the place where the step begins is used.
    """
    turn_wheels(constants, state, queue, wheel_speeds, outcome)
    forward, turn, x, y = outcome[FORWARD], outcome[TURN], state[X], state[Y]
    if outcome[ROOM] - constants[RADIUS] > abs(forward):
        # Nothing is within reach.
        x, y, heading = move(x, y, state[HEADING], forward, turn)
        state[X], state[Y], state[HEADING] = x, y, wrap_angle(heading)
        outcome[TOUCHED] = 0.0
    else:
        left, low, width = constants[LEFT_END], constants[LOW_END], constants[CELL]
        begin, end = listed_at(cells, extent.shape[0], left, low, width, x, y)
        outcome[TOUCHED] = advance(
            points, first, extent, listed, begin, end,
            state, forward, turn, constants[RADIUS],
        )  # fmt: skip
    finish(
        points, first, extent, cells, listed,
        seen_points, seen_first, seen_extent, seen_cells, seen_listed, field,
        constants, state, queue, pose, wheel_speeds, turned, readings, hits, outcome,
    )  # fmt: skip
