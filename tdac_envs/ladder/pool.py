"""Tasks of the training worlds, which are made once and kept in files.

A task takes about 13 bytes per pixel. Its file is mapped, not read: the memory belongs
to the system's cache of files, and a robot loads only the parts of a map where it
drives. So thousands of tasks stay at hand, and drawing one takes microseconds.
"""

from __future__ import annotations

import contextlib
import hashlib
import mmap
import os
import tempfile
import zlib
from collections import OrderedDict
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.trusted_folders import is_usable, user_cache
from tdac_envs.drive.task import Pose
from tdac_envs.grid.grid import OccupancyGrid
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.map2d.terrain import Terrain
from tdac_envs.mapping.params import RobotParams

Bytes = NDArray[np.uint8]
Scalar = TypeVar("Scalar", bound=np.generic)

_MAPPED = 16_384
"""Mapped tasks that a process keeps; Linux allows 65,530 mappings."""
_IN_MEMORY = 256
"""Tasks without a file that a process keeps in memory."""
_HEAD = 8
"""Numbers before the arrays: height, width, start, goal, horizon."""


class TrainingPool:
    """The training tasks of a set, by the numbers of their worlds.

    Args:
        task_set: The set.
    """

    def __init__(self, task_set: TaskSet) -> None:
        self._set = task_set
        self._mapped: OrderedDict[int, Map2DTask] = OrderedDict()
        self._made: OrderedDict[int, Map2DTask] = OrderedDict()
        self._folder = pool_folder(task_set.sha256)

    def task(self, index: int) -> Map2DTask:
        """The task of a training world.

        It is made if no file has it.

        Raises:
            TaskError: There is no feasible world.
        """
        task = self._mapped.get(index) or self._made.get(index)
        return self._found(index) if task is None else task

    def __getstate__(self) -> dict[str, Any]:
        # A copy finds the files again; it need not carry gigabytes.
        return {**self.__dict__, "_mapped": OrderedDict(), "_made": OrderedDict()}

    def _found(self, index: int) -> Map2DTask:
        """The task from its file, or made and written to it if possible."""
        path = None if self._folder is None else self._folder / f"{index}.bin"
        task = None if path is None else _mapped_task(path, self._set)
        if task is None:
            made = self._set.task_of(self._set.world("train", index))
            assert isinstance(made, Map2DTask)
            if path is not None:
                _write(path, made)
                task = _mapped_task(path, self._set)
            if task is None:
                made = self._set.with_movers(made, "train", index)
                return _keep(self._made, index, made, _IN_MEMORY)
        task = self._set.with_movers(task, "train", index)
        return _keep(self._mapped, index, task, _MAPPED)


def _keep(
    kept: OrderedDict[int, Map2DTask], index: int, task: Map2DTask, most: int
) -> Map2DTask:
    """Adds a task to those that are kept, in place of the oldest one."""
    kept[index] = task
    if len(kept) > most:
        kept.popitem(last=False)
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


def _write(path: Path, task: Map2DTask) -> None:
    """Writes a task completely or not at all."""
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
    check = zlib.crc32(body).to_bytes(8, "little")
    # Without room on the disk, the task is made anew next time.
    with contextlib.suppress(OSError):
        handle, name = tempfile.mkstemp(dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(check + body)
            os.replace(name, path)
        except BaseException:
            os.unlink(name)
            raise


def _mapped_task(path: Path, task_set: TaskSet) -> Map2DTask | None:
    """The task in a file; None if there is no such file, or if it is damaged."""
    try:
        with path.open("rb") as file:
            data = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
    except (OSError, ValueError):  # an empty file cannot be mapped
        return None
    check, body = data[:8], data[8:]
    if len(body) == 0 or zlib.crc32(body) != int.from_bytes(check, "little"):
        return None
    return _task(np.frombuffer(body, np.uint8), task_set)


def _task(data: Bytes, task_set: TaskSet) -> Map2DTask:
    height, width, x, y, heading, *goal, horizon = (
        data[: 8 * _HEAD].view(np.float64).tolist()
    )
    shape = int(height), int(width)
    padded = shape[0] + 2, shape[1] + 2
    at = 8 * _HEAD

    def part(dtype: type[Scalar], *sides: int) -> NDArray[Scalar]:
        nonlocal at
        size = int(np.prod(sides)) * np.dtype(dtype).itemsize
        piece, at = data[at : at + size], at + size
        return piece.view(dtype).reshape(sides)

    field = part(np.float32, *shape)
    clear = part(np.float32, *padded)
    leaps = part(np.uint8, 4, *padded)
    grid = OccupancyGrid(part(np.bool_, *shape))
    file, robot = task_set.file, task_set.file.robot
    assert isinstance(robot, RobotParams)
    return Map2DTask(
        terrain=Terrain(grid, clear[1:-1, 1:-1], clear, leaps),
        start=Pose(x, y, heading),
        goal=(goal[0], goal[1]),
        robot=robot,
        goal_tolerance=file.goal_tolerance,
        dt=file.dt,
        horizon=int(horizon),
        field=field,
        shortest=float(field[round(y), round(x)]),
    )
