"""Compiled step of TDAC-EPuck-v0: motion up to a contact, sensors, reward and ends.

The arrays of one robot are described in `tdac_envs.epuck.robot.Robot`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.addresses import Words, line, plane
from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.drive.stepping import (
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
    batch_at,
    clear,
    copy_row,
    give_command,
    move,
    settle,
    within,
    wrap_angle,
)
from tdac_envs.epuck.contact import advance
from tdac_envs.epuck.gaps import nearest_of
from tdac_envs.epuck.infrared import in_sight, sense
from tdac_envs.epuck.nearby import listed_at
from tdac_envs.epuck.prisms import Array, Index

WHEEL_RADIUS, AXLE_LENGTH = 0.02, 0.052
"""Of an e-puck, m."""
MOST_TURNED = 1e4
"""Limit of the wheels' angles, as observed, rad."""

# Entries of `constants`, `state` and `outcome` beyond those of
# `tdac_envs.drive.stepping`.
FLOOR, LEFT_END, LOW_END, SPACING, CELL = range(17, 22)
N_CONSTANTS = 22
LEFT_TURNED, RIGHT_TURNED = range(8, 10)
N_STATE = 10
FORWARD, TURN = range(10, 12)
N_OUTCOME = 12
# Places of some arrays among those of `begin`.
CONSTANTS, STATE, QUEUE, POSE, WHEEL_SPEEDS, TURNED, READINGS = range(11, 18)
OUTCOME = 19


@subkernel
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


@subkernel
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
    """Fills in what follows from where the robot is; arguments as for `_drive`."""
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
        gap < room or in_sight(points, first, extent, x, y, goal_x, goal_y)
    )
    outcome[GAP], outcome[ROOM] = gap, room


@subkernel
def _begin(
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
    """Begins an episode where `state` says; arguments as for `_drive`.

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


@subkernel
def _turn_wheels(
    constants: Array,
    state: Array,
    queue: Array,
    wheel_speeds: NDArray[np.float32],
    outcome: Array,
) -> None:
    """Sets the wheels' speeds and angles, and in `outcome` the arc that they wish.

    Arguments as for `_drive`.
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


@subkernel
def _finish(
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
    """Ends a step after `_turn_wheels`, when the robot is where it gets to.

    Arguments as for `_drive`; `outcome[TOUCHED]` is given.
    """
    before = outcome[REMAINING]
    _observe(
        points, first, extent, cells, listed,
        seen_points, seen_first, seen_extent, seen_cells, seen_listed,
        field, constants, state, pose, turned, readings, hits, outcome,
    )  # fmt: skip
    settle(constants, state, outcome, before)


@subkernel
def _drive(
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
    _turn_wheels(constants, state, queue, wheel_speeds, outcome)
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
    _finish(
        points, first, extent, cells, listed,
        seen_points, seen_first, seen_extent, seen_cells, seen_listed, field,
        constants, state, queue, pose, wheel_speeds, turned, readings, hits, outcome,
    )  # fmt: skip


@subkernel
def _arrays_at(words: Words) -> Any:
    """The arrays of a robot, as `_drive` takes them."""
    return (
        plane(words[0], np.float64),
        line(words[1], np.int64),
        plane(words[2], np.float64),
        plane(words[3], np.int64),
        line(words[4], np.int64),
        plane(words[5], np.float64),
        line(words[6], np.int64),
        plane(words[7], np.float64),
        plane(words[8], np.int64),
        line(words[9], np.int64),
        plane(words[10], np.float32),
        line(words[CONSTANTS], np.float64),
        line(words[STATE], np.float64),
        plane(words[QUEUE], np.float64),
        line(words[POSE], np.float32),
        line(words[WHEEL_SPEEDS], np.float32),
        line(words[TURNED], np.float32),
        line(words[READINGS], np.float32),
        plane(words[18], np.float64),
        line(words[OUTCOME], np.float64),
    )


@kernel
def begin(words: Words) -> None:
    """Begins an episode where the robot's `state` says, from `outcome[REMAINING]`.

    Args:
        words: Shape (20, 4), of a `tdac_envs.core.addresses.Addresses`: of the world as
            `Setup.world` has it, and of the robot.
    """
    _begin(*_arrays_at(words))


@kernel
def drive(words: Words) -> None:
    """One step in which nothing is pushed; `words` as for `begin`."""
    _drive(*_arrays_at(words))


@kernel
def turn_wheels(words: Words) -> None:
    """The begin of a step in which things may be pushed; `words` as for `begin`."""
    _turn_wheels(
        line(words[CONSTANTS], np.float64),
        line(words[STATE], np.float64),
        plane(words[QUEUE], np.float64),
        line(words[WHEEL_SPEEDS], np.float32),
        line(words[OUTCOME], np.float64),
    )


@kernel
def finish(words: Words) -> None:
    """The end of such a step, when `outcome[TOUCHED]` is known."""
    _finish(*_arrays_at(words))


@kernel
def step_rows(batch: Words, rows: Words) -> None:
    """One step of many robots, or the begin of an episode where one is over.

    What comes out of it is copied here: the robots' own memory then stays in the cache
    of the core that steps them.

    Args:
        batch: Shape (9, 4): where the arrays of `tdac_envs.drive.stepping.batch_at`
            are, with `words` of shape (n, 20, 4), and what is overwritten, with a row
            for each robot: outcome, pose, wheel speeds, wheel angles and readings.
        rows: Numbers of the robots, shape (k,).
    """
    over, commands, starts, words = batch_at(batch)
    outcomes = plane(batch[4], np.float64)
    poses, speeds = plane(batch[5], np.float32), plane(batch[6], np.float32)
    turned, readings = plane(batch[7], np.float32), plane(batch[8], np.float32)
    for row in rows:
        own = _arrays_at(words[row])
        give_command(over[row], commands[row], starts[row], own[STATE], own[OUTCOME])
        if over[row]:
            _begin(*own)
        else:
            _drive(*own)
        copy_row(own[OUTCOME], outcomes, row)
        copy_row(own[POSE], poses, row)
        copy_row(own[WHEEL_SPEEDS], speeds, row)
        copy_row(own[TURNED], turned, row)
        copy_row(own[READINGS], readings, row)
