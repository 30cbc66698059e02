"""Which problem a task, a task set or a run folder is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tdac_agent.problems.problem import Problem
from tdac_agent.problems.single_task import TaskProblem, kept_task
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import SET_FILE, TASK_FILE

if TYPE_CHECKING:
    from tdac_envs.ladder.task_sets import TaskSet


def problem_of(about: Task | TaskSet | Problem) -> Problem:
    """A task or a task set as a problem; a problem stays itself."""
    if isinstance(about, Task):
        return TaskProblem(about)
    if isinstance(about, TaskProblem):
        return about
    # Task sets need much that a task does not.
    from tdac_agent.problems.task_set import SetProblem
    from tdac_envs.ladder.task_sets import TaskSet

    return SetProblem(about) if isinstance(about, TaskSet) else about


def kept_problem(folder: Path) -> Problem | None:
    """What a run folder is about; None if its files were not written completely.

    The user's own tests may not run before they are permitted.

    Raises:
        RunError: Its parameters are damaged.
        TaskError: The task or the task set cannot be read.
    """
    if (folder / SET_FILE).is_file():
        # As above.
        from tdac_agent.problems.task_set import kept_set

        return kept_set(folder)
    return kept_task(folder) if (folder / TASK_FILE).is_file() else None
