"""Parts of a compiled step shared by all environments: motion, reward, episode end.

A robot's state is kept in a few arrays. The constants below are the indices of the
entries that all environments have; `Map2DArrays` and `EPuckArrays` document them.
"""

from __future__ import annotations

import math
from types import EllipsisType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.addresses import Words, block, line, plane
from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.drive.rewards import RewardWeights, step_reward

_TWO_PI = 2.0 * math.pi
Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Robot = TypeVar("Robot", bound=tuple[NDArray[Any], ...])
"""The arrays of a robot: `Map2DArrays` or `EPuckArrays`."""

# Entries of `constants`.
AXLE, MAX_SPEED, DT, RADIUS, RANGE_MAX, LAG, DELAY, STOPS, FULL_STEP = range(9)
PROGRESS, GOAL, COLLISION, TIME, GOAL_X, GOAL_Y, TOLERANCE, HORIZON = range(9, 17)
FRICTION, GAIN_LEFT, GAIN_RIGHT, DISTANCE_SCALE, TURN_SCALE = range(17, 22)
WHEEL_LEFT, WHEEL_RIGHT = range(22, 24)
MOST_CHANGE, MOST_SUM, MOST_DIFFERENCE, MOST_TURN_CHANGE = range(24, 28)
N_CONSTANTS = 28
# Entries of `state`.
X, Y, HEADING, LEFT, RIGHT, SLIP_LEFT, SLIP_RIGHT, STEPS, FORWARD, TURN = range(10)
RAMP_LEFT, RAMP_RIGHT = range(10, 12)
N_STATE = 12
# Entries of `outcome`.
REWARD, TERMINATED, TRUNCATED, REACHED, TOUCHED, COLLISIONS, CLIPPED = range(7)
GOAL_DISTANCE, REMAINING, CLEARANCE, CONTACT = range(7, 11)
N_OUTCOME = 11
UNDISTURBED = 1.0, 1.0, 1.0, 1.0, 1.0, 1.0
"""Gains, scales and relative wheel radii in `constants` of a robot without errors."""
UNLIMITED = 2.0, 2.0, 2.0, 4.0
"""Limits in `constants` of a robot without any: no fraction changes by more than 2."""


@subkernel
def clear(
    state: Array, queue: Array, wheel_speeds: NDArray[np.float32], outcome: Array
) -> None:
    """Resets a robot for a new episode, except for pose and remaining path length."""
    state[LEFT] = state[RIGHT] = 0.0
    state[SLIP_LEFT] = state[SLIP_RIGHT] = 1.0
    state[STEPS] = state[FORWARD] = state[TURN] = 0.0
    state[RAMP_LEFT] = state[RAMP_RIGHT] = 0.0
    queue[:] = 0.0
    wheel_speeds[:] = 0.0
    outcome[:REMAINING] = outcome[CONTACT] = 0.0


@subkernel
def batch_at(batch: Words) -> tuple[Flags, Array, Array, Words]:
    """Input arrays of a loop over the robots of a batch, from their addresses.

    Arrays made from addresses are not reference-counted. Threads that update the same
    reference counts wait for each other, which makes a step 1.5 times as long.

    Args:
        batch: Shape (4 or more, 4): addresses and shapes of the arrays.

    Returns:
        over: Shape (n,): whether a robot's episode is over and the next one begins.
        commands: Shape (n, 2): commanded wheel speeds.
        starts: Shape (n, 4): start pose, and length of the path from there.
        words: Shape (n, arrays, 4): addresses and shapes of each robot's arrays.
    """
    return (
        line(batch[0], np.bool_),
        plane(batch[1], np.float64),
        plane(batch[2], np.float64),
        block(batch[3], np.int64),
    )


@subkernel
def give_command(
    begins: bool, command: Array, start: Array, state: Array, outcome: Array
) -> None:
    """Prepares a robot of a batch for its next call of `begin` or `drive`.

    Args:
        begins: Whether an episode begins.
        command: Shape (2,): commanded wheel speeds.
        start: Shape (4,): start pose, and length of the path from there.
        state: Overwritten.
        outcome: Overwritten.
    """
    if begins:
        state[X], state[Y], state[HEADING] = start[0], start[1], start[2]
        outcome[REMAINING] = start[3]
    else:
        state[LEFT], state[RIGHT] = command[0], command[1]


@subkernel
def copy_row(source: NDArray[Any], to: NDArray[Any], row: int) -> None:
    """Copies a 1D array into a row of a 2D array."""
    for k in range(source.shape[0]):
        to[row, k] = source[k]


@subkernel
def clip_unit(value: float) -> float:
    """The value clipped to [-1, 1]."""
    return min(max(value, -1.0), 1.0)


@subkernel
def _within_limits(constants: Array, left: float, right: float) -> tuple[float, float]:
    """The wheel speeds, scaled down so that the body is not too fast.

    Both are multiplied by the same factor, so the robot drives the same curve: the body
    keeps its curvature and is slower. The limits are sum and difference of the speeds.
    """
    both, apart = abs(left + right), abs(left - right)
    if both > constants[MOST_SUM] or apart > constants[MOST_DIFFERENCE]:
        part = min(
            constants[MOST_SUM] / max(both, constants[MOST_SUM]),
            constants[MOST_DIFFERENCE] / max(apart, constants[MOST_DIFFERENCE]),
        )
        return part * left, part * right
    return left, right


@subkernel
def apply_command(
    constants: Array,
    state: Array,
    queue: Array,
    wheel_speeds: NDArray[np.float32],
    outcome: Array,
) -> None:
    """Computes the wheel speeds, as fractions, from the commanded ones.

    Clipped to [-1, 1], scaled to the limits of the body's speed and turn, delayed,
    ramped to the limits of the accelerations, and smoothed by the lag. A limit of the
    turn's acceleration takes as much from one wheel as it gives to the other.
    """
    left, right = clip_unit(state[LEFT]), clip_unit(state[RIGHT])
    if left != state[LEFT] or right != state[RIGHT]:
        outcome[CLIPPED] += 1.0
    left, right = _within_limits(constants, left, right)
    delay = int(constants[DELAY])
    if delay > 0:
        slot = int(state[STEPS]) % delay
        new_left, new_right = left, right
        left, right = queue[slot, 0], queue[slot, 1]
        queue[slot, 0], queue[slot, 1] = new_left, new_right
    most = constants[MOST_CHANGE]
    left = min(max(left, state[RAMP_LEFT] - most), state[RAMP_LEFT] + most)
    right = min(max(right, state[RAMP_RIGHT] - most), state[RAMP_RIGHT] + most)
    turn = left - right - (state[RAMP_LEFT] - state[RAMP_RIGHT])
    if abs(turn) > constants[MOST_TURN_CHANGE]:
        beyond = 0.5 * (turn - math.copysign(constants[MOST_TURN_CHANGE], turn))
        left, right = left - beyond, right + beyond
    state[RAMP_LEFT], state[RAMP_RIGHT] = left, right
    lag = constants[LAG]
    wheel_speeds[0] = left + lag * (wheel_speeds[0] - left)
    wheel_speeds[1] = right + lag * (wheel_speeds[1] - right)


@subkernel
def turned_wheels(
    constants: Array, wheel_speeds: NDArray[np.float32]
) -> tuple[float, float]:
    """True speeds of the wheels with their gains, as fractions of the full speed."""
    return (
        clip_unit(wheel_speeds[0] * constants[GAIN_LEFT]),
        clip_unit(wheel_speeds[1] * constants[GAIN_RIGHT]),
    )


@subkernel
def finish_step(constants: Array, state: Array, outcome: Array, before: float) -> None:
    """Computes the reward of a step and whether it ends the episode.

    `before` is the length of the remaining path before the step.
    """
    reached, touched = outcome[REACHED] == 1.0, outcome[TOUCHED] == 1.0
    weights = RewardWeights(
        constants[PROGRESS], constants[GOAL], constants[COLLISION], constants[TIME]
    )
    progress = (before - outcome[REMAINING]) / constants[FULL_STEP]
    outcome[REWARD] = step_reward(weights, progress, reached, touched)
    state[STEPS] += 1.0
    outcome[COLLISIONS] += touched
    over = reached or (touched and constants[STOPS] == 1.0)
    outcome[TERMINATED] = over
    outcome[TRUNCATED] = not over and state[STEPS] >= constants[HORIZON]


def info_of(outcome: list[float]) -> dict[str, Any]:
    """The `info` of a step, from its `outcome` as a list."""
    entries = outcome[REACHED : CLEARANCE + 1]
    reached, touched, collisions, clipped, gap, remaining, room = entries
    return {
        "is_success": reached == 1.0,
        "collision": touched == 1.0,
        "collisions": int(collisions),
        "clipped": int(clipped),
        "distance_to_goal": gap,
        "path_distance": remaining,
        "clearance": room,
    }


def row_of(robots: Robot, index: int) -> Robot:
    """Views of the arrays of one of many robots."""
    return type(robots)(*(array[index] for array in robots))


def place(robot: Any, task: Any, index: int | EllipsisType = ...) -> None:
    """Places a robot, or robot `index` of many, at the start of a task.

    The kernel `begin` must be called next.
    """
    wanted = *task.goal, task.goal_tolerance, task.horizon
    robot.constants[index, GOAL_X : HORIZON + 1] = wanted
    robot.state[index, : HEADING + 1] = task.start
    robot.outcome[index, REMAINING] = task.shortest


@kernel
def wrap_angle(angle: float) -> float:
    """The angle wrapped to (-pi, pi]."""
    wrapped = angle - _TWO_PI * math.floor((angle + math.pi) / _TWO_PI)
    return math.pi if wrapped <= -math.pi else wrapped


@subkernel
def move(
    x: float, y: float, heading: float, forward: float, turn: float
) -> tuple[float, float, float]:
    """The pose after an exact arc of length `forward` that turns by `turn` rad.

    `forward` has the unit of x and y; the returned heading is not wrapped.
    """
    half = 0.5 * turn
    # The series is exact in float64 below 1e-4 rad.
    ratio = math.sin(half) / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0
    # The chord of an arc points along the mean heading.
    chord, mean = forward * ratio, heading + half
    return (
        x + chord * math.cos(mean),
        y + chord * math.sin(mean),
        heading + turn,
    )


@subkernel
def contact_free_length(rest: float, approach: float, curvature: float) -> float:
    """Arc length h that is certainly free of contact.

    h is the positive root of `rest + approach * h - curvature * h**2 / 2`, or inf.

    Args:
        rest: Distance to the obstacle.
        approach: Rate at which this distance grows along the tangent, in [-1, 1].
        curvature: Curvature of the arc.
    """
    root = math.sqrt(approach * approach + 2.0 * curvature * rest)
    if approach < 0.0:
        return 2.0 * rest / (root - approach)
    if curvature > 0.0:
        return (approach + root) / curvature
    return math.inf
