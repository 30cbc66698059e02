"""The arrays of a robot of TDAC-Map2D-v0 that the compiled step reads and writes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_envs.drive import stepping

Array = NDArray[np.float64]
Observed = NDArray[np.float32]

FRICTION = 0.4
"""Coulomb friction coefficient between a robot's body and the obstacles."""


class Map2DArrays(NamedTuple):
    """Arrays of one robot, or of many robots with an additional first axis.

    `kernels.arrays_at` and the indices beside it follow the order of the fields.

    Attributes:
        constants: Shape (30,), float64: axle length (px), full wheel speed (px/s), dt
            (s), body radius, largest range (px), fraction of a wheel's speed that
            remains after one step, delay (steps), whether a contact ends the
            episode, distance of a step at full speed (px); reward weights: progress,
            goal, collision, time; goal x and y, goal tolerance (px), horizon (steps);
            coefficient of friction between body and obstacles; gains of the left and
            right wheel; scales of the measured distance and turn; relative radii of the
            left and right wheel; limits of the wheels' fractions: change in a step,
            sum and difference of both, change of the difference in a step; where the
            rays start, ahead of the centre and to its right (px).
        state: Shape (12,), float64: x, y (px), heading (rad); unclipped commands of the
            left and right wheel; slip of the left and right wheel, the ratio of speed
            over ground to wheel speed; steps so far; length (px) and turn (rad) of the
            last step's arc, as driven by the wheels; fractions of the left and right
            wheel after the limit of the acceleration.
        queue: Shape (delay, 2), float64: delayed commands, a ring buffer.
        pose: Shape (3,), float32: observed x, y, heading.
        wheel_speeds: Shape (2,), float32: fractions as last applied.
        ranges: Shape (n_rays,), float32, px.
        outcome: Shape (11,), float64: reward of the last step; whether it terminated
            or truncated the episode, reached the goal, touched an obstacle; number of
            contacts and of clipped actions so far; straight distance to the goal,
            length of the shortest path to it, clearance of the pixel under the robot
            (px); what was touched, an index of `observed.CONTACTS`.
    """

    constants: Array
    state: Array
    queue: Array
    pose: Observed
    wheel_speeds: Observed
    ranges: Observed
    outcome: Array

    @classmethod
    def blank(cls, n_rays: int, delay: int, *count: int) -> Map2DArrays:
        """One robot, or `count` of them, all zeros."""
        return cls(
            np.zeros((*count, stepping.N_CONSTANTS + 2)),
            np.zeros((*count, stepping.N_STATE)),
            np.zeros((*count, delay, 2)),
            np.zeros((*count, 3), np.float32),
            np.zeros((*count, 2), np.float32),
            np.zeros((*count, n_rays), np.float32),
            np.zeros((*count, stepping.N_OUTCOME)),
        )
