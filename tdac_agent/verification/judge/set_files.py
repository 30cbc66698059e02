"""What a controller for a task set may read: the same in all worlds but for the map."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from tdac_envs.ladder.robots import EPuckRobotParams
from tdac_envs.ladder.set_file import SetFile
from tdac_envs.ladder.task_sets import AnyTask
from tdac_envs.map2d.task import Map2DTask


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


def level_params(file: SetFile) -> dict[str, Any]:
    """What `params.json` tells a controller: the robot and its budget, no world."""
    robot, disturbances = file.robot, file.disturbances.model_dump()
    sizes: dict[str, Any]
    if isinstance(robot, EPuckRobotParams):
        sizes = {"kind": robot.kind, **robot.sizes}
        disturbances |= robot.errors
    else:
        sizes = robot.model_dump()
    return {
        "schema_version": 1,
        "robot": sizes,
        "dt": file.dt,
        "goal_tolerance": file.goal_tolerance,
        "observed": list(file.observed),
        "frame": file.frame,
        "map": file.map,
        "disturbances": disturbances,
        "cpu": file.cpu.model_dump(),
    }
