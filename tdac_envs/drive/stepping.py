"""What the compiled steps of all environments share: memory, motion, reward, ends.

A robot's memory is a few arrays, in which the environments have these entries in
common; see `tdac_envs.epuck.robot.Robot` for what they mean.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.addresses import Words, block, line, plane
from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.drive.rewards import RewardWeights, step_reward

_TWO_PI = 2.0 * math.pi
Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

# Entries of `constants`.
AXLE, MAX_SPEED, DT, RADIUS, RANGE_MAX, LAG, DELAY, STOPS, FULL_STEP = range(9)
PROGRESS, GOAL, COLLISION, TIME, GOAL_X, GOAL_Y, TOLERANCE, HORIZON = range(9, 17)
N_CONSTANTS = 17
# Entries of `state`.
X, Y, HEADING, LEFT, RIGHT, SLIP_LEFT, SLIP_RIGHT, STEPS = range(8)
N_STATE = 8
# Entries of `outcome`.
REWARD, TERMINATED, TRUNCATED, REACHED, TOUCHED, COLLISIONS, CLIPPED = range(7)
GAP, REMAINING, ROOM = range(7, 10)
N_OUTCOME = 10


@subkernel
def clear(
    state: Array, queue: Array, wheel_speeds: NDArray[np.float32], outcome: Array
) -> None:
    """Forgets the episode before; the pose and the way that is left are kept."""
    state[LEFT] = state[RIGHT] = 0.0
    state[SLIP_LEFT] = state[SLIP_RIGHT] = 1.0
    state[STEPS] = 0.0
    queue[:] = 0.0
    wheel_speeds[:] = 0.0
    outcome[:REMAINING] = 0.0


@subkernel
def batch_at(batch: Words) -> tuple[Flags, Array, Array, Words]:
    """What a loop over the robots of a batch reads, found by addresses.

    Views of these arrays count no references: threads that count in the same place
    wait for each other, and take half as long again.

    Args:
        batch: Where they are, shape (4, 4) or more of them.

    Returns:
        over: Shape (n,): whether a robot's episode begins.
        commands: Shape (n, 2): wanted speeds of the wheels.
        starts: Shape (n, 4): pose in which an episode begins, and the way from there.
        words: Shape (n, arrays, 4): where the arrays of each robot are.
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
        begins: Whether its episode begins.
        command: Shape (2,): wanted speeds of the wheels.
        start: Shape (4,): pose in which an episode begins, and the way from there.
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
    """Copies an array of one dimension to a row of another."""
    for k in range(source.shape[0]):
        to[row, k] = source[k]


@subkernel
def within(value: float) -> float:
    """The value, limited to [-1, 1]."""
    return min(max(value, -1.0), 1.0)


@subkernel
def apply_command(
    constants: Array,
    state: Array,
    queue: Array,
    wheel_speeds: NDArray[np.float32],
    outcome: Array,
) -> None:
    """Sets the wheels' speeds, as fractions, from those that are wanted."""
    left, right = within(state[LEFT]), within(state[RIGHT])
    if left != state[LEFT] or right != state[RIGHT]:
        outcome[CLIPPED] += 1.0
    delay = int(constants[DELAY])
    if delay > 0:
        late = int(state[STEPS]) % delay
        wanted_left, wanted_right = left, right
        left, right = queue[late, 0], queue[late, 1]
        queue[late, 0], queue[late, 1] = wanted_left, wanted_right
    lag = constants[LAG]
    wheel_speeds[0] = left + lag * (wheel_speeds[0] - left)
    wheel_speeds[1] = right + lag * (wheel_speeds[1] - right)


@subkernel
def settle(constants: Array, state: Array, outcome: Array, before: float) -> None:
    """Reward and end of a step, from what was touched and reached.

    Args:
        constants: See the module.
        state: See the module.
        outcome: See the module.
        before: Way that was left before the step.
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
    told = outcome[REACHED : ROOM + 1]
    reached, touched, collisions, clipped, gap, remaining, room = told
    return {
        "is_success": reached == 1.0,
        "collision": touched == 1.0,
        "collisions": int(collisions),
        "clipped": int(clipped),
        "distance_to_goal": gap,
        "path_distance": remaining,
        "clearance": room,
    }


@kernel
def wrap_angle(angle: float) -> float:
    """The same direction in (-pi, pi]."""
    wrapped = angle - _TWO_PI * math.floor((angle + math.pi) / _TWO_PI)
    return math.pi if wrapped <= -math.pi else wrapped


@subkernel
def move(
    x: float, y: float, heading: float, forward: float, turn: float
) -> tuple[float, float, float]:
    """Pose after the exact arc of `forward` px and `turn` rad; heading unwrapped.

    The chord of the arc points along the middle heading.
    """
    half = 0.5 * turn
    # Below 1e-4 rad the series is exact to the last bit.
    shrink = math.sin(half) / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0
    chord, middle = forward * shrink, heading + half
    return (
        x + chord * math.cos(middle),
        y + chord * math.sin(middle),
        heading + turn,
    )


@subkernel
def free_way(rest: float, approach: float, curvature: float) -> float:
    """Way that is surely free: to the root of `rest + approach h - curvature h^2 / 2`.

    Args:
        rest: Distance to the body.
        approach: Rate at which it grows along the tangent, in [-1, 1].
        curvature: Of the arc.
    """
    root = math.sqrt(approach * approach + 2.0 * curvature * rest)
    if approach < 0.0:
        return 2.0 * rest / (root - approach)
    if curvature > 0.0:
        return (approach + root) / curvature
    return math.inf
