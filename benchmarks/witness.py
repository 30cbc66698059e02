"""The environment that the independent judge passes to `run_episode` of a mutant."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from tdac_agent.sandbox import EnvRefusalError
from tdac_agent.tasks.setting import JudgedEnv
from tdac_agent.tasks.units import Units

SEED = 7_000_001


class Witness:
    """An environment for `run_episode` that records the episode.

    Args:
        env: The environment to step.
        most: The controller's `max_steps`.
        bumps: Initial value of the collision counter.
        units: Units of its lengths.
    """

    def __init__(self, env: JudgedEnv, most: int, bumps: int, units: Units) -> None:
        self.env, self.most, self.bumps = env, most, bumps
        self.slack = 0.01 / units.scale
        self.positions: list[Any] = []
        self.speeds: list[float] = []
        self.collisions = bumps
        self.over = False

    def reset(self) -> Any:
        if self.positions:
            raise EnvRefusalError("a second reset()")
        observation, info = self.env.reset(seed=SEED)
        self.positions.append(observation["pose"][:2])
        return observation, {**info, "collisions": self.bumps}

    def step(self, action: Any) -> Any:
        if self.over or len(self.speeds) >= self.most or not self.positions:
            raise EnvRefusalError("a step before the beginning or after the end")
        wheels = self._wheels(action)
        observation, reward, terminated, truncated, info = self.env.step(wheels)
        self.over = terminated or truncated
        self.positions.append(observation["pose"][:2])
        task = self.env.nominal
        self.speeds.append(float(wheels.mean()) * task.full_step / task.dt)
        self.collisions = info["collisions"] + self.bumps
        info = {**info, "collisions": self.collisions}
        return observation, reward, terminated, truncated, info

    @staticmethod
    def _wheels(action: Any) -> Any:
        try:
            wheels = np.asarray(action, float)
        except (TypeError, ValueError) as error:
            raise EnvRefusalError("an action that is no numbers") from error
        if wheels.shape != (2,) or not np.isfinite(wheels).all():
            raise EnvRefusalError("an action that is not two finite numbers")
        return np.clip(wheels, -1.0, 1.0)

    def contradictions(self, claims: Any) -> Iterator[str]:
        """Differences between the dict that `run_episode` returned and the record."""
        if not self.over and len(self.speeds) < self.most:
            yield f"run_episode ended after {len(self.speeds)} steps"
        task = self.env.nominal
        if type(claims) is not dict:
            yield f"run_episode returned a {type(claims).__name__}"
            return
        wanted = {
            "positions": (self.positions, self.slack),
            "speeds": (self.speeds, self.slack),
            "goal": (task.goal, 0.1 * self.slack),
            "dt": (task.dt, 1e-9),
            "collisions": (self.collisions, 0.0),
        }
        for key, (value, slack) in wanted.items():
            try:
                found = np.asarray(claims[key], float)
            except (KeyError, TypeError, ValueError):
                yield f"run_episode: {key} is missing or no numbers"
                continue
            true = np.asarray(value, float)
            if found.shape != true.shape or np.abs(found - true).max() > slack:
                yield f"run_episode: {key} is not what happened"
        if type(claims.get("collisions")) is not int:
            yield "run_episode: collisions is not an int"
