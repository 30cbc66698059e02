"""The arrays of an e-puck that the compiled step reads and writes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_envs.drive import stepping
from tdac_envs.epuck import kernels
from tdac_envs.epuck.infrared import N_SENSORS

Array = NDArray[np.float64]
Observed = NDArray[np.float32]


class EPuckArrays(NamedTuple):
    """Arrays of one robot, or of many robots with an additional first axis.

    `kernels.arrays_at` and the indices beside it follow the order of the fields.

    Attributes:
        constants: Shape (33,), float64: effective axle (m), full wheel speed (rad/s),
            dt (s), body radius, sensor range (m), fraction of a wheel's speed that
            remains after one step, delay (steps), whether a contact ends the episode,
            distance of a step at full speed (m); reward weights: progress,
            goal, collision, time; goal x and y, goal tolerance (m), horizon (steps);
            coefficient of friction between body and solids; gains of the left and
            right wheel; scales of the measured distance and turn; relative radii of the
            left and right wheel; limits of the fractions, not used; height of the
            floor, x and y of the lower left corner of the path field and of the cells,
            spacing of the field, width of the cells (m).
        state: Shape (14,), float64: x, y (m), heading (rad); unclipped commands of the
            left and right wheel; slip of the left and right wheel, the ratio of speed
            over ground to wheel speed; steps so far; length (m) and turn (rad) of the
            last step's arc, as driven by the wheels; fractions of the left and right
            wheel before the lag; wheel angles (rad).
        queue: Shape (delay, 2), float64: delayed commands, a ring buffer.
        pose: Shape (3,), float32: observed x, y, heading.
        wheel_speeds: Shape (2,), float32: fractions as last applied.
        turned: Shape (2,), float32: observed wheel angles, rad.
        readings: Shape (8,), float32: readings of ps0 to ps7, without noise.
        hits: Shape (8, 3), float64; see `infrared.sense`.
        outcome: Shape (11,), float64: reward of the last step; whether it terminated
            or truncated the episode, reached the goal, touched an obstacle; number of
            contacts and of clipped actions so far; straight distance to the goal,
            length of the shortest path to it, distance from the centre to the nearest
            solid part (m); one entry that is not used.
    """

    constants: Array
    state: Array
    queue: Array
    pose: Observed
    wheel_speeds: Observed
    turned: Observed
    readings: Observed
    hits: Array
    outcome: Array

    @classmethod
    def blank(cls, delay: int, *count: int) -> EPuckArrays:
        """One robot, or `count` of them, all zeros."""
        return cls(
            np.zeros((*count, kernels.N_CONSTANTS)),
            np.zeros((*count, kernels.N_STATE)),
            np.zeros((*count, delay, 2)),
            np.zeros((*count, 3), np.float32),
            np.zeros((*count, 2), np.float32),
            np.zeros((*count, 2), np.float32),
            np.zeros((*count, N_SENSORS), np.float32),
            np.zeros((*count, N_SENSORS, 3)),
            np.zeros((*count, stepping.N_OUTCOME)),
        )
