"""Where the tasks of TDAC-Ladder-v0 come from: the worlds of a split, by number."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from tdac_envs.core.arguments import number_up_to, whole_number
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.task import Pose
from tdac_envs.ladder.pool import PlatePool, TrainingPool
from tdac_envs.ladder.set_limits import HorizonSpec
from tdac_envs.ladder.task_sets import AnyTask, AnyWorld, TaskSet
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.movers.state import SPEED

MOST_WORLDS = 2**31
"""Exclusive upper bound of the world numbers that are drawn at random."""
REVEALED = ("train", "dev")
"""Splits of which `info` says which world an episode has."""

TRIES = 20
"""Largest number of draws of a start without a mover nearby."""
APART = 2.0
"""Least time after which a mover may reach the robot at its start, s."""


class SetSource:
    """The tasks of a split: a random world for each episode, or that of `index`.

    The disturbances of a training episode follow from the environment's seed. In the
    other splits, they follow from the world.

    Args:
        task_set: The set.
        split: One of `task_sets.SPLITS`.
        train_pool: Number of training worlds, which are kept; 0 for a new world in
            each episode.
        salt: Salt of the split `hidden`.
        nearer_starts: Probability with which a training episode begins nearer to the
            goal; see `nearer_task`.

    Attributes:
        gives_map: Whether robots are given the map of their world.

    Raises:
        TaskError: The split is unknown, its salt is missing or not needed, or nearer
            starts are asked for in a split that is not for training.
    """

    def __init__(
        self,
        task_set: TaskSet,
        split: str,
        train_pool: int,
        salt: bytes | None,
        nearer_starts: float = 0.0,
    ) -> None:
        task_set.key(split, 0, "world", salt)  # checks the split and its salt
        self._set, self._split, self._salt = task_set, split, salt
        self.gives_map = task_set.file.map
        self._nearer = number_up_to("nearer_starts", nearer_starts, 1.0)
        if self._nearer and split != "train":
            raise TaskError(
                f"nearer_starts is for the split 'train', not for {split!r}"
            )
        size = whole_number("train_pool", train_pool, 0, MOST_WORLDS)
        kept = split == "train" and size > 0
        pool = PlatePool if task_set.file.is_epuck else TrainingPool
        self._pool = pool(task_set) if kept else None
        most, count = size if kept else MOST_WORLDS, task_set.count(split)
        self._count = most if count is None else min(count, most)
        self._last: tuple[int, AnyWorld, AnyTask] | None = None

    def task(self, index: int) -> AnyTask:
        """The task of a world.

        Raises:
            TaskError: There is no feasible world.
        """
        index = whole_number("index", index, 0)
        if self._pool is not None:
            return self._pool.task(index)
        return self._made(index)[2]

    def world(self, index: int) -> AnyWorld:
        """A world with its figures, made anew unless it was the last one.

        Raises:
            TaskError: There is no feasible world.
        """
        return self._made(whole_number("index", index, 0))[1]

    def _made(self, index: int) -> tuple[int, AnyWorld, AnyTask]:
        if self._last is None or self._last[0] != index:
            world, task = self._set.world_and_task(self._split, index, self._salt)
            if self._split in REVEALED:
                task = self._set.with_facts(task, self._split, index, world.difficulty)
            self._last = index, world, task
        return self._last

    def draw(
        self, options: dict[str, Any], random: np.random.Generator
    ) -> tuple[AnyTask, np.random.Generator]:
        """As `drive.setup.TaskSource` says; the only option is `index`."""
        unknown = sorted(map(str, options.keys() - {"index"}))
        if unknown:
            raise TaskError(f"unknown reset options {unknown}; expected 'index'")
        index = options.get("index")
        number = int(random.integers(self._count)) if index is None else index
        task = self.task(number)
        if index is None and self._nearer and random.random() < self._nearer:
            file = self._set.file
            task = nearer_task(task, file.full_step, file.horizon, random)
        if self._split == "train":
            return task, random
        return task, self._set.noise(self._split, number, self._salt)


def nearer_task(
    task: AnyTask, step: float, horizon: HorizonSpec, random: np.random.Generator
) -> AnyTask:
    """A task with a start that is nearer to its goal, facing any way.

    From the start of a world, an untrained robot hardly ever reaches the goal, and so
    never learns what it is worth.
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
