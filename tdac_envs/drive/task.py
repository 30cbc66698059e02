"""What the tasks of both robots share: poses, jittered starts, horizons."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

VARIATIONS = ("nominal", "jitter", "mixed", "random")
"""How starts, and for the last one goals, are drawn."""
MIN_HORIZON = 2500
JITTER_HEADING = 0.5
MAX_DRAWS = 1000


class Pose(NamedTuple):
    """Place and heading of the robot, in the frame and units of its environment."""

    x: float
    y: float
    heading: float


def generous_horizon(shortest: float, full_step: float) -> int:
    """Six times the full-speed steps of a shortest path, or 2500; any one unit."""
    return max(MIN_HORIZON, math.ceil(min(6.0 * shortest / full_step, 2.0**62)))


def jittered_pose(
    nominal: Pose,
    reach: float,
    random: np.random.Generator,
    may_start: Callable[[Pose], bool],
) -> Pose:
    """A pose within `reach` of the nominal one that may be a start, heading +- 0.5 rad.

    The disc that is drawn from shrinks slowly; where the body fits nowhere but at the
    nominal start, only the heading changes.
    """
    for _ in range(MAX_DRAWS):
        distance = reach * math.sqrt(random.random())
        bearing = random.uniform(-math.pi, math.pi)
        turn = random.uniform(-JITTER_HEADING, JITTER_HEADING)
        pose = Pose(
            nominal.x + distance * math.cos(bearing),
            nominal.y + distance * math.sin(bearing),
            wrapped(nominal.heading + turn),
        )
        if may_start(pose):
            return pose
        reach *= 0.98
    return nominal._replace(heading=pose.heading)


def wrapped(heading: float) -> float:
    """The same direction in (-pi, pi], for a heading of any size."""
    turn = math.remainder(heading, 2.0 * math.pi)
    return math.pi if turn <= -math.pi else turn
