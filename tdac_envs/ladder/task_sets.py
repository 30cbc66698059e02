"""Task sets: world i of a split, the same for everybody."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import get_args

import numpy as np

from tdac_envs.core.arguments import whole_number
from tdac_envs.core.errors import TaskError, hint
from tdac_envs.ladder.set_file import SetFile, Split, find_set_file
from tdac_envs.ladder.words import world_key
from tdac_envs.ladder.worlds import LadderWorld, make_world
from tdac_envs.map2d.task import Map2DTask

SPLITS = get_args(Split)
"""`train`; `dev` for feedback and selection; `test` is public; `hidden` ranks."""
LEAST_SALT = 16
"""Least length of the salt of a hidden split, bytes."""
MOST_SALT = 4096
_PUBLIC_SALT = b"tdac ladder, public worlds, 2026"


@dataclass(frozen=True, eq=False)
class TaskSet:
    """A distribution of worlds, a robot, and what it observes.

    Attributes:
        file: Contents of its `set.yaml`.
    """

    file: SetFile

    @property
    def name(self) -> str:
        """Name of the set."""
        return self.file.name

    @cached_property
    def sha256(self) -> str:
        """Hash of everything that defines the set; worlds follow from it."""
        return self.file.sha256()

    def world(self, split: str, index: int, salt: bytes | None = None) -> LadderWorld:
        """World `index` of a split: map, start, goal, difficulty.

        Args:
            split: One of `SPLITS`.
            index: Number of the world, from 0.
            salt: Salt of the split `hidden`; the others have a public one.

        Raises:
            TaskError: The split is unknown or lacks its salt, or there is no feasible
                world.
        """
        index = whole_number("index", index, 0)
        spec = self.file.spec(index)
        try:
            return make_world(spec, self.key(split, index, "world", salt))
        except TaskError as error:
            raise TaskError(f"set {self.name!r}, world {index}: {error}") from None

    def task(self, split: str, index: int, salt: bytes | None = None) -> Map2DTask:
        """The task of a world, as TDAC-Map2D-v0 drives it.

        Raises:
            TaskError: As `world` does.
        """
        return self.task_of(self.world(split, index, salt))

    def task_of(self, world: LadderWorld) -> Map2DTask:
        """The task of a world of this set."""
        file, start = self.file, world.start
        shortest = float(world.field[round(start.y), round(start.x)])
        return Map2DTask(
            terrain=world.terrain,
            start=start,
            goal=world.goal,
            robot=file.robot,
            goal_tolerance=file.goal_tolerance,
            dt=file.dt,
            horizon=file.horizon.steps(world.difficulty.steps),
            field=world.field,
            shortest=shortest,
        )

    def key(
        self, split: str, index: int, purpose: str, salt: bytes | None = None
    ) -> bytes:
        """Key of the random numbers of one purpose of a world.

        Raises:
            TaskError: The split is unknown, or its salt is missing, short, or not
                asked for.
        """
        if split not in SPLITS:
            raise TaskError(
                f"unknown split {split!r}; expected one of {', '.join(SPLITS)}"
                f"{hint(str(split), SPLITS)}"
            )
        if split != "hidden" and salt is not None:
            raise TaskError(f"split {split!r} has a public salt; leave out the salt")
        if split == "hidden" and salt is None:
            raise TaskError("split 'hidden' needs a salt; give a salt file")
        if salt is not None and not LEAST_SALT <= len(salt) <= MOST_SALT:
            raise TaskError(
                f"expected a salt of {LEAST_SALT} to {MOST_SALT} bytes, got {len(salt)}"
            )
        return world_key(salt or _PUBLIC_SALT, self.sha256, split, index, purpose)

    def noise(
        self, split: str, index: int, salt: bytes | None = None
    ) -> np.random.Generator:
        """Random numbers of the disturbances of a world's episode."""
        key = int.from_bytes(self.key(split, index, "noise", salt)[:16], "little")
        return np.random.Generator(np.random.Philox(key=key))


def load_set(name: str | Path) -> TaskSet:
    """A task set by its name (`tdac sets` lists them), or from a `set.yaml`.

    Raises:
        TaskError: There is none, or it is not valid.
    """
    return TaskSet(find_set_file(name))
