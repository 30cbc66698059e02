"""The map and the good controllers of the 2D mutation score."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import yaml

from benchmarks.mutants import Original, originals_in
from tdac_agent import load_task
from tdac_agent.environments.map2d.builtin import MapParameters, template_for
from tdac_agent.tasks.task import Task
from tdac_envs.grid.grid import BoolGrid

ZOO = Path(__file__).parent.parent / "tests" / "agent" / "zoo" / "map2d" / "good"


def cells() -> BoolGrid:
    """Three rooms in a row, 240 x 166 px; passages of 2.9 radii below and above."""
    occupied = np.zeros((166, 240), np.bool_)
    occupied[:7] = occupied[-4:] = occupied[:, :4] = occupied[:, -4:] = True
    occupied[:127, 70:77] = occupied[42:, 154:161] = True
    # A pillar that the robot can pass on one side only.
    occupied[76:84, 114:120] = True
    return occupied[:, ::-1]


def small_task() -> Task:
    """A task for a body of 12 px with a route of twice the straight distance.

    The route has headings around pi, and the robot first faces away from its goal.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        np.save(folder / "map.npy", cells())
        content = {
            "schema": 1,
            "name": "three rooms",
            "map": "map.npy",
            "start": [201, 52],
            "goal": [41, 110],
            "robot": {"radius": 12},
            "horizon": 600,
        }
        (folder / "task.yaml").write_text(yaml.safe_dump(content))
        return load_task(folder)


def good_controllers(task: Task) -> list[Original]:
    """The template with two sets of parameters, and the zoo's good controllers."""
    robot, dt = task.params.robot, task.nominal.dt
    tuned = MapParameters(inflation_margin=3.0, lookahead=60.0, unstick_after=80.0)
    originals = [
        Original("builtin", "paper", template_for(robot, dt).render(MapParameters())),
        Original("builtin_tuned", "paper", template_for(robot, dt).render(tuned)),
    ]
    return [*originals, *originals_in(ZOO)]
