"""A task that a verification needs little time for."""

from pathlib import Path

import numpy as np
import yaml

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
