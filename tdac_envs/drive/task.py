"""Code shared by the tasks of both robots: poses, jittered starts, horizons."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from tdac_envs.core.errors import TaskError

VARIATIONS = ("nominal", "jitter", "mixed", "random")
"""How starts are drawn; `"random"` also draws the goal."""
MIN_HORIZON = 2500
JITTER_HEADING = 0.5
MAX_FULL_STEP = 1e6
"""Longest distance of one step at full speed, px or m: a longer arc takes seconds."""
MAX_DRAWS = 1000
AT_START = ("world_index", "generator", "difficulty")
"""Entries of the `info` of `reset` on a task set, in the splits `train` and `dev`, for
the user alone: no controller sees them."""
FAR_OFF = 2.0
"""A goal tolerance above this many body radii is pointed out."""
_TOLERANCE = "the tolerance"


class Pose(NamedTuple):
    """Pose of a robot: x, y (px on a map, m in a world) and heading (rad)."""

    x: float
    y: float
    heading: float


def default_horizon(shortest: float, full_step: float) -> int:
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


def mixed_start(task: Any, random: np.random.Generator) -> Pose:
    """A jittered start or, with probability 0.5, any feasible one.

    The latter is drawn from the places of the task's field that are connected to the
    goal, so that a learner sees all parts of the map without having to drive there
    first.
    """
    if random.random() < 0.5:
        start: Pose = task.jittered(random)
        return start
    connected = np.flatnonzero(np.isfinite(task.field))
    for _ in range(MAX_DRAWS):
        x, y = task.point(int(random.choice(connected)))
        heading = wrap_heading(random.uniform(-math.pi, math.pi))
        if not task.is_at_goal(x, y, task.goal):
            return Pose(x, y, heading)
    nominal: Pose = task.start
    return nominal


def random_task(task: Any, random: np.random.Generator) -> Any:
    """A task with any feasible start and goal; all else but the path is the same.

    Both points are drawn from the places of the task's field that are connected to the
    nominal goal. If every draw starts within the tolerance of its goal, the result is
    the nominal task.
    """
    connected = np.flatnonzero(np.isfinite(task.field))
    for _ in range(MAX_DRAWS):
        end, begin = (int(random.choice(connected)) for _ in range(2))
        heading = wrap_heading(random.uniform(-math.pi, math.pi))
        goal, (x, y) = task.point(end), task.point(begin)
        if not task.is_at_goal(x, y, goal):
            field, start = task.field_to(end), Pose(x, y, heading)
            length = float(field.flat[begin])
            return replace(task, start=start, goal=goal, field=field, shortest=length)
    return task


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


def radii_text(length: float, radius: float) -> str:
    """Formats a length as a multiple of the body radius: `1.0 radii`."""
    return f"{length / radius:.1f} radii"


def with_tolerance_note(
    notes: Sequence[str], task: Any, text: Callable[[float], str]
) -> tuple[str, ...]:
    """Notes on a task, with one on a tolerance above `FAR_OFF` radii.

    Args:
        notes: The other notes; they may have the note of an earlier tolerance.
        task: The task.
        text: Formats a length of the task.
    """
    others = tuple(note for note in notes if not note.startswith(_TOLERANCE))
    if task.goal_tolerance <= FAR_OFF * task.body_radius:
        return others
    many = radii_text(task.goal_tolerance, task.body_radius)
    note = (
        f"{_TOLERANCE} of {text(task.goal_tolerance)} is {many}: the robot may stop "
        "far from the goal; give a smaller one (--tolerance, goal_tolerance)"
    )
    return (*others, note)


def wrap_heading(heading: float) -> float:
    """The heading wrapped to (-pi, pi]; exact for a heading of any size."""
    turn = math.remainder(heading, 2.0 * math.pi)
    return math.pi if turn <= -math.pi else turn
