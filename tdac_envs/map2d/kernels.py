"""Compiled step of TDAC-Map2D-v0: motion up to a contact, rays, reward, episode end.

`clear` and `leaps` are `padded_clear` and `leaps` of a
`tdac_envs.map2d.terrain.Terrain`; `tdac_envs.map2d.robot.Map2DArrays` documents the
arrays of a robot.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.addresses import Words, block, frozen, line, plane
from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.drive.sliding import sliding
from tdac_envs.drive.stepping import (
    AXLE,
    CLEARANCE,
    CONTACT,
    DT,
    FORWARD,
    FRICTION,
    GOAL_DISTANCE,
    GOAL_X,
    GOAL_Y,
    HEADING,
    MAX_SPEED,
    RADIUS,
    RANGE_MAX,
    REACHED,
    REMAINING,
    SLIP_LEFT,
    SLIP_RIGHT,
    STOPS,
    TOLERANCE,
    TOUCHED,
    TURN,
    WHEEL_LEFT,
    WHEEL_RIGHT,
    Array,
    X,
    Y,
    apply_command,
    batch_at,
    clip_unit,
    copy_row,
    finish_step,
    give_command,
    move,
    turned_wheels,
    wrap_angle,
)
from tdac_envs.drive.stepping import N_CONSTANTS as N_SHARED
from tdac_envs.drive.stepping import clear as clear_state
from tdac_envs.grid.grid import FloatGrid
from tdac_envs.map2d.contact import arc_contact, contact_before, near_normals
from tdac_envs.map2d.rays import LeapGrid, cast_rays, in_sight

# A stopped body is moved back along its arc by this distance, px, so that the next
# step starts outside the obstacle.
CONTACT_GAP = 1e-6
# Entries of `constants` that only these robots have.
SCAN_AHEAD, SCAN_ASIDE = range(N_SHARED, N_SHARED + 2)
N_CONSTANTS = N_SHARED + 2
# Indices of some of the arrays of `arrays_at`.
STATE, POSE, WHEEL_SPEEDS, RANGES, OUTCOME = 5, 7, 8, 9, 10

_slide = sliding(arc_contact, near_normals)


@subkernel
def advance(
    clear: FloatGrid,
    state: Array,
    left: float,
    right: float,
    axle: float,
    dt: float,
    radius: float,
) -> tuple[bool, float]:
    """Moves the robot for one step at constant wheel speeds, up to a contact.

    Args:
        clear: Padded clearance, px.
        state: Begins with x, y (px) and heading (rad), which are overwritten.
        left: Speed of the left wheel, px/s.
        right: Speed of the right wheel, px/s.
        axle: Distance between the wheels, px.
        dt: Duration, s.
        radius: Body radius, px.

    Returns:
        Whether the body touched an obstacle, and the fraction of the arc that it drove.
        After a contact the robot is placed `CONTACT_GAP` before it, with the heading
        it had there.
    """
    forward, turn = arc_of(left, right, axle, dt)
    x, y, heading = state[X], state[Y], state[HEADING]
    end_x, end_y, end_heading = move(x, y, heading, forward, turn)
    touch = contact_before(
        clear, x, y, heading, forward, turn, radius, end_x, end_y
    )  # fmt: skip
    part = 1.0
    if touch <= 1.0:
        part = max(touch - CONTACT_GAP / abs(forward), 0.0)
        end_x, end_y, end_heading = move(x, y, heading, part * forward, part * turn)
    state[X], state[Y], state[HEADING] = end_x, end_y, wrap_angle(end_heading)
    return bool(touch <= 1.0), part


@subkernel
def arc_of(left: float, right: float, axle: float, dt: float) -> tuple[float, float]:
    """Length (px) and turn (rad) of a step at constant wheel speeds."""
    # y points down, so a positive turn is clockwise on the screen.
    return 0.5 * (left + right) * dt, (left - right) * dt / axle


@subkernel
def _path_distance(
    leaps: LeapGrid,
    field: FloatGrid,
    x: float,
    y: float,
    previous: float,
) -> float:
    """Length of the shortest path from a point to the goal, px.

    It is the least sum of the distance to a nearby visible pixel and the path length
    from there (`field`), or `previous` if no pixel within 2 px has a path, as when the
    body is pressed into a corner.
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
                if through < best and (
                    ring == 0 or in_sight(leaps, x, y, float(i), float(j))
                ):
                    best = through
        if best < math.inf:
            return best
    return previous


@kernel
def path_distance(
    leaps: LeapGrid, field: FloatGrid, x: float, y: float, previous: float
) -> float:
    """`_path_distance` for calls from Python."""
    return _path_distance(leaps, field, x, y, previous)


@subkernel
def scanner_at(
    constants: Array, x: float, y: float, heading: float
) -> tuple[float, float]:
    """Where the rays of a robot at a pose start, px."""
    ahead, aside = constants[SCAN_AHEAD], constants[SCAN_ASIDE]
    if ahead == 0.0 and aside == 0.0:
        return x, y
    cos, sin = math.cos(heading), math.sin(heading)
    return x + ahead * cos - aside * sin, y + ahead * sin + aside * cos


@subkernel
def observe(
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
    """Updates the observation and `outcome` for the current pose."""
    x, y, heading = state[X], state[Y], state[HEADING]
    pose[0], pose[1], pose[2] = x, y, heading
    at_x, at_y = scanner_at(constants, x, y, heading)
    cast_rays(leaps, directions, at_x, at_y, heading, constants[RANGE_MAX], ranges)
    goal_x, goal_y = constants[GOAL_X], constants[GOAL_Y]
    gap = math.hypot(goal_x - x, goal_y - y)
    near = gap <= constants[TOLERANCE]
    outcome[REACHED] = near and in_sight(leaps, x, y, goal_x, goal_y)
    outcome[GOAL_DISTANCE] = gap
    outcome[REMAINING] = _path_distance(leaps, field, x, y, outcome[REMAINING])
    outcome[CLEARANCE] = clear[math.floor(y + 1.5), math.floor(x + 1.5)]


@subkernel
def begin_episode(
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
    """Begins an episode at the pose in `state`; arguments as for `drive_step`.

    `outcome[REMAINING]` must be the length of the shortest path from there.
    """
    clear_state(state, queue, wheel_speeds, outcome)
    remaining = outcome[REMAINING]
    observe(
        leaps, clear, field, directions, constants, state, pose, ranges, outcome
    )  # fmt: skip
    outcome[REACHED], outcome[REMAINING] = 0.0, remaining


@subkernel
def ground_speeds(
    constants: Array, state: Array, wheel_speeds: NDArray[np.float32]
) -> tuple[float, float]:
    """Speeds of the wheels over ground in the step, px/s."""
    limit = constants[MAX_SPEED]
    left, right = turned_wheels(constants, wheel_speeds)
    return (
        limit * clip_unit(left * (state[SLIP_LEFT] * constants[WHEEL_LEFT])),
        limit * clip_unit(right * (state[SLIP_RIGHT] * constants[WHEEL_RIGHT])),
    )


@subkernel
def stop_at_contact(
    clear: FloatGrid, constants: Array, state: Array, left: float, right: float
) -> tuple[bool, float, float]:
    """Moves the robot for one step, up to a contact.

    Args:
        clear: Padded clearance, px.
        constants: See `Map2DArrays`.
        state: See `Map2DArrays`; its pose is overwritten.
        left: Speed of the left wheel, px/s.
        right: Speed of the right wheel, px/s.

    Returns:
        Whether the body touched an obstacle; length (px) and turn (rad) of the arc that
        its wheels drove.
    """
    axle, dt, radius = constants[AXLE], constants[DT], constants[RADIUS]
    forward, turn = arc_of(left, right, axle, dt)
    touched, part = advance(clear, state, left, right, axle, dt, radius)
    return touched, part * forward, part * turn


@subkernel
def stop_or_slide(
    clear: FloatGrid, constants: Array, state: Array, left: float, right: float
) -> tuple[bool, float, float]:
    """As `stop_at_contact`, or along obstacles if contacts do not end the episode."""
    if constants[STOPS] == 1.0:
        return stop_at_contact(clear, constants, state, left, right)
    forward, turn = arc_of(left, right, constants[AXLE], constants[DT])
    touched: bool = _slide(
        clear, state, forward, turn, constants[RADIUS], constants[FRICTION],
        CONTACT_GAP,
    )  # fmt: skip
    return touched, forward, turn


def driving(move_body: Any) -> Any:
    """Returns the subkernel `drive_step` for one kind of motion.

    Args:
        move_body: Subkernel with the arguments and results of `stop_at_contact`.
    """

    @subkernel
    def drive_step(
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
        """Runs one step of the environment; `state` already contains the wheel slip.

        `field`, shape (height, width), is the path length to the goal from each pixel,
        px; `directions` are from `rays.directions_of`. `constants` and the arrays after
        it are those of `Map2DArrays`. All of them are overwritten except `constants`
        and, in `state`, the commands and the slip.
        """
        before = outcome[REMAINING]
        apply_command(constants, state, queue, wheel_speeds, outcome)
        left, right = ground_speeds(constants, state, wheel_speeds)
        touched, forward, turn = move_body(clear, constants, state, left, right)
        outcome[TOUCHED] = outcome[CONTACT] = touched
        state[FORWARD], state[TURN] = forward, turn
        observe(
            leaps, clear, field, directions, constants, state, pose, ranges, outcome
        )  # fmt: skip
        finish_step(constants, state, outcome, before)

    return drive_step


_drive_to_contact = driving(stop_at_contact)
drive_step = driving(stop_or_slide)


@subkernel
def arrays_at(words: Words) -> Any:
    """The arrays of a robot and its world, in the order of `drive_step`'s arguments."""
    return (
        frozen(block(words[0], np.uint8)),
        frozen(plane(words[1], np.float32)),
        frozen(plane(words[2], np.float32)),
        frozen(plane(words[3], np.float64)),
        line(words[4], np.float64),
        line(words[STATE], np.float64),
        plane(words[6], np.float64),
        line(words[POSE], np.float32),
        line(words[WHEEL_SPEEDS], np.float32),
        line(words[RANGES], np.float32),
        line(words[OUTCOME], np.float64),
    )


@kernel
def begin(words: Words) -> None:
    """Begins an episode; see `begin_episode`.

    Args:
        words: Shape (11, 4), from `tdac_envs.core.addresses.Addresses`: the arrays of
            `Setup.world`, then those of the robot.
    """
    begin_episode(*arrays_at(words))


@kernel
def drive(words: Words) -> None:
    """Runs one step of a robot that a contact stops; `words` as for `begin`.

    It is a kernel of its own because sliding takes as long to compile as the rest.
    """
    _drive_to_contact(*arrays_at(words))


@kernel
def drive_or_slide(words: Words) -> None:
    """Runs one step of any robot; `words` as for `begin`."""
    drive_step(*arrays_at(words))


@kernel
def step_rows(batch: Words, rows: Words) -> None:
    """Steps many robots, or begins the next episode of those whose episode is over.

    The results are copied here because the robots' own arrays are still in the cache
    of the core that steps them.

    Args:
        batch: Shape (8, 4): addresses and shapes of four input arrays (see
            `tdac_envs.drive.stepping.batch_at`; `words` has shape (n, 11, 4)) and of
            four output arrays with one row per robot: outcome, pose, wheel speeds,
            ranges.
        rows: Indices of the robots, shape (k,).
    """
    over, commands, starts, words = batch_at(batch)
    outcomes = plane(batch[4], np.float64)
    poses, speeds = plane(batch[5], np.float32), plane(batch[6], np.float32)
    ranges = plane(batch[7], np.float32)
    for row in rows:
        own = arrays_at(words[row])
        give_command(over[row], commands[row], starts[row], own[STATE], own[OUTCOME])
        if over[row]:
            begin_episode(*own)
        else:
            drive_step(*own)
        copy_row(own[OUTCOME], outcomes, row)
        copy_row(own[POSE], poses, row)
        copy_row(own[WHEEL_SPEEDS], speeds, row)
        copy_row(own[RANGES], ranges, row)
