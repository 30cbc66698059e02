"""Files of a task set: for the judge, and what a controller may read.

That is the same in all worlds but for the map.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from tdac_agent.tasks.task import Task
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.robots import EPuckRobotParams
from tdac_envs.ladder.set_disturbances import DisturbanceSpec
from tdac_envs.ladder.set_file import SetFile
from tdac_envs.ladder.set_limits import CpuSpec
from tdac_envs.ladder.shown import in_shown_units
from tdac_envs.ladder.task_sets import AnyTask, TaskSet
from tdac_envs.map2d.task import Map2DTask


def write_set(tasks: TaskSet, path: Path) -> Path:
    """Writes the set file of a set, for other processes; returns its path."""
    values = tasks.file.model_dump(mode="json", by_alias=True)
    path.write_text(json.dumps(values), encoding="utf-8")  # JSON is YAML
    return path


def write_files(folder: Path, file: SetFile, task: AnyTask) -> None:
    """Writes what a controller may read, equal for all worlds but for the map.

    Args:
        folder: The folder.
        file: The task set.
        task: The task of a world, whose map is given if the set says so.
    """
    params = folder / "params.json"
    params.write_text(json.dumps(level_params(file), indent=2) + "\n")
    written = [params]
    if file.map and isinstance(task, Map2DTask):
        written.append(folder / "occupancy.npy")
        np.save(written[-1], task.terrain.grid.cells)
    for path in written:
        os.utime(path, (0, 0))


def write_as_level(folder: Path, task: Task) -> None:
    """Writes what a controller for a task set reads, for a task on a map.

    Raises:
        TaskError: The task is not on a map.
    """
    nominal = task.nominal
    if not isinstance(nominal, Map2DTask):
        raise TaskError(f"the task {task.name!r} is not on a map")
    facts = {
        "schema_version": 1,
        "robot": nominal.robot.written(),
        "dt": nominal.dt,
        "goal_tolerance": nominal.goal_tolerance,
        "observed": ["pose", "goal", "wheel_speeds", "ranges"],
        "frame": "map",
        "map": True,
        "disturbances": DisturbanceSpec().written(),
        "cpu": CpuSpec().model_dump(),
    }
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "params.json").write_text(json.dumps(facts, indent=2) + "\n")
    np.save(folder / "occupancy.npy", nominal.terrain.grid.cells)


def level_params(file: SetFile) -> dict[str, Any]:
    """What `params.json` tells a controller: the robot and its budget, no world.

    Lengths are in the units that the robot observes.
    """
    file = in_shown_units(file)
    robot, disturbances = file.robot, file.disturbances.written()
    sizes: dict[str, Any]
    if isinstance(robot, EPuckRobotParams):
        sizes = {"kind": robot.kind, **robot.sizes}
        disturbances |= robot.errors
    else:
        sizes = robot.written()
    scale = {} if file.resolution is None else {"resolution": file.resolution}
    return {
        "schema_version": 1,
        **scale,
        "robot": sizes,
        "dt": file.dt,
        "goal_tolerance": file.goal_tolerance,
        "observed": list(file.observed),
        "frame": file.frame,
        "map": file.map,
        "disturbances": disturbances,
        "cpu": file.cpu.model_dump(),
    }
