"""Compiled step of TDAC-Map2D-v0 among moving discs.

A robot without movers takes the step of `kernels`, bit for bit.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.addresses import Words, block, line, plane
from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.drive.sliding import sliding
from tdac_envs.drive.stepping import (
    AXLE,
    CONTACT,
    DT,
    FORWARD,
    FRICTION,
    HEADING,
    MAX_SPEED,
    RADIUS,
    RANGE_MAX,
    REMAINING,
    STEPS,
    STOPS,
    TOUCHED,
    TURN,
    Array,
    X,
    Y,
    apply_command,
    batch_at,
    copy_row,
    finish_step,
    give_command,
    wrap_angle,
)
from tdac_envs.grid.grid import FloatGrid
from tdac_envs.map2d.contact import arc_contact
from tdac_envs.map2d.encounters import (
    NEVER,
    arc_contact_on,
    begin_arc,
    end_ranges_at_discs,
    first_meeting,
    hold_arriving,
    hold_pressing,
    near_normals_on,
    note_arc,
    plan,
    plan_crowd,
    pose_at,
)
from tdac_envs.map2d.kernels import (
    CONTACT_GAP,
    OUTCOME,
    POSE,
    RANGES,
    STATE,
    WHEEL_SPEEDS,
    arc_of,
    arrays_at,
    begin_episode,
    drive_step,
    ground_speeds,
    observe,
    scanner_at,
)
from tdac_envs.map2d.rays import LeapGrid
from tdac_envs.movers.state import (
    MOST_ARCS,
    MOST_PIECES,
    N_PIECE,
    STANDING_SECONDS,
    TIME,
    hold,
    stop,
)
from tdac_envs.movers.walls import Cells

N_ROBOT = 11
"""Arrays before those of the movers in the table of addresses."""
STANDS = 0.02
"""A robot stands if it has moved by less than this part of what it could have."""
WALL, MOVER, MOVER_STANDING = 1.0, 2.0, 3.0
"""Values of `outcome[CONTACT]`."""

_slide = sliding(arc_contact_on, near_normals_on, note_arc)


@subkernel
def movers_at(words: Words) -> Any:
    """The arrays of the movers, in the order of `Movers`."""
    return (
        plane(words[N_ROBOT], np.float64),
        plane(words[N_ROBOT + 1], np.float64),
        plane(words[N_ROBOT + 2], np.float64),
        block(words[N_ROBOT + 3], np.float64),
        plane(words[N_ROBOT + 4], np.float64),
        plane(words[N_ROBOT + 5], np.float64),
        plane(words[N_ROBOT + 6], np.float64),
        plane(words[N_ROBOT + 7], np.float64),
        plane(words[N_ROBOT + 8], np.float64),
        plane(words[N_ROBOT + 9], np.int64),
        line(words[N_ROBOT + 10], np.int64),
        block(words[N_ROBOT + 11], np.float32),
        line(words[N_ROBOT + 12], np.float64),
    )


@subkernel
def _drive_to_contact(
    clear: FloatGrid,
    constants: Array,
    state: Array,
    forward: float,
    turn: float,
    traits: Array,
    now: Array,
    pieces: Array,
    path: Array,
) -> tuple[float, float]:
    """Moves the robot up to its first contact, which ends the episode.

    Returns:
        The fraction of the step at which it stops, and `outcome[CONTACT]`.
    """
    x, y, heading = state[X], state[Y], state[HEADING]
    begin_arc(path, 0, 0.0, x, y, heading, forward, turn)
    begin_arc(path, 1, 1.0, x, y, heading, 0.0, 0.0)
    radius, length = constants[RADIUS], abs(forward)
    wall = arc_contact(clear, x, y, heading, forward, turn, radius)
    part, kind = 1.0, 0.0
    if wall <= 1.0:
        part, kind = max(wall - CONTACT_GAP / length, 0.0), WALL
    meets, _ = first_meeting(
        traits, now, pieces, path, radius, length, constants[DT], min(wall, 1.0)
    )  # fmt: skip
    if meets <= 1.0:
        part, kind = meets, MOVER
    _, state[X], state[Y], heading = pose_at(path, part)
    state[HEADING] = wrap_angle(heading)
    return part, kind


@subkernel
def _slide_to_movers(
    clear: FloatGrid,
    constants: Array,
    state: Array,
    forward: float,
    turn: float,
    traits: Array,
    now: Array,
    pieces: Array,
    path: Array,
) -> float:
    """Moves the robot along walls up to its first contact with a mover.

    From there, both stand for the rest of the step; the robot turns as commanded.

    Returns:
        `outcome[CONTACT]`.
    """
    radius, dt, length = constants[RADIUS], constants[DT], abs(forward)
    pressed = hold_pressing(traits, now, pieces, state[X], state[Y], radius)
    at_wall = _slide(
        (clear, path), state, forward, turn, radius, constants[FRICTION], CONTACT_GAP
    )
    wall_time = path[1, TIME] if at_wall else NEVER
    meets, who = first_meeting(
        traits, now, pieces, path, radius, length, dt, 1.0
    )  # fmt: skip
    if who >= 0:
        row, x, y, heading = pose_at(path, meets)
        begin_arc(path, row + 1, meets, x, y, heading, 0.0, 0.0)
        begin_arc(path, row + 2, 1.0, x, y, heading, 0.0, 0.0)
        state[X], state[Y] = x, y
        hold(pieces, who, meets)
        hold_arriving(traits, now, pieces, path, radius, length, dt, meets)
    if pressed or meets < wall_time:
        return MOVER
    return WALL if at_wall else 0.0


@subkernel
def _stands(constants: Array, state: Array, past: Array) -> bool:
    """Whether the robot has hardly moved in the last `STANDING_SECONDS`."""
    before = (int(state[STEPS]) + 1) % past.shape[0]
    off_x, off_y = state[X] - past[before, 0], state[Y] - past[before, 1]
    most = STANDS * constants[MAX_SPEED] * STANDING_SECONDS
    return bool(math.sqrt(off_x * off_x + off_y * off_y) < most)


@subkernel
def _drive_among(
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
    traits: Array,
    now: Array,
    points: Array,
    pieces: Array,
    path: Array,
    past: Array,
    people: Array,
    planes: Array,
    walls: Array,
    first: Cells,
    listed: Cells,
    fields: NDArray[np.float32],
    spacing: Array,
) -> None:
    """`kernels.drive_step` among movers, whose arrays are the last ones."""
    before, dt = outcome[REMAINING], constants[DT]
    apply_command(constants, state, queue, wheel_speeds, outcome)
    left, right = ground_speeds(constants, state, wheel_speeds)
    forward, turn = arc_of(left, right, constants[AXLE], dt)
    slot = int(state[STEPS]) % past.shape[0]
    past[slot, 0], past[slot, 1] = state[X], state[Y]
    plan(clear, traits, now, points, pieces, dt)
    if people.shape[0] > 0:
        drove = state[FORWARD] / dt
        plan_crowd(
            clear, leaps, traits, now, pieces, people, planes, walls, first, listed,
            fields, spacing, state[X], state[Y], drove * math.cos(state[HEADING]),
            drove * math.sin(state[HEADING]), constants[RADIUS], dt,
        )  # fmt: skip
    part = 1.0
    if constants[STOPS] == 1.0:
        part, kind = _drive_to_contact(
            clear, constants, state, forward, turn, traits, now, pieces, path
        )  # fmt: skip
    else:
        kind = _slide_to_movers(
            clear, constants, state, forward, turn, traits, now, pieces, path
        )  # fmt: skip
    for m in range(traits.shape[0]):
        stop(now, pieces, m, part, dt)
    state[FORWARD], state[TURN] = part * forward, part * turn
    outcome[TOUCHED] = kind > 0.0
    if kind == MOVER and _stands(constants, state, past):
        kind = MOVER_STANDING
    outcome[CONTACT] = kind
    observe(
        leaps, clear, field, directions, constants, state, pose, ranges, outcome
    )  # fmt: skip
    at_x, at_y = scanner_at(constants, state[X], state[Y], state[HEADING])
    end_ranges_at_discs(
        directions, traits, now, at_x, at_y, state[HEADING], constants[RANGE_MAX],
        ranges,
    )  # fmt: skip
    finish_step(constants, state, outcome, before)


@subkernel
def _begin_among(
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
    traits: Array,
    now: Array,
    past: Array,
) -> None:
    """`kernels.begin_episode` among movers, which are at their starts already."""
    begin_episode(
        leaps, clear, field, directions, constants, state, queue, pose, wheel_speeds,
        ranges, outcome,
    )  # fmt: skip
    past[:, 0], past[:, 1] = state[X], state[Y]
    at_x, at_y = scanner_at(constants, state[X], state[Y], state[HEADING])
    end_ranges_at_discs(
        directions, traits, now, at_x, at_y, state[HEADING], constants[RANGE_MAX],
        ranges,
    )  # fmt: skip


@subkernel
def _begin(robot: Any, movers: Any) -> None:
    if movers[0].shape[0] == 0:
        begin_episode(*robot)
    else:
        own: Any = (movers[0], movers[1], movers[5])
        _begin_among(*robot, *own)


@subkernel
def _drive(robot: Any, movers: Any) -> None:
    if movers[0].shape[0] == 0:
        drive_step(*robot)
    else:
        _drive_among(*robot, *movers)


@kernel
def begin_among(words: Words) -> None:
    """Begins an episode among movers.

    Args:
        words: Shape (24, 4): those of `kernels.begin`, then those of `Movers`.
    """
    _begin(arrays_at(words), movers_at(words))


@kernel
def drive_among(words: Words) -> None:
    """Runs one step of a robot among movers; `words` as for `begin_among`."""
    _drive(arrays_at(words), movers_at(words))


@kernel
def step_rows_among(batch: Words, rows: Words) -> None:
    """`kernels.step_rows` for robots of which some are among movers.

    Args:
        batch: As for `kernels.step_rows`, but `words` has shape (n, 24, 4).
        rows: Indices of the robots, shape (k,).
    """
    over, commands, starts, words = batch_at(batch)
    outcomes = plane(batch[4], np.float64)
    poses, speeds = plane(batch[5], np.float32), plane(batch[6], np.float32)
    ranges = plane(batch[7], np.float32)
    # Motion within a step is written to the same memory for one robot after the other,
    # so that it stays in the processor's cache.
    most = 0
    for row in rows:
        most = max(most, plane(words[row][N_ROBOT], np.float64).shape[0])
    pieces = np.empty((most, MOST_PIECES + 2, N_PIECE))
    path = np.empty((MOST_ARCS, N_PIECE))
    for row in rows:
        own, all_movers = arrays_at(words[row]), movers_at(words[row])
        movers: Any = all_movers[:3] + (pieces, path) + all_movers[5:]  # noqa: RUF005
        give_command(over[row], commands[row], starts[row], own[STATE], own[OUTCOME])
        if over[row]:
            _begin(own, movers)
        else:
            _drive(own, movers)
        copy_row(own[OUTCOME], outcomes, row)
        copy_row(own[POSE], poses, row)
        copy_row(own[WHEEL_SPEEDS], speeds, row)
        copy_row(own[RANGES], ranges, row)
