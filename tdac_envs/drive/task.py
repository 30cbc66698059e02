"""Code shared by the tasks of both robots: poses, jittered starts, horizons."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tdac_envs.core.errors import TaskError

VARIATIONS = ("nominal", "jitter", "mixed", "random")
"""How starts are drawn; `"random"` also draws the goal."""
MIN_HORIZON = 2500
JITTER_HEADING = 0.5
MAX_FULL_STEP = 1e6
"""Longest distance of one step at full speed, px or m: a longer arc takes seconds."""
MAX_DRAWS = 1000


class Pose(NamedTuple):
    """Pose of a robot: x, y (px on a map, m in a world) and heading (rad)."""

    x: float
    y: float
    heading: float


def default_horizon_for(shortest: float, full_step: float) -> int:
    """Six times the steps of the shortest path at full speed, but at least 2500."""
    return max(MIN_HORIZON, math.ceil(min(6.0 * shortest / full_step, 2.0**62)))


def jittered_pose(
    nominal: Pose,
    reach: float,
    random: np.random.Generator,
    may_start: Callable[[Pose], bool],
) -> Pose:
    """A random start within `reach` of the nominal one, heading +- 0.5 rad.

    Positions are drawn from a disc that shrinks by 2 % after each draw that
    `may_start` rejects. If all draws are rejected, only the heading changes.
    """
    for _ in range(MAX_DRAWS):
        distance = reach * math.sqrt(random.random())
        bearing = random.uniform(-math.pi, math.pi)
        turn = random.uniform(-JITTER_HEADING, JITTER_HEADING)
        pose = Pose(
            nominal.x + distance * math.cos(bearing),
            nominal.y + distance * math.sin(bearing),
            wrap_heading(nominal.heading + turn),
        )
        if may_start(pose):
            return pose
        reach *= 0.98
    return nominal._replace(heading=pose.heading)


def check_full_step(dt: float, speed: float, unit: str) -> None:
    """Refuses steps so long that their arcs could not be computed in time.

    Raises:
        TaskError: A step is too long.
    """
    if dt * speed > MAX_FULL_STEP:
        raise TaskError(
            f"a step of {dt:g} s at {speed:g} {unit}/s is {dt * speed:g} {unit} long; "
            f"the limit is {MAX_FULL_STEP:g}: use a shorter dt or slower wheels"
        )


def wrap_heading(heading: float) -> float:
    """The heading wrapped to (-pi, pi]; exact for a heading of any size."""
    turn = math.remainder(heading, 2.0 * math.pi)
    return math.pi if turn <= -math.pi else turn
