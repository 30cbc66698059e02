"""The map and the good controllers that the mutation score is measured with."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import yaml

from benchmarks.mutants import Original, originals_in
from tdac_agent.environments.map2d.builtin import Parameters, render_controller
from tdac_agent.tasks.task import Task, load_task
from tdac_envs.grid.grid import BoolGrid

ZOO = Path(__file__).parent.parent / "tests" / "agent" / "zoo" / "map2d" / "good"


def cells() -> BoolGrid:
    """Three rooms in a row, 240 x 166 px: passages of 2.9 radii below and above."""
    occupied = np.zeros((166, 240), np.bool_)
    occupied[:7] = occupied[-4:] = occupied[:, :4] = occupied[:, -4:] = True
    occupied[:127, 70:77] = occupied[42:, 154:161] = True
    # A pillar that can be passed on one side only.
    occupied[76:84, 114:120] = True
    return occupied[:, ::-1]


def small_task() -> Task:
    """A way of twice the straight distance for a body of 12 px.

    The robot looks away from its goal at first, and headings around pi are its way.
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
    """The template in two tunings, and the good ones of the zoo."""
    robot, dt = task.params.robot, task.nominal.dt
    tuned = Parameters(inflation_margin=3.0, lookahead=60.0, unstick_after=80.0)
    originals = [
        Original("builtin", "paper", render_controller(Parameters(), robot, dt)),
        Original("builtin_tuned", "paper", render_controller(tuned, robot, dt)),
    ]
    return [*originals, *originals_in(ZOO)]
