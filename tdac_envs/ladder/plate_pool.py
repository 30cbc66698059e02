"""Tasks of the training worlds of an e-puck, which are kept in memory."""

from __future__ import annotations

from collections import OrderedDict

from tdac_envs.ladder.task_sets import AnyTask, TaskSet

MOST = 512
"""Tasks that a process keeps, of about 1.2 MB each."""


class PlatePool:
    """The training tasks of a set, by the numbers of their worlds.

    Making one takes some 50 ms. Those that were drawn last are kept.

    Args:
        task_set: The set.
    """

    def __init__(self, task_set: TaskSet) -> None:
        self._set = task_set
        self._tasks: OrderedDict[int, AnyTask] = OrderedDict()

    def task(self, index: int) -> AnyTask:
        """The task of a training world.

        Raises:
            TaskError: There is no feasible world.
        """
        task = self._tasks.get(index)
        if task is None:
            world, made = self._set.world_and_task("train", index)
            task = self._set.told(made, "train", index, world.difficulty)
            self._tasks[index] = task
        self._tasks.move_to_end(index)
        if len(self._tasks) > MOST:
            self._tasks.popitem(last=False)
        return task
