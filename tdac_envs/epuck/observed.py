"""Observations of an e-puck: the space, and entries that no kernel computes.

Functions take the arrays of one robot, or of many with an additional first axis.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from tdac_envs.drive.stepping import HEADING
from tdac_envs.epuck.infrared import LARGEST, N_SENSORS, sense_ground
from tdac_envs.epuck.kernels import LEFT_TURNED, MOST_TURNED, RIGHT_TURNED
from tdac_envs.epuck.prisms import Prisms
from tdac_envs.epuck.robot import EPuckArrays
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.worlds.bodies import BODY_RADIUS

Array = NDArray[np.float64]
Observed = NDArray[np.float32]

INSTRUMENTS = ("ground", "gps", "compass", "encoders")
"""Instruments that are observed only if an argument asks for them."""
ENCODER_STEP = 0.00628
"""Resolution of the wheel encoders in Webots, rad: 1000 steps per revolution."""


def observation_space(
    task: EPuckTask,
    further: Collection[str] = (),
) -> spaces.Dict:
    """The observation space of a task; see `EPuckEnv`.

    Args:
        task: The task.
        further: Those of `INSTRUMENTS` that are observed.
    """
    # The body is inside the fence, except for small overlaps in the physics engine.
    left, low, right, high = task.ground.bounds
    least = np.array([left, low], np.float32) - np.float32(BODY_RADIUS)
    most = np.array([right, high], np.float32) + np.float32(BODY_RADIUS)
    pi, floor = np.float32(math.pi), np.float32(task.ground.floor)
    turned = np.float32(MOST_TURNED)
    space: dict[str, spaces.Space[Any]] = {
        "pose": spaces.Box(np.append(least, -pi), np.append(most, pi)),
        "goal": spaces.Box(least, most),
        "wheel_speeds": spaces.Box(-1.0, 1.0, (2,), np.float32),
        "ps": spaces.Box(0.0, LARGEST, (N_SENSORS,), np.float32),
        "wheel_positions": spaces.Box(-turned, turned, (2,), np.float32),
    }
    if "ground" in further:
        space["ground"] = spaces.Box(0.0, LARGEST, (3,), np.float32)
    if "gps" in further:
        space["gps"] = spaces.Box(
            np.append(least, floor - 1), np.append(most, floor + 1)
        )
    if "compass" in further:
        space["compass"] = spaces.Box(-1.0, 1.0, (3,), np.float32)
    if "encoders" in further:
        space["encoders"] = spaces.Box(-turned, turned, (2,), np.float32)
    return spaces.Dict(space)


def noisy(readings: Observed, spreads: Array, normal: Array) -> Observed:
    """Readings with noise, clipped to the sensors' limits.

    Args:
        readings: Readings without noise.
        spreads: Relative standard deviation of each reading.
        normal: A draw from the standard normal distribution for each reading.
    """
    factor = 1.0 + spreads * normal
    return np.clip(readings * factor, 0.0, LARGEST).astype(np.float32)


def ground_readings(
    seen: Prisms, floor: float, robot: EPuckArrays
) -> tuple[Observed, Array]:
    """Readings of gs0 to gs2 of one robot and their relative standard deviations.

    Args:
        seen: Visible parts.
        floor: Height of the ground, m.
        robot: Arrays of the robot.
    """
    readings, spreads = np.zeros(3, np.float32), np.zeros(3)
    sense_ground(*seen.arrays(), floor, robot.state, readings, spreads)
    return readings, spreads


def position(robot: EPuckArrays, floor: float | Array) -> Observed:
    """Reading of the GPS: x, y and height, m, shape (3,)."""
    height = np.broadcast_to(np.float32(floor), robot.pose.shape[:-1])
    return np.concatenate([robot.pose[..., :2], height[..., None]], axis=-1)


def north(robot: EPuckArrays) -> Observed:
    """Reading of the compass: the direction of +y in the robot's frame, shape (3,)."""
    heading = robot.state[..., HEADING]
    aim = np.stack([np.sin(heading), np.cos(heading), 0.0 * heading], axis=-1)
    return aim.astype(np.float32)


def in_encoder_steps(angles: Array) -> Array:
    """Wheel angles rounded to steps of the encoders, rad."""
    return ENCODER_STEP * np.round(angles / ENCODER_STEP)


def encoder_angles(robot: EPuckArrays) -> Observed:
    """Readings of the wheel encoders since the reset, rad, shape (2,): left, right."""
    angles = in_encoder_steps(robot.state[..., LEFT_TURNED : RIGHT_TURNED + 1])
    return np.clip(angles, -MOST_TURNED, MOST_TURNED).astype(np.float32)


def add_instruments(
    observation: dict[str, Observed],
    further: Collection[str],
    robot: EPuckArrays,
    floor: float | Array,
) -> None:
    """Adds the readings of those instruments that have no noise.

    Args:
        observation: Readings are added to it.
        further: As for `observation_space`.
        robot: Arrays of the robot.
        floor: Height of the ground, m.
    """
    if "gps" in further:
        observation["gps"] = position(robot, floor)
    if "compass" in further:
        observation["compass"] = north(robot)
    if "encoders" in further:
        observation["encoders"] = encoder_angles(robot)
