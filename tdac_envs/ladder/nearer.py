"""Starts that are nearer to the goal, for training on a task set.

From the start of a world, an untrained robot hardly ever reaches the goal, and so never
learns what it is worth.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tdac_envs.drive.task import Pose
from tdac_envs.ladder.set_file import HorizonSpec
from tdac_envs.ladder.task_sets import AnyTask
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.movers.state import SPEED

TRIES = 20
"""Largest number of draws of a start without a mover nearby."""
APART = 2.0
"""Least time after which a mover may reach the robot at its start, s."""


def nearer_task(
    task: AnyTask, step: float, horizon: HorizonSpec, random: np.random.Generator
) -> AnyTask:
    """A task with a start that is nearer to its goal, facing any way.

    The length of the path from there is drawn uniformly between the goal tolerance
    and the length from the task's own start. A start too near to a mover is drawn anew.

    Args:
        task: Task of a world.
        step: Distance of one step at full speed, px or m.
        horizon: The horizon of the set.
        random: Random numbers.

    Returns:
        The task from there, or `task` if there is no other start.
    """
    field, least = task.field, task.goal_tolerance
    # Narrow enough for a wide choice of places, and wide enough to find some.
    width = (task.shortest - least) / 20.0
    for _ in range(TRIES):
        length = random.uniform(least + width, task.shortest)
        places = np.flatnonzero(np.abs(field - length) < width)
        if not len(places):
            continue
        x, y = task.point(int(random.choice(places)))
        moved = task.moved(Pose(x, y, random.uniform(-math.pi, math.pi)))
        if _is_apart(moved):
            steps = max(moved.shortest - least, 0.0) / step
            return replace(moved, horizon=horizon.steps(steps))
    return task


def _is_apart(task: AnyTask) -> bool:
    """Whether no mover can touch the robot soon."""
    if not isinstance(task, Map2DTask) or task.movers is None:
        return True
    movers = task.movers
    x, y, radii = movers.discs().T
    gaps = np.hypot(x - task.start.x, y - task.start.y) - radii - task.robot.radius
    return bool((gaps > APART * movers.traits[:, SPEED]).all())
