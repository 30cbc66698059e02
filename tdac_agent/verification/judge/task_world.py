"""The episodes of a task: the environment draws start and noise by their seeds."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tdac_agent.episodes.episode import Driver, Record
from tdac_agent.sandbox import Child
from tdac_agent.tasks.setting import JudgedEnv, Nominal
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.measures import (
    least_steps,
    shortest_path_length,
)
from tdac_agent.verification.judge.worlds import FOREVER, Program, TaskWorld
from tdac_envs.drive.env import Observation


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
        env = self.task.disturbed_env(own.disturbance, own.variation, own.physics)
        return Record(env, None, most, seed=number)

    def name(self, number: int) -> str:
        """See `Worlds`."""
        return f"seed {number}"

    def supply(self, child: Child, number: int, program: Program) -> None:  # noqa: ARG002
        """See `Worlds`."""
        if not self.worlds.on_level:
            child.copy_files(self.worlds.task, *program)
            return
        # Only for controllers of task sets, which need much that a task does not.
        from tdac_agent.verification.judge.set_files import write_as_level

        with tempfile.TemporaryDirectory() as name:
            write_as_level(Path(name), self.task)
            child.copy_files(Path(name), *program)

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
