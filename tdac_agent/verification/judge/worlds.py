"""Where the episodes of a job take place: a task's world, or worlds of a task set."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict

from tdac_agent.episodes.episode import Driver, Record
from tdac_agent.sandbox import Child
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.setting import JudgedEnv, Nominal
from tdac_agent.tasks.start_frame import StartFrame
from tdac_agent.tasks.task import Task, read_task
from tdac_agent.tasks.units import UNITS, Units
from tdac_agent.verification.diagnosis.measures import (
    least_steps,
    shortest_path_length,
)
from tdac_agent.verification.judge.cpu_budget import Budgeted
from tdac_agent.verification.judge.episode_row import EpisodeRow, plan_facts
from tdac_agent.verification.judge.set_files import write_as_level, write_files
from tdac_envs.drive.env import Observation
from tdac_envs.ladder.env import TaskSetEnv, make
from tdac_envs.ladder.orca_driver import OrcaDrive, drive_by_orca
from tdac_envs.ladder.set_file import SetFile
from tdac_envs.ladder.source import read_salt
from tdac_envs.ladder.space_time import earliest_arrival
from tdac_envs.ladder.task_sets import AnyTask, TaskSet
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.movers.state import SPEED

FOREVER = 1 << 62
PUBLIC = ("dev", "test", "train")


class Worlds(Protocol):
    """Makes episodes by number: a seed of a task, or the index of a world."""

    @property
    def units(self) -> Units:
        """Units of the environment."""

    def record(self, number: int, most: int = FOREVER) -> Record:
        """An empty record for an episode of at most `most` steps."""

    def name(self, number: int) -> str:
        """Name of an episode in texts."""

    def supply(self, child: Child, number: int, source: bytes) -> None:
        """Gives a child the controller and the files that it may read.

        Raises:
            ControllerFault: The controller is too large.
        """

    def seen(self, observation: Observation) -> Observation:
        """An observation as a controller gets it."""

    def load(self, child: Child) -> Driver:
        """Imports the controller in a child.

        Raises:
            ControllerFault: It cannot be imported.
        """

    def facts(self, env: JudgedEnv, number: int) -> dict[str, Any]:
        """What a row says of an episode before it is driven; see `driven_row`."""

    def diagnosed(self, env: JudgedEnv) -> tuple[Nominal, Units | None]:
        """The task of the last episode, and the units of its diagnosis."""


class TaskWorld(BaseModel):
    """The world of a task, whose folder has been laid out.

    Attributes:
        task: Its folder.
        disturbance: Disturbance of the environment.
        variation: Variation of start and goal.
        on_level: Whether controllers read the files of a task set.
    """

    model_config = ConfigDict(extra="forbid")

    kind: Literal["task"] = "task"
    task: Path
    disturbance: Disturbance
    variation: str = "jitter"
    on_level: bool = False

    def opened(self) -> TaskEpisodes:
        """Reads the task."""
        return TaskEpisodes(read_task(self.task), self)


class SetWorlds(BaseModel):
    """Worlds of a split of a task set.

    Attributes:
        set_file: Its set file.
        split: The split.
        salt_file: File with the salt of hidden worlds.
        hidden_folder: Folder of hidden worlds that are files.
    """

    model_config = ConfigDict(extra="forbid")

    kind: Literal["set"] = "set"
    set_file: Path
    split: str
    salt_file: Path | None = None
    hidden_folder: Path | None = None

    def opened(self) -> SetEpisodes:
        """Opens the environment, with complete infos for the judge."""
        folder = (
            {} if self.hidden_folder is None else {"hidden_folder": self.hidden_folder}
        )
        env = make(
            self.set_file,
            split=self.split,
            train_pool=0,
            salt_file=self.salt_file,
            privileged=True,
            **folder,
        )
        return SetEpisodes(env, self)


def public_split(tasks: TaskSet) -> str | None:
    """A split whose worlds may be told of; None if a set has none."""
    return next((name for name in PUBLIC if tasks.count(name) != 0), None)


@dataclass(frozen=True, slots=True)
class TaskEpisodes:
    """See `Worlds`. The environment draws start and noise of an episode by its seed."""

    task: Task
    worlds: TaskWorld

    @property
    def units(self) -> Units:
        """See `Worlds`."""
        return self.task.setting.units

    def record(self, number: int, most: int = FOREVER) -> Record:
        """See `Worlds`."""
        own = self.worlds
        env = self.task.disturbed_env(own.disturbance, own.variation)
        return Record(env, None, most, seed=number)

    def name(self, number: int) -> str:
        """See `Worlds`."""
        return f"seed {number}"

    def supply(self, child: Child, number: int, source: bytes) -> None:  # noqa: ARG002
        """See `Worlds`."""
        if not self.worlds.on_level:
            child.copy_files(self.worlds.task, source)
            return
        with tempfile.TemporaryDirectory() as name:
            write_as_level(Path(name), self.task)
            child.copy_files(Path(name), source)

    def seen(self, observation: Observation) -> Observation:
        """See `Worlds`."""
        return self.task.setting.seen(observation)

    def load(self, child: Child) -> Driver:
        """See `Worlds`."""
        child.load()
        return child

    def facts(self, env: JudgedEnv, number: int) -> dict[str, Any]:
        """See `Worlds`."""
        task = env.task
        length = shortest_path_length(task)
        return {
            "seed": number,
            "length": length,
            "least_steps": least_steps(task, length),
            "barn_steps": length / task.full_step,
        }

    def diagnosed(self, env: JudgedEnv) -> tuple[Nominal, Units | None]:
        """See `Worlds`."""
        return env.task, None


@dataclass(frozen=True)
class SetEpisodes:
    """See `Worlds`. Everything in an episode follows from its world."""

    env: TaskSetEnv
    worlds: SetWorlds

    @property
    def tasks(self) -> TaskSet:
        """The task set."""
        return self.env.set

    @property
    def file(self) -> SetFile:
        """Its set file."""
        return self.env.set.file

    @property
    def units(self) -> Units:
        """See `Worlds`."""
        return UNITS[self.file.unit]

    @cached_property
    def salt(self) -> bytes | None:
        """The salt of hidden worlds."""
        file = self.worlds.salt_file
        return None if file is None else read_salt(file)

    def record(self, number: int, most: int = FOREVER) -> Record:
        """See `Worlds`."""
        return Record(self.env, None, most, options={"index": number})

    def name(self, number: int) -> str:
        """See `Worlds`."""
        return f"world {number}"

    def supply(self, child: Child, number: int, source: bytes) -> None:
        """See `Worlds`. Neither split nor number are told."""
        # The judge's own copy of the task, so that the files can be written before.
        task = self.env.setup.source.task(number)
        with tempfile.TemporaryDirectory() as name:
            write_files(Path(name), self.file, task)
            child.copy_files(Path(name), source)

    def seen(self, observation: Observation) -> Observation:
        """See `Worlds`."""
        return observation

    def load(self, child: Child) -> Driver:
        """See `Worlds`. Its CPU time is limited."""
        driver = Budgeted(child, self.file.cpu)
        driver.load()
        return driver

    def facts(self, env: JudgedEnv, number: int) -> dict[str, Any]:
        """See `Worlds`."""
        del env
        return self._facts(number)

    def diagnosed(self, env: JudgedEnv) -> tuple[Nominal, Units | None]:
        """See `Worlds`."""
        return env.task, shown_units(self.file, self.env.task)

    def planned(self, number: int) -> EpisodeRow:
        """What a planner reaches that knows the world and its movers in advance.

        Among discs that bounce, it is the earliest arrival on a lattice in space and
        time, with turns that take no time; among people, a driver by ORCA.
        """
        began, facts = time.process_time(), self._facts(number)
        task = self.env.setup.source.task(number)
        assert isinstance(task, Map2DTask)
        found = self._plan(task, number)
        reached = found is not None
        steps = found.steps if found else task.horizon
        return EpisodeRow(
            **plan_facts(reached, steps, found.driven if found else 0.0, facts),
            outcome="reached" if reached else "out of time",
            horizon=task.horizon,
            d_min=0.0 if reached else facts["length"],
            cpu_seconds=round(time.process_time() - began, 3),
        )

    def _plan(self, task: Map2DTask, number: int) -> OrcaDrive | None:
        """Steps and length of the planner's drive; None if it does not arrive."""
        if any(group.kind == "crowd" for group in self.file.movers):
            noise = self.tasks.noise(self.worlds.split, number, self.salt)
            return drive_by_orca(task, self.file.errors, noise)
        arrival = earliest_arrival(task)
        if arrival is None:
            return None
        legs = np.hypot(*np.diff(arrival.path[:, 1:], axis=0).T)
        return OrcaDrive(arrival.steps, float(legs.sum()))

    def _facts(self, number: int) -> dict[str, Any]:
        source = self.env.setup.source
        world, task = source.world(number), source.task(number)
        hard = world.difficulty
        return {
            "index": number,
            "generator": self.tasks.kind(self.worlds.split, number),
            "length": hard.length,
            "least_steps": hard.steps,
            "barn_steps": world.barn_steps or hard.length / self.file.full_step,
            "gap": hard.gap,
            "detour": hard.detour,
            "in_sight": hard.in_sight,
            "density": hard.density,
            **movers_of(task),
        }


def movers_of(task: AnyTask) -> dict[str, Any]:
    """`movers` and `mover_speed` of a world; empty without movers."""
    movers = task.movers if isinstance(task, Map2DTask) else None
    if movers is None or not len(movers.traits):
        return {}
    speed = float(movers.traits[:, SPEED].mean()) * task.dt / task.full_step
    return {"movers": len(movers.traits), "mover_speed": round(speed, 4)}


def shown_units(file: SetFile, task: AnyTask) -> Units:
    """Units of diagnoses, in the frame that the policy observes.

    Args:
        file: The task set.
        task: The task of a world.
    """
    units = UNITS[file.unit]
    if file.frame == "map":
        return units
    return units.from_start(StartFrame.of(task.start, units))
