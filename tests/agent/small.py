"""A task that a verification needs little time for."""

from pathlib import Path

import numpy as np
import yaml

from tdac_agent import load_task
from tdac_agent.sandbox import Limits

QUICK = Limits(import_seconds=1.5, reset_seconds=1.5, call_seconds=1.5, cpu_seconds=30)


def small_cells():
    """A room of 160 x 120 px with a wall that ends 40 px above the lower side."""
    cells = np.zeros((120, 160), np.bool_)
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = True
    cells[:80, 70:76] = True
    return cells


# A short way in short steps, on which a slow controller is soon cut off.
SHORT = {"dt": 0.02, "start": [95, 30], "goal": [130, 90]}


def write_small_task(folder: Path, **changes) -> Path:
    """A folder with the small map and a task.yaml; `changes` go into the file."""
    folder.mkdir(parents=True, exist_ok=True)
    np.save(folder / "map.npy", small_cells())
    content = {
        "schema": 1,
        "map": "map.npy",
        "start": [30, 30],
        "goal": [130, 30],
        "robot": {"radius": 6},
        "name": "small",
        "horizon": 400,
    }
    (folder / "task.yaml").write_text(yaml.safe_dump(content | changes))
    return folder


def room_with_blocks(folder: Path, start, range_max, offset):
    """A task in a room with two blocks, on a robot whose scanner is off its centre."""
    cells = np.zeros((110, 170), np.bool_)
    cells[:6] = cells[-6:] = cells[:, :6] = cells[:, -6:] = True
    cells[30:42, 90:110] = cells[70:85, 40:52] = True
    np.save(folder / "map.npy", cells)
    robot = {
        "radius": 8, "axle": 12, "max_wheel_speed": 30, "n_rays": 72,
        "field_of_view": 355, "range_max": range_max, "scanner_offset": [*offset],
    }  # fmt: skip
    own = {"map": "map.npy", "start": [*start], "goal": [140, 85], "robot": robot}
    (folder / "task.yaml").write_text(yaml.safe_dump(own))
    return load_task(folder / "task.yaml")
