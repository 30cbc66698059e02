"""The seam between a physics and an environment."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.errors import TaskError, hint

EXACT, MUJOCO, VARIED = "exact", "mujoco", "mujoco-varied"
MEASURED = "mujoco-rays"
"""MuJoCo also measures the rays of the distance sensors."""
ENGINES = EXACT, MUJOCO, VARIED, MEASURED
"""Values of the argument `physics` of the environments."""
Pose = tuple[float, float, float]


class Moved(NamedTuple):
    """What a body did in one control step.

    Attributes:
        pose: x, y (m) of the middle of the axle and heading (rad, counter-clockwise).
        touched: Whether the body touched anything but the ground during the step.
        turned: Angles by which the left and right wheel turned, rad.
    """

    pose: Pose
    touched: bool
    turned: tuple[float, float]


class Physics(Protocol):
    """Moves a body. Lengths are metres, y is to the left of x, angles are radians."""

    def reset(self, pose: Pose) -> None:
        """Begins an episode: the robot stands at a pose, and all things are at rest."""

    def step(self, left: float, right: float, dt: float) -> Moved:
        """Drives for one control step.

        Args:
            left: Commanded rim speed of the left wheel, m/s.
            right: Commanded rim speed of the right wheel, m/s.
            dt: Duration, s.
        """

    def things(self) -> NDArray[np.float64]:
        """Shape (k, 3): x, y (m) and rotation since the reset (rad) of free things."""


def rim_speeds(
    forward: float, turn: float, axle_length: float, dt: float
) -> tuple[float, float]:
    """Speeds of the left and right rim that drive an arc.

    Args:
        forward: Length of the arc, in any unit of length.
        turn: Change of heading, rad, counter-clockwise.
        axle_length: Effective axle, in the same unit.
        dt: Duration, s.
    """
    apart = 0.5 * turn * axle_length
    return (forward - apart) / dt, (forward + apart) / dt


def arc_between(begin: Pose, end: Pose) -> tuple[float, float]:
    """Length and turn (rad) of the arc from a pose that ends nearest to another one.

    It has the turn of the motion; what the body slid sideways is left out.
    """
    turn = math.remainder(end[2] - begin[2], math.tau)
    middle = begin[2] + 0.5 * turn
    chord = (end[0] - begin[0]) * math.cos(middle) + (end[1] - begin[1]) * math.sin(
        middle
    )
    half = 0.5 * turn
    ratio = math.sin(half) / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0
    return chord / ratio, turn


def engine_named(name: object) -> str:
    """The name of a physics, checked.

    Raises:
        TaskError: There is no such physics.
    """
    if name in ENGINES:
        return str(name)
    known = ", ".join(ENGINES)
    raise TaskError(
        f"unknown physics {name!r:.60}; expected one of {known}"
        f"{hint(str(name), ENGINES)}"
    )
