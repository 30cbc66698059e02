"""The episodes of a task set: worlds of a split, and what a planner reaches there."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from tdac_agent.episodes.episode import Driver, Record
from tdac_agent.sandbox import Child
from tdac_agent.tasks.setting import JudgedEnv, Nominal
from tdac_agent.tasks.start_frame import StartFrame
from tdac_agent.tasks.units import UNITS, Units, units_in
from tdac_agent.verification.judge.cpu_budget import Budgeted
from tdac_agent.verification.judge.episode_row import EpisodeRow, plan_facts
from tdac_agent.verification.judge.set_files import write_files
from tdac_agent.verification.judge.worlds import FOREVER, Program, SetWorlds
from tdac_envs.core.salt import read_salt
from tdac_envs.drive.env import Observation
from tdac_envs.ladder.env import TaskSetEnv, make
from tdac_envs.ladder.orca_driver import OrcaDrive, drive_by_orca
from tdac_envs.ladder.set_file import SetFile
from tdac_envs.ladder.space_time import earliest_arrival
from tdac_envs.ladder.task_sets import AnyTask, TaskSet
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.movers.state import SPEED
from tdac_envs.physics.moved import EXACT


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
        return printed_units(self.file)

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

    def supply(self, child: Child, number: int, program: Program) -> None:
        """See `Worlds`. Neither split nor number are told."""
        # The judge's own copy of the task, so that the files can be written before.
        task = self.env.setup.source.task(number)
        with tempfile.TemporaryDirectory() as name:
            write_files(Path(name), self.file, task)
            child.copy_files(Path(name), *program)

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


def open_set(worlds: SetWorlds) -> SetEpisodes:
    """Opens the environment, with complete infos for the judge."""
    given = worlds.hidden_folder
    env = make(
        worlds.set_file,
        split=worlds.split,
        train_pool=0,
        salt_file=worlds.salt_file,
        privileged=True,
        **({} if worlds.physics == EXACT else {"physics": worlds.physics}),
        **({} if given is None else {"hidden_folder": given}),
    )
    return SetEpisodes(env, worlds)


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
    if file.frame == "map":
        return printed_units(file, task)
    units = UNITS[file.unit]
    frame = StartFrame.of(task.start, units)
    return units.from_start(frame.in_metres(file.resolution))


def printed_units(file: SetFile, task: AnyTask | None = None) -> Units:
    """Units of the lengths of a set; with a task of a world, also of places there."""
    if file.resolution is None:
        return UNITS[file.unit]
    height = task.terrain.grid.cells.shape[0] if isinstance(task, Map2DTask) else 1
    return units_in(file.unit, (height, file.resolution, 0.0, 0.0, 0.0))
