"""Tasks of the training worlds, which are made once and kept in files.

A task takes about 13 bytes per pixel, and up to 8 more with a crowd. Its file is
mapped, not read: the memory belongs to the system's cache of files, and a robot loads
only the parts of a map where it drives. So thousands of tasks stay at hand, and drawing
one takes microseconds.
"""

from __future__ import annotations

import contextlib
import json
import math
import mmap
import os
import re
import shutil
import tempfile
import zlib
from collections import OrderedDict
from dataclasses import astuple
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.dynamics import code_sha256
from tdac_envs.core.hashing import sha256_of
from tdac_envs.core.trusted_folders import is_usable, user_cache
from tdac_envs.drive.task import Pose
from tdac_envs.grid.grid import OccupancyGrid
from tdac_envs.ladder.difficulty import Difficulty
from tdac_envs.ladder.frozen import ON_MAPS_OF_SETS
from tdac_envs.ladder.task_sets import AnyTask, TaskSet
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.map2d.terrain import Terrain
from tdac_envs.mapping.params import RobotParams
from tdac_envs.movers.destinations import Destinations
from tdac_envs.movers.state import Movers

_FORMAT = 1
"""Format of the files."""
_MAPPED = 16_384
"""Mapped tasks that a process keeps; Linux allows 65,530 mappings."""
_IN_MEMORY = 256
"""Tasks without a file that a process keeps in memory."""
_LEAST_FREE = 2_000_000_000
"""Bytes that are left free on the disk."""
_FOLDER = re.compile("[0-9a-f]{16}-[0-9a-f]{16}")
"""Name of the folder of a set: hashes of the set and of the code."""
_ALIGNED = 8
"""Alignment of the arrays, bytes."""
MOST_PLATES = 512
"""Tasks of an e-puck that a process keeps, of about 1.2 MB each."""
_MOVERS = "traits", "now", "points", "people", *Destinations._fields
"""Arrays of movers that are kept; the others are blank at a start."""


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
        task = None if path is None else _mapped_task(path, self._set, index)
        if task is None:
            world, made = self._set.world_and_task("train", index)
            assert isinstance(made, Map2DTask)
            made = self._set.with_facts(made, "train", index, world.difficulty)
            if path is not None:
                _write(path, made, world.difficulty)
                task = _mapped_task(path, self._set, index)
            if task is None:
                return _keep(self._made, index, made, _IN_MEMORY)
        return _keep(self._mapped, index, task, _MAPPED)


class PlatePool:
    """The training tasks of a set, by the numbers of their worlds.

    Making one takes some 50 ms. Those that were drawn last are kept.

    Args:
        task_set: The set.
    """

    def __init__(self, task_set: TaskSet) -> None:
        self._set = task_set
        self._tasks: OrderedDict[int, AnyTask] = OrderedDict()

    def task(self, index: int) -> AnyTask:
        """The task of a training world.

        Raises:
            TaskError: There is no feasible world.
        """
        task = self._tasks.get(index)
        if task is None:
            world, made = self._set.world_and_task("train", index)
            task = self._set.with_facts(made, "train", index, world.difficulty)
            self._tasks[index] = task
        self._tasks.move_to_end(index)
        if len(self._tasks) > MOST_PLATES:
            self._tasks.popitem(last=False)
        return task


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
    fresh = not folder.exists()
    if not is_usable(folder):
        return None
    if fresh:
        _remove_others(folder)
    return folder


def _remove_others(folder: Path) -> None:
    """Removes worlds that another version of the code has made: gigabytes per level.

    Files that another process has mapped stay readable for it.
    """
    for other in folder.parent.iterdir():
        if _FOLDER.fullmatch(other.name) and not other.name.endswith(_sources()):
            shutil.rmtree(other, ignore_errors=True)


@cache
def _sources() -> str:
    """Hash of the code that makes worlds, which no docstring changes."""
    return sha256_of(code_sha256(*ON_MAPS_OF_SETS), f"\n{_FORMAT}")[:16]


def _write(path: Path, task: Map2DTask, difficulty: Difficulty) -> None:
    """Writes a task completely or not at all.

    Without room on the disk, it is made anew next time.
    """
    terrain, movers = task.terrain, task.movers
    arrays: dict[str, NDArray[Any]] = {
        "ends": np.array([*task.start, *task.goal, task.horizon], np.float64),
        "difficulty": np.array(astuple(difficulty), np.float64),
        "field": task.field,
        "clear": terrain.padded_clear,
        "leaps": terrain.leaps,
        "cells": terrain.grid.cells,
    }
    if movers is not None:
        arrays |= {name: getattr(movers, name) for name in _MOVERS}
    head = json.dumps({name: (a.dtype.str, a.shape) for name, a in arrays.items()})
    parts = [len(head).to_bytes(8, "little"), head.encode("ascii")]
    parts += [np.ascontiguousarray(array).tobytes() for array in arrays.values()]
    body = b"".join(part + bytes(-len(part) % _ALIGNED) for part in parts)
    check = zlib.crc32(body).to_bytes(8, "little")
    # Another version of the code may remove the folder meanwhile.
    with contextlib.suppress(OSError):
        if shutil.disk_usage(path.parent).free < _LEAST_FREE:
            return
        handle, name = tempfile.mkstemp(dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(check + body)
            os.replace(name, path)
        except BaseException:
            os.unlink(name)
            raise


def _mapped_task(path: Path, task_set: TaskSet, index: int) -> Map2DTask | None:
    """The task in a file; None if there is no such file, or if it is damaged."""
    try:
        with path.open("rb") as file:  # raw read: our own cache
            data = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
    except (OSError, ValueError):  # an empty file cannot be mapped
        return None
    check, body = data[:8], data[8:]
    if len(body) == 0 or zlib.crc32(body) != int.from_bytes(check, "little"):
        return None
    task, difficulty = _task(body, task_set)
    return task_set.with_facts(task, "train", index, difficulty)


def _arrays(body: memoryview) -> dict[str, NDArray[Any]]:
    """The arrays of a file by their names."""
    arrays: dict[str, NDArray[Any]] = {}
    at = 8 + int.from_bytes(body[:8], "little")
    for name, (dtype, shape) in json.loads(bytes(body[8:at])).items():
        at += -at % _ALIGNED
        array = np.frombuffer(body, dtype, math.prod(shape), at).reshape(shape)
        arrays[name], at = array, at + array.nbytes
    return arrays


def _task(body: memoryview, task_set: TaskSet) -> tuple[Map2DTask, Difficulty]:
    arrays = _arrays(body)
    clear, field = arrays["clear"], arrays["field"]
    x, y, heading, goal_x, goal_y, horizon = arrays["ends"].tolist()
    grid = OccupancyGrid(arrays["cells"])
    file, robot = task_set.file, task_set.file.robot
    assert isinstance(robot, RobotParams)
    task = Map2DTask(
        terrain=Terrain(grid, clear[1:-1, 1:-1], clear, arrays["leaps"]),
        start=Pose(x, y, heading),
        goal=(goal_x, goal_y),
        robot=robot,
        goal_tolerance=file.goal_tolerance,
        dt=file.dt,
        horizon=int(horizon),
        field=field,
        shortest=float(field[round(y), round(x)]),
        movers=_movers(arrays, file.dt) if "traits" in arrays else None,
    )
    return task, Difficulty(*arrays["difficulty"].tolist())


def _movers(arrays: dict[str, NDArray[Any]], dt: float) -> Movers:
    """The movers of a task at its start."""
    destinations = Destinations(*(arrays[name] for name in Destinations._fields))
    crowd = destinations if len(arrays["people"]) else None
    movers = Movers.blank(len(arrays["traits"]), arrays["points"], dt, crowd)
    return movers._replace(**{name: arrays[name] for name in _MOVERS})
