"""The tasks that the zoo is judged in, one of each kind."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path

import cv2
import numpy as np
import yaml

from tdac_agent import load_task
from tdac_agent.environments.epuck.entry import EPUCK
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import TaskFile

WORLD = Path(__file__).parent / "epuck" / "world.wbt"


@functools.cache
def zoo_task(kind: str) -> Task:
    """The task of a kind."""
    return KINDS[kind]()


def map_task() -> Task:
    """Two walls to drive around, on 200 x 150 px, for a body of 6 px."""
    with tempfile.TemporaryDirectory() as name:
        return load_task(write_map_task(Path(name)))


def write_map_task(folder: Path, **changes: object) -> Path:
    """Writes the files of the same task, of which some keys may differ."""
    picture = np.full((150, 200), 255, np.uint8)
    picture[:4] = picture[-4:] = picture[:, :4] = picture[:, -4:] = 0
    picture[:96, 60:69] = picture[55:, 125:134] = 0
    cv2.imwrite(str(folder / "map.png"), picture)
    content = {
        "schema": 1,
        "name": "zoo",
        "map": "map.png",
        "robot": {"radius": 6},
        "horizon": 500,
        "start": [30, 40, 0.0],
        "goal": [165, 110],
        "tolerance": 8,
    }
    (folder / "task.yaml").write_text(yaml.safe_dump({**content, **changes}))
    return folder


def world_task() -> Task:
    """Two walls to drive around, in an arena that is turned and off the origin."""
    return load_task(TaskFile(env=EPUCK.id, world=str(WORLD), name="zoo"))


KINDS = {"map2d": map_task, "epuck": world_task}
"""What makes the task, by kind; the zoo has a folder of this name."""
