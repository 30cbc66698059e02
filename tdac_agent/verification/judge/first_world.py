"""The first public world of a task set, in which the user's own tests drive."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from tdac_agent.tasks.environment import Environment
from tdac_agent.tasks.registry import environment
from tdac_agent.tasks.setting import JudgedEnv, Nominal
from tdac_agent.tasks.task import progress_steps
from tdac_agent.tasks.task_file import ProgressSpec
from tdac_agent.tasks.units import Units
from tdac_agent.verification.judge.level import FIRST_WORLD, Level
from tdac_agent.verification.judge.set_files import level_params
from tdac_agent.verification.judge.set_worlds import (
    SetEpisodes,
    open_set,
    shown_units,
)
from tdac_agent.verification.judge.worlds import SetWorlds
from tdac_envs.drive.env import Observation
from tdac_envs.ladder.set_file import SetFile


class LevelParams:
    """Contents of `params.json` on a task set, as attributes.

    Args:
        values: The contents.
    """

    def __init__(self, values: dict[str, Any]) -> None:
        self.__dict__.update(values)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(
            f"params.json of a task set has no {name!r}; task.nominal describes the "
            "world in which the tests drive"
        )


@dataclass(frozen=True)
class FirstWorld:
    """What the fixture `task` is on a task set; has the part of `Task` that tests use.

    Attributes:
        level: The set, and the split of the world.
    """

    level: Level

    @cached_property
    def _worlds(self) -> SetEpisodes:
        level = self.level
        return open_set(SetWorlds(set_file=level.set_file, split=level.split))

    @property
    def spec(self) -> SetFile:
        """The set file."""
        return self._worlds.file

    @cached_property
    def params(self) -> LevelParams:
        """Contents of `params.json`."""
        text = json.dumps(level_params(self.spec))
        params: LevelParams = json.loads(text, object_hook=LevelParams)
        return params

    @cached_property
    def nominal(self) -> Nominal:
        """The task in this world."""
        task: Nominal = self._worlds.env.setup.source.task(FIRST_WORLD)
        return task

    @property
    def environment(self) -> Environment:
        """Registry entry of the environment."""
        return environment(self.nominal.env_id)

    @property
    def progress_fraction(self) -> float:
        """As of a task without a progress test of its own."""
        return ProgressSpec().fraction

    @property
    def progress_steps(self) -> int:
        """As of a task without a progress test of its own."""
        return progress_steps(self.nominal.horizon)

    @property
    def told_units(self) -> Units | None:
        """Units of diagnoses, in the frame that a controller observes."""
        return shown_units(self.spec, self._worlds.env.setup.source.task(FIRST_WORLD))

    def make_env(self) -> JudgedEnv:
        """Its environment, the same for all episodes."""
        return self._worlds.env

    def seen(self, observation: Observation) -> Observation:
        """An observation as a controller gets it."""
        return observation
