"""Poses from odometry: what a robot without a pose knows of its own place."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
