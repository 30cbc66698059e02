"""Tasks of the training worlds, which are made once and kept in files.

A task takes about 13 bytes per pixel. The files are mapped into memory, so processes
share them, and the operating system keeps in memory those that are used.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import zlib
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.trusted_folders import is_usable, user_cache
from tdac_envs.drive.task import Pose
from tdac_envs.grid.grid import OccupancyGrid
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.map2d.terrain import Terrain

Bytes = NDArray[np.uint8]

_HEAD = 8
"""Numbers before the arrays: height, width, start, goal, horizon."""


class TrainingPool:
    """The training tasks of a set, by the numbers of their worlds.

    Args:
        task_set: The set.
    """

    def __init__(self, task_set: TaskSet) -> None:
        self._set = task_set
        self._tasks: dict[int, Map2DTask] = {}
        self._folder = pool_folder(task_set.sha256)

    def task(self, index: int) -> Map2DTask:
        """The task of a training world.

        It is made if no file has it. Without a folder, it is made at each call.

        Raises:
            TaskError: There is no feasible world.
        """
        kept = self._tasks.get(index)
        if kept is not None:
            return kept
        if self._folder is None:
            return self._set.task("train", index)
        path = self._folder / f"{index}.npy"
        task = _read(path, self._set)
        if task is None:
            made = self._set.task("train", index)
            task = _read(path, self._set) if _write(path, made) else None
            if task is None:
                return made
        self._tasks[index] = task
        return task


def pool_folder(set_sha256: str) -> Path | None:
    """Folder of the worlds of a set; None if worlds cannot be kept."""
    caches = user_cache()
    if caches is None:
        return None
    folder = caches / "tdac" / "worlds" / f"{set_sha256[:16]}-{_sources()}"
    return folder if is_usable(folder) else None


@cache
def _sources() -> str:
    """Hash of the code that makes worlds."""
    files = sorted(Path(__file__).parent.rglob("*.py"))
    joined = b"".join(file.read_bytes() for file in files)
    return hashlib.sha256(joined).hexdigest()[:16]


def _write(path: Path, task: Map2DTask) -> bool:
    """Writes a task completely or not at all; returns whether it is written."""
    terrain = task.terrain
    height, width = terrain.grid.cells.shape
    head = [height, width, *task.start, *task.goal, task.horizon]
    arrays = (
        np.array(head, np.float64),
        task.field,
        terrain.padded_clear,
        terrain.leaps,
        terrain.grid.cells,
    )
    body = b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)
    check = np.array([zlib.crc32(body)], np.int64).tobytes()
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            try:
                np.save(file, np.frombuffer(check + body, np.uint8))
                file.flush()
                os.replace(file.name, path)
            except BaseException:
                os.unlink(file.name)
                raise
    except OSError:
        return False
    return True


def _read(path: Path, task_set: TaskSet) -> Map2DTask | None:
    """The task in a file; None if there is no such file, or if it is damaged."""
    try:
        data = np.load(path, mmap_mode="r").view(np.ndarray)
    except (OSError, ValueError, EOFError):
        return None
    most = 64 + 32 * (task_set.file.largest_side + 2) ** 2
    if data.dtype != np.uint8 or data.ndim != 1 or not 72 < data.size <= most:
        return None
    if zlib.crc32(data[8:]) != int(data[:8].view(np.int64)[0]):
        return None
    return _task(data[8:], task_set)


def _task(data: Bytes, task_set: TaskSet) -> Map2DTask:
    height, width, x, y, heading, *goal, horizon = (
        data[: 8 * _HEAD].view(np.float64).tolist()
    )
    shape = int(height), int(width)
    padded = shape[0] + 2, shape[1] + 2
    at = 8 * _HEAD

    def part(dtype: type[np.generic], *sides: int) -> NDArray[np.generic]:
        nonlocal at
        size = int(np.prod(sides)) * np.dtype(dtype).itemsize
        piece, at = data[at : at + size], at + size
        return piece.view(dtype).reshape(sides)

    field = part(np.float32, *shape)
    clear = part(np.float32, *padded)
    leaps = part(np.uint8, 4, *padded)
    grid = OccupancyGrid(part(np.bool_, *shape))
    file = task_set.file
    return Map2DTask(
        terrain=Terrain(grid, clear[1:-1, 1:-1], clear, leaps),
        start=Pose(x, y, heading),
        goal=(goal[0], goal[1]),
        robot=file.robot,
        goal_tolerance=file.goal_tolerance,
        dt=file.dt,
        horizon=int(horizon),
        field=field,
        shortest=float(field[round(y), round(x)]),
    )
