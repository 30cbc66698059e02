"""Task sets: world i of a split, the same for everybody."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TypeVar, get_args

import numpy as np

from tdac_envs.core.arguments import whole_number
from tdac_envs.core.dynamics import code_sha256
from tdac_envs.core.errors import TaskError, hint
from tdac_envs.core.hashing import sha256_of
from tdac_envs.core.intake import printable
from tdac_envs.core.salt import LEAST_SALT, MOST_SALT
from tdac_envs.drive.task import AT_START
from tdac_envs.epuck.ground import Ground
from tdac_envs.epuck.task import EPuckTask, make_task
from tdac_envs.ladder.difficulty import Difficulty
from tdac_envs.ladder.files.file_world import FileWorld
from tdac_envs.ladder.files.opened import FileWorlds, opened
from tdac_envs.ladder.files.placed import placed_world
from tdac_envs.ladder.frozen import ON_MAPS_OF_SETS, ON_PLATES
from tdac_envs.ladder.moving import draw_movers
from tdac_envs.ladder.orca_driver import drive_by_orca
from tdac_envs.ladder.plate_worlds import PlatesWorld, make_plates
from tdac_envs.ladder.random_stream import world_key
from tdac_envs.ladder.robots import EPuckRobotParams
from tdac_envs.ladder.set_file import SetFile, Split, find_set_file
from tdac_envs.ladder.space_time import earliest_arrival
from tdac_envs.ladder.worlds import LadderWorld, WorldSpec, make_world
from tdac_envs.map2d.task import Map2DTask

SPLITS = get_args(Split)
"""`train`; `dev` for feedback and selection; `test` is public; `hidden` ranks."""
AnyWorld = LadderWorld | PlatesWorld
"""A world of maps, or of plates for the e-puck."""
AnyTask = Map2DTask | EPuckTask
TaskType = TypeVar("TaskType", Map2DTask, EPuckTask, AnyTask)
_PUBLIC_SALT = b"tdac ladder, public worlds, 2026"


@dataclass(frozen=True, eq=False)
class TaskSet:
    """A distribution of worlds, a robot, and what it observes.

    Attributes:
        file: Contents of its `set.yaml`.
        files: Its worlds, if they come from files; None if they are generated.
    """

    file: SetFile
    files: FileWorlds | None = None

    @property
    def name(self) -> str:
        """Name of the set."""
        return self.file.name

    @cached_property
    def sha256(self) -> str:
        """Hash of all values that define the set; worlds follow from it."""
        return self.file.sha256(self.files.sha256 if self.files else None)

    @cached_property
    def dynamics(self) -> str:
        """Hash of all that decides what happens in an episode, code included.

        It covers the values of the set, the sizes of an e-puck, and the source of what
        makes worlds, drives and observes.
        """
        robot, facts = self.file.robot, {"set": self.sha256}
        if isinstance(robot, EPuckRobotParams):
            sizes = json.dumps(robot.sizes, sort_keys=True)
            facts |= {"robot": sizes, "code": code_sha256(*ON_PLATES)}
        else:
            facts |= {"code": code_sha256(*ON_MAPS_OF_SETS)}
        return sha256_of(json.dumps(facts, sort_keys=True))

    @property
    def largest_side(self) -> float:
        """Largest width or height of a world, px or m."""
        return (self.files or self.file).largest_side

    def count(self, split: str) -> int | None:
        """Number of worlds of a split; None if there is no limit.

        A set of files may have several runs on each world; all of them count.
        """
        return None if self.files is None else self.files.counts.get(split, 0)

    def different(self, split: str) -> int | None:
        """Number of different worlds of a split; None if there is no limit."""
        count = self.count(split)
        return (
            count if self.files is None or count is None else count // self.files.runs
        )

    def runs(self, split: str, worlds: int) -> int:
        """How often each different world is among the first `worlds` of a split.

        Raises:
            TaskError: Some of them are driven more often than others.
        """
        if self.files is None or self.files.runs == 1:
            return 1
        different = self.different(split)
        assert different is not None
        if worlds > different and worlds % different:
            raise TaskError(
                f"worlds {worlds}: set {self.name!r} has {different} different ones "
                f"with {self.files.runs} runs each; expected a multiple of {different}"
            )
        return max(worlds // different, 1)

    def kind(self, split: str, index: int) -> str:
        """What results of a world are grouped by: its generator, or kind of map.

        Raises:
            TaskError: There is no such world.
        """
        if self.files is None:
            return self.file.spec(index).generator.name
        return self._found(split, index).kind

    def label(self, split: str, index: int) -> str:
        """What a world is called: its generator, or kind and name of its map.

        Raises:
            TaskError: There is no such world.
        """
        if self.files is None:
            return self.kind(split, index)
        found = self._found(split, index)
        return f"{found.kind} {printable(found.name)}"

    def check_count(self, split: str, worlds: int, argument: str) -> None:
        """Checks that a split has so many worlds.

        Args:
            split: The split.
            worlds: How many are asked for.
            argument: Name of the argument or flag that asks for them.

        Raises:
            TaskError: It has fewer, or the set has no such split.
        """
        if self.files is None:
            return
        self._check_file_split(split)
        count = self.files.counts[split]
        if worlds > count:
            others = {k: n for k, n in self.files.counts.items() if n and k != split}
            way_out = ", ".join(f"{n} in {k!r}" for k, n in others.items())
            raise TaskError(
                f"{argument} {worlds}: set {self.name!r} has {count} worlds in its "
                f"split {split!r}{f'; there are {way_out}' if way_out else ''}"
            )

    def world(self, split: str, index: int, salt: bytes | None = None) -> AnyWorld:
        """World `index` of a split: obstacles, start, goal, difficulty.

        Args:
            split: One of `SPLITS`.
            index: Number of the world, from 0.
            salt: Salt of the split `hidden`; the others have a public one.

        Raises:
            TaskError: The split is unknown or lacks its salt, or there is no feasible
                world.
        """
        index = whole_number("index", index, 0)
        if self.files is not None:
            self.key(split, index, "world", salt)  # checks the split
            file = self.file
            sizes = file.robot.radius, file.full_step, file.goal_tolerance
            return placed_world(self._found(split, index), *sizes, file.dt)
        spec, key = self.file.spec(index), self.key(split, index, "world", salt)
        try:
            if isinstance(spec, WorldSpec):
                return make_world(spec, key)
            return make_plates(spec, key)
        except TaskError as error:
            raise TaskError(f"set {self.name!r}, world {index}: {error}") from None

    def task(self, split: str, index: int, salt: bytes | None = None) -> AnyTask:
        """The task of a world, as TDAC-Map2D-v0 or TDAC-EPuck-v0 drives it.

        Raises:
            TaskError: As `world` does.
        """
        return self.world_and_task(split, index, salt)[1]

    def world_and_task(
        self, split: str, index: int, salt: bytes | None = None
    ) -> tuple[AnyWorld, AnyTask]:
        """A world, and its task with the movers.

        Raises:
            TaskError: As `world` does.
        """
        world = self.world(split, index, salt)
        return world, self._with_movers(self.task_of(world), split, index, salt)

    def with_facts(
        self, task: TaskType, split: str, index: int, difficulty: Difficulty
    ) -> TaskType:
        """The task of a world with what `info` says about it; see `AT_START`.

        For the splits `train` and `dev` alone: the others are to be unknown.
        """
        values = index, self.kind(split, index), asdict(difficulty)
        return replace(task, world_facts=dict(zip(AT_START, values, strict=True)))

    def _with_movers(
        self, task: TaskType, split: str, index: int, salt: bytes | None = None
    ) -> TaskType:
        """The task of a world with its movers, if the set has any."""
        if not self.file.movers or not isinstance(task, Map2DTask):
            return task
        own, key = self.file.movers, self.key(split, index, "movers", salt)
        crowd = any(group.kind == "crowd" for group in own)

        def arrives(among: Map2DTask) -> bool:
            if not crowd:
                return earliest_arrival(among) is not None
            noise = self.noise(split, index, salt)
            return drive_by_orca(among, self.file.errors, noise) is not None

        return replace(task, movers=draw_movers(own, task, key, arrives))

    def task_of(self, world: AnyWorld) -> AnyTask:
        """The task of a world of this set, without its movers."""
        file, start = self.file, world.start
        horizon = file.horizon.steps(world.difficulty.steps)
        if isinstance(world, PlatesWorld):
            return make_task(
                Ground.of(world.world),
                start,
                world.goal,
                max_wheel_speed=file.robot.max_wheel_speed,
                dt=file.dt,
                goal_tolerance=file.goal_tolerance,
                horizon=horizon,
            )
        assert not isinstance(file.robot, EPuckRobotParams)
        shortest = float(world.field[round(start.y), round(start.x)])
        return Map2DTask(
            terrain=world.terrain,
            start=start,
            goal=world.goal,
            robot=file.robot,
            goal_tolerance=file.goal_tolerance,
            dt=file.dt,
            horizon=horizon,
            field=world.field,
            shortest=shortest,
        )

    def key(
        self, split: str, index: int, purpose: str, salt: bytes | None = None
    ) -> bytes:
        """Key of the random numbers of one purpose of a world.

        Raises:
            TaskError: The split is unknown, or its salt is missing, too short, or not
                needed.
        """
        if split not in SPLITS:
            raise TaskError(
                f"unknown split {split!r}; expected one of {', '.join(SPLITS)}"
                f"{hint(str(split), SPLITS)}"
            )
        if self.files is not None:
            self._check_file_split(split)
        if split != "hidden" and salt is not None:
            raise TaskError(f"split {split!r} has a public salt; leave out the salt")
        if split == "hidden" and self.file.worlds_of:
            raise TaskError(f"set {self.name!r} has the public worlds of another set")
        if self.files is not None and salt is not None:
            raise TaskError(
                f"set {self.name!r} has worlds from files; leave out the salt"
            )
        if self.files is None and split == "hidden" and salt is None:
            raise TaskError(
                "split 'hidden' needs a salt: give a file of 16 random bytes or more "
                "(--salt-file FILE, or salt_file=)"
            )
        if salt is not None and not LEAST_SALT <= len(salt) <= MOST_SALT:
            raise TaskError(
                f"the salt has {len(salt)} bytes; expected {LEAST_SALT} to {MOST_SALT}"
            )
        if self.files is not None and split == "hidden":
            salt = bytes.fromhex(self.files.hidden_sha256 or "")
        own = self.file.worlds_of or self.sha256
        return world_key(salt or _PUBLIC_SALT, own, split, index, purpose)

    def _check_file_split(self, split: str) -> None:
        assert self.files is not None
        if split == "hidden" and "hidden" not in self.files.splits:
            raise TaskError(
                f"set {self.name!r} has no split 'hidden': its worlds are files, which "
                "an author of a controller may have seen; give a folder of other maps "
                "(--hidden-folder DIR, or hidden_folder=)"
            )
        if split not in self.files.splits:
            own = ", ".join(self.files.splits)
            raise TaskError(
                f"set {self.name!r} has the split {own}, not {split!r}: give one of "
                f"them (--split, or split={next(iter(self.files.splits))!r})"
            )

    def _found(self, split: str, index: int) -> FileWorld:
        """World `index` of a split, from its file."""
        assert self.files is not None
        self._check_file_split(split)
        count = self.files.counts[split]
        if not count:
            raise TaskError(
                f"set {self.name!r} has no worlds in its split {split!r}: maps that "
                "are equal or of one origin go to a split together, and a small "
                "folder may leave a split empty; name fewer `splits`, or add maps"
            )
        if not 0 <= index < count:
            raise TaskError(
                f"world {index}: set {self.name!r} has {count} worlds in its split "
                f"{split!r}, numbered from 0"
            )
        return self.files.of(split, index)

    def noise(
        self, split: str, index: int, salt: bytes | None = None
    ) -> np.random.Generator:
        """Random numbers of the disturbances of a world's episode."""
        key = int.from_bytes(self.key(split, index, "noise", salt)[:16], "little")
        return np.random.Generator(np.random.Philox(key=key))


def load_set(name: str | Path, hidden_folder: Path | None = None) -> TaskSet:
    """A task set by its name (`tdac sets` lists them), or from a `set.yaml`.

    Args:
        name: Its name, or path.
        hidden_folder: Folder of maps with the split `hidden` of a set of files.

    Raises:
        TaskError: The set does not exist or is invalid.
    """
    file = find_set_file(name)
    if file.files is None:
        if hidden_folder is not None:
            raise TaskError(
                f"set {file.name!r} generates its worlds: its split 'hidden' needs a "
                "salt file, not a hidden folder"
            )
        return TaskSet(file)
    sizes = file.robot.radius, file.goal_tolerance
    try:
        files = opened(file.files, *sizes)
        if hidden_folder is not None:
            files = files.with_hidden(hidden_folder, file.files, *sizes)
    except TaskError as error:
        raise TaskError(f"set {file.name!r}: {error}") from None
    return TaskSet(file, files)
