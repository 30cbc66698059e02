"""The memory of an e-puck, as its compiled step reads and writes it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_envs.drive import stepping
from tdac_envs.epuck import kernels
from tdac_envs.epuck.infrared import N_SENSORS
from tdac_envs.epuck.task import EPuckTask

Array = NDArray[np.float64]
Observed = NDArray[np.float32]


class Robot(NamedTuple):
    """Arrays of one robot; or of many, with one more axis in front.

    Attributes:
        constants: Shape (22,), float64: axle length (m), wheel limit (rad/s), dt (s),
            body radius, range of the sensors (m), share of its speed that a wheel
            keeps from one step to the next, delay (steps), whether a contact ends the
            episode, way of a step at full speed (m); weights of the reward: progress,
            goal, collision, time; goal x and y, goal tolerance (m), horizon (steps);
            height of the floor, x and y of the first point of the task's field and of
            the first cell, spacing of that field, width of those cells (m).
        state: Shape (10,), float64: x, y (m), heading (rad); wanted speeds of the left
            and of the right wheel, which may be out of [-1, 1]; for each the factor
            between its speed and what it does on the ground; steps so far; angles of
            the wheels (rad).
        queue: Shape (delay, 2), float64: wanted speeds that are still to be applied.
        pose: Shape (3,), float32: x, y, heading, as observed.
        wheel_speeds: Shape (2,), float32: fractions as last applied.
        turned: Shape (2,), float32: angles of the wheels, as observed.
        readings: Shape (8,), float32: of ps0 to ps7, without noise.
        hits: Shape (8, 3), float64; see `infrared.sense`.
        outcome: Shape (12,), float64: reward of the last step, whether it terminated
            or truncated the episode, whether the goal was reached and something
            touched; contacts and clipped actions so far; straight distance to the
            goal, length of the shortest path to it, from the centre to the nearest
            solid thing (m); length (m) and turn (rad) of the arc that was wished.
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
    def blank(cls, delay: int, *count: int) -> Robot:
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
            np.zeros((*count, kernels.N_OUTCOME)),
        )

    def row(self, index: int) -> Robot:
        """One of many robots; its arrays are views."""
        return Robot(*(array[index] for array in self))

    def place(self, task: EPuckTask) -> None:
        """Puts the robot at the start of a task; `kernels.begin` does the rest."""
        goal = slice(stepping.GOAL_X, stepping.HORIZON + 1)
        self.constants[goal] = *task.goal, task.goal_tolerance, task.horizon
        self.state[: stepping.HEADING + 1] = task.start
        self.outcome[stepping.REMAINING] = task.shortest
