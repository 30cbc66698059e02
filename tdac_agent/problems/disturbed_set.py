"""A task set with other disturbances than its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from pydantic import ValidationError

from tdac_envs.core.errors import TaskError, first_problem
from tdac_envs.ladder.set_disturbances import LENGTHS
from tdac_envs.ladder.set_file import SetFile
from tdac_envs.ladder.task_sets import TaskSet

LONGEST_NAME = 48
NAME_END = "-disturbed"


def disturbed_set(tasks: TaskSet, sizes: Mapping[str, float]) -> TaskSet:
    """The worlds of a set with other disturbances: a set with a hash of its own.

    Args:
        tasks: The set.
        sizes: Sizes of some disturbances by name, lengths in the units that the robot
            observes; the others stay. None leaves the set as it is.

    Raises:
        TaskError: The set's robot has no such disturbance, or a size is out of range.
    """
    if not sizes:
        return tasks
    file = tasks.file
    own = file.model_dump(mode="json", by_alias=True)
    unknown = sizes.keys() - own["disturbances"].keys()
    if unknown:
        raise TaskError(f"a task set has no disturbance {min(unknown)}")
    changed = {
        name: file.units.length_in_pixels(size) if name in LENGTHS else size
        for name, size in sizes.items()
    }
    values = {
        **own,
        "name": file.name[:LONGEST_NAME] + NAME_END,
        "worlds_of": file.worlds_of or tasks.sha256,
        "disturbances": {**own["disturbances"], **changed},
    }
    try:
        return replace(tasks, file=SetFile.model_validate(values))
    except ValidationError as error:
        problem = first_problem(error, SetFile)
        raise TaskError(f"{file.name}: {problem}") from None
