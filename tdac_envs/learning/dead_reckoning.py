"""Poses from odometry or encoders: what a robot without a pose knows of its place."""

from __future__ import annotations

import math

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from tdac_envs.epuck.kernels import WHEEL_RADIUS

Array = NDArray[np.float64]


class DeadReckoning:
    """Adds up odometry, for one robot or for a batch.

    Poses are in the frame of the start: x, y, heading. Their errors grow, since those
    of the odometry add up.

    Args:
        robots: Number of robots of a batch; None for one robot, without the first axis.
    """

    def __init__(self, robots: int | None = None) -> None:
        shape = () if robots is None else (robots,)
        self._poses = np.zeros((*shape, 3))
        self._steps = np.zeros(shape)

    def follow(self, odometry: ArrayLike, steps: ArrayLike) -> Array:
        """The poses after the last step, which are kept for the next one.

        Args:
            odometry: Observed distance and turn of the last step, shape (..., 2).
            steps: Steps of each episode so far. A robot at 0 is at its start; one whose
                number has not changed has not moved.
        """
        now = np.asarray(steps, np.float64)
        moved = (now != self._steps)[..., None]
        poses = np.where(moved, self.ahead(odometry), self._poses)
        self._poses = np.where((now == 0.0)[..., None], 0.0, poses)
        self._steps = now.copy()
        return self._poses

    def ahead(self, odometry: ArrayLike) -> Array:
        """The poses one step further, which are not kept; see `follow`."""
        distance, turn = np.moveaxis(np.asarray(odometry, np.float64), -1, 0)
        x, y, heading = np.moveaxis(self._poses, -1, 0)
        # The chord of the arc points along the mean heading.
        chord, middle = distance * np.sinc(turn / (2.0 * math.pi)), heading + turn / 2.0
        return np.stack(
            [x + chord * np.cos(middle), y + chord * np.sin(middle), heading + turn],
            axis=-1,
        )


class WheelReckoning(DeadReckoning):
    """Adds up the angles of an e-puck's wheels; poses in m and rad.

    Args:
        axle: Effective axle of the robot, or of each robot of a batch, m.
        robots: See `DeadReckoning`.
    """

    def __init__(self, axle: ArrayLike, robots: int | None = None) -> None:
        super().__init__(robots)
        self._axle = np.asarray(axle, np.float64)
        self._angles = np.zeros((2,) if robots is None else (robots, 2))

    def follow(self, odometry: ArrayLike, steps: ArrayLike) -> Array:
        """The poses after the last step, from angles of shape (..., 2), rad."""
        poses = super().follow(odometry, steps)
        self._angles = np.array(odometry, np.float64)
        return poses

    def ahead(self, odometry: ArrayLike) -> Array:
        """The poses one step further, which are not kept; see `follow`."""
        turned = np.asarray(odometry, np.float64) - self._angles
        left, right = np.moveaxis(WHEEL_RADIUS * turned, -1, 0)
        distance, turn = (left + right) / 2.0, (right - left) / self._axle
        return super().ahead(np.stack([distance, turn], axis=-1))


SOURCES = ("odometry", "encoders")
"""Keys of observations that add up to a pose; the first one is used."""


def reckoning(source: str, axle: ArrayLike, robots: int | None = None) -> DeadReckoning:
    """Returns the object that adds up the observations of one of `SOURCES`.

    Args:
        source: The key.
        axle: See `WheelReckoning`.
        robots: See `DeadReckoning`.
    """
    if source == "encoders":
        return WheelReckoning(axle, robots)
    return DeadReckoning(robots)


def source_of(own: spaces.Space[object]) -> str | None:
    """The key of an observation space that adds up to a pose; None if none does."""
    keys = own.spaces if isinstance(own, spaces.Dict) else {}
    return next((key for key in SOURCES if key in keys), None)
