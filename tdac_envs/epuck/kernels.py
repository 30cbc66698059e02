"""Compiled step of TDAC-EPuck-v0: motion up to a contact, sensors, reward, episode end.

`tdac_envs.epuck.robot.EPuckArrays` documents the arrays of a robot.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.addresses import Words, frozen, line, plane
from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.drive import stepping
from tdac_envs.drive.stepping import (
    AXLE,
    CLEARANCE,
    DT,
    FORWARD,
    GOAL_DISTANCE,
    GOAL_X,
    GOAL_Y,
    HEADING,
    MAX_SPEED,
    RADIUS,
    REACHED,
    REMAINING,
    SLIP_LEFT,
    SLIP_RIGHT,
    TOLERANCE,
    TOUCHED,
    TURN,
    WHEEL_LEFT,
    WHEEL_RIGHT,
    X,
    Y,
    apply_command,
    batch_at,
    clear,
    clip_unit,
    copy_row,
    finish_step,
    give_command,
    move,
    turned_wheels,
    wrap_angle,
)
from tdac_envs.epuck.contact import stop_at_contact, stop_or_slide
from tdac_envs.epuck.gaps import listed_at, nearest_of, remaining_path
from tdac_envs.epuck.infrared import in_sight, sense
from tdac_envs.epuck.prisms import Array, Index

WHEEL_RADIUS = 0.02
"""Wheel radius of an e-puck, m."""
MOST_TURNED = 1e4
"""Limit of the observed wheel angles, rad."""

# Entries of `constants` and `state` beyond those of `tdac_envs.drive.stepping`.
N_CONSTANTS = stepping.N_CONSTANTS + 5
FLOOR, LEFT_END, LOW_END, SPACING, CELL = range(stepping.N_CONSTANTS, N_CONSTANTS)
N_STATE = stepping.N_STATE + 2
LEFT_TURNED, RIGHT_TURNED = range(stepping.N_STATE, N_STATE)
# Indices of some of the arrays of `arrays_at`.
CONSTANTS, STATE, QUEUE, POSE, WHEEL_SPEEDS, TURNED, READINGS = range(11, 18)
OUTCOME = 19


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
    """Updates observation and `outcome` for the current pose; see `_drive`."""
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
    outcome[REMAINING] = remaining_path(
        field, left, low, constants[SPACING], constants[RADIUS], x, y,
        outcome[REMAINING],
    )  # fmt: skip
    off_x, off_y = goal_x - x, goal_y - y
    gap = math.sqrt(off_x * off_x + off_y * off_y)
    begin, end = listed_at(cells, extent.shape[0], left, low, width, x, y)
    room = nearest_of(points, first, extent, listed, begin, end, x, y)
    outcome[REACHED] = gap <= constants[TOLERANCE] and (
        gap < room or in_sight(points, first, extent, x, y, goal_x, goal_y)
    )
    outcome[GOAL_DISTANCE], outcome[CLEARANCE] = gap, room


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
    """Begins an episode at the pose in `state`; arguments as for `_drive`.

    `outcome[REMAINING]` must be the length of the shortest path from there.
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
    """Updates wheel speeds and angles, and the arc without contact, as of `_drive`."""
    apply_command(constants, state, queue, wheel_speeds, outcome)
    swept = constants[MAX_SPEED] * constants[DT]
    left, right = turned_wheels(constants, wheel_speeds)
    state[LEFT_TURNED] += swept * left
    state[RIGHT_TURNED] += swept * right
    left *= state[SLIP_LEFT] * constants[WHEEL_LEFT]
    right *= state[SLIP_RIGHT] * constants[WHEEL_RIGHT]
    left, right = swept * clip_unit(left), swept * clip_unit(right)
    state[FORWARD] = 0.5 * (left + right) * WHEEL_RADIUS
    state[TURN] = (right - left) * WHEEL_RADIUS / constants[AXLE]


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
    queue: Array,  # noqa: ARG001 - so that the arguments are those of `_drive`
    pose: NDArray[np.float32],
    wheel_speeds: NDArray[np.float32],  # noqa: ARG001
    turned: NDArray[np.float32],
    readings: NDArray[np.float32],
    hits: Array,
    outcome: Array,
) -> None:
    """Completes a step of `_drive` after the motion, which set `outcome[TOUCHED]`."""
    before = outcome[REMAINING]
    _observe(
        points, first, extent, cells, listed,
        seen_points, seen_first, seen_extent, seen_cells, seen_listed,
        field, constants, state, pose, turned, readings, hits, outcome,
    )  # fmt: skip
    finish_step(constants, state, outcome, before)


def driving(move_body: Any) -> Any:
    """Returns the subkernel `drive_step` for one kind of motion.

    Args:
        move_body: Subkernel with the arguments and results of
            `contact.stop_at_contact`.
    """

    @subkernel
    def drive_step(
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
        """Runs one step without pushing; `state` already contains the wheel slip.

        `points` to `listed` describe the solid parts and `seen_points` to `seen_listed`
        the visible ones; see `tdac_envs.epuck.gaps` and `nearby.Nearby` beside it.
        `field`, shape (height, width), is the path length to the goal from each grid
        point, m. The others are the arrays of `EPuckArrays`. All of them are
        overwritten except `constants` and, in `state`, the commands and the slip.
        """
        _turn_wheels(constants, state, queue, wheel_speeds, outcome)
        forward, turn, x, y = state[FORWARD], state[TURN], state[X], state[Y]
        if outcome[CLEARANCE] - constants[RADIUS] > abs(forward):
            # No contact is possible.
            x, y, heading = move(x, y, state[HEADING], forward, turn)
            state[X], state[Y], state[HEADING] = x, y, wrap_angle(heading)
            outcome[TOUCHED] = 0.0
        else:
            left, low, width = constants[LEFT_END], constants[LOW_END], constants[CELL]
            begin, end = listed_at(cells, extent.shape[0], left, low, width, x, y)
            near = points, first, extent, listed, begin, end
            touched, share = move_body(near, state, forward, turn, constants)
            outcome[TOUCHED] = touched
            state[FORWARD], state[TURN] = share * forward, share * turn
        _finish(
            points, first, extent, cells, listed,
            seen_points, seen_first, seen_extent, seen_cells, seen_listed,
            field, constants, state, queue, pose, wheel_speeds, turned, readings, hits,
            outcome,
        )  # fmt: skip

    return drive_step


_drive_to_contact = driving(stop_at_contact)
_drive = driving(stop_or_slide)


@subkernel
def arrays_at(words: Words) -> Any:
    """The arrays of a robot and its world, in the order of `_drive`'s arguments."""
    return (
        frozen(plane(words[0], np.float64)),
        frozen(line(words[1], np.int64)),
        frozen(plane(words[2], np.float64)),
        frozen(plane(words[3], np.int64)),
        frozen(line(words[4], np.int64)),
        frozen(plane(words[5], np.float64)),
        frozen(line(words[6], np.int64)),
        frozen(plane(words[7], np.float64)),
        frozen(plane(words[8], np.int64)),
        frozen(line(words[9], np.int64)),
        frozen(plane(words[10], np.float32)),
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
    """Begins an episode; see `_begin`.

    Args:
        words: Shape (20, 4), from `tdac_envs.core.addresses.Addresses`: the arrays of
            `Setup.world`, then those of the robot.
    """
    _begin(*arrays_at(words))


@kernel
def drive(words: Words) -> None:
    """Runs one step, without pushing, of a robot that a contact stops.

    Args:
        words: As for `begin`.
    """
    _drive_to_contact(*arrays_at(words))


@kernel
def drive_or_slide(words: Words) -> None:
    """Runs one step of any robot without pushing; `words` as for `begin`."""
    _drive(*arrays_at(words))


@kernel
def turn_wheels(words: Words) -> None:
    """Begins a step that uses the physics engine; `words` as for `begin`."""
    _turn_wheels(
        line(words[CONSTANTS], np.float64),
        line(words[STATE], np.float64),
        plane(words[QUEUE], np.float64),
        line(words[WHEEL_SPEEDS], np.float32),
        line(words[OUTCOME], np.float64),
    )


@kernel
def finish(words: Words) -> None:
    """Completes the step after `turn_wheels`, once `outcome[TOUCHED]` is set."""
    _finish(*arrays_at(words))


@kernel
def step_rows(batch: Words, rows: Words) -> None:
    """Steps many robots, or begins the next episode of those whose episode is over.

    The results are copied here because the robots' own arrays are still in the cache
    of the core that steps them.

    Args:
        batch: Shape (9, 4): addresses and shapes of four input arrays (see
            `tdac_envs.drive.stepping.batch_at`; `words` has shape (n, 20, 4)) and of
            five output arrays with one row per robot: outcome, pose, wheel speeds,
            wheel angles, readings.
        rows: Indices of the robots, shape (k,).
    """
    over, commands, starts, words = batch_at(batch)
    outcomes = plane(batch[4], np.float64)
    poses, speeds = plane(batch[5], np.float32), plane(batch[6], np.float32)
    turned, readings = plane(batch[7], np.float32), plane(batch[8], np.float32)
    for row in rows:
        own = arrays_at(words[row])
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
