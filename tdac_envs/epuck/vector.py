"""The vector environment of TDAC-EPuck-v0."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv

from tdac_envs.core.errors import TaskError
from tdac_envs.drive.stepping import row_of
from tdac_envs.drive.vector import Actions, DrivenVectorEnv, Observations
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.kernels import step_rows
from tdac_envs.epuck.observed import (
    Observed,
    add_instruments,
    ground_readings,
    noisy,
)


class EPuckVectorEnv(DrivenVectorEnv, VectorEnv[Observations, Actions, Any]):
    """A vector of `EPuckEnv` that steps in one compiled call on all cores.

    Made by `gym.make_vec("TDAC-EPuck-v0", num_envs=1024)`. Robot i behaves bit for bit
    as an `EPuckEnv` does with the same seed and actions. Observations, rewards,
    terminations, truncations and infos are those of Gymnasium's `SyncVectorEnv`. Each
    robot is alone in its world. Robots cannot push objects, so `on_collision="block"`
    requires a world in which no object has a mass.

    Args:
        num_envs: Number of robots.
        autoreset_mode: `"NextStep"`, `"SameStep"`, `"Disabled"`, or a member of
            `gymnasium.vector.AutoresetMode`.
        threads: Number of threads, which does not affect the results. Default: the
            number of cores.
        each: Arguments that differ between robots, such as `[{"world": "maze"},
            {"world": "yard"}]`; robot i takes entry `i % len(each)`. All robots need
            the same `delay` and the same sensors.
        render_mode: `"rgb_array"`, for up to 64 robots, or None.
        max_episode_steps: Steps after which an episode is truncated, if its horizon is
            longer.
        **options: Arguments of `EPuckEnv` for all robots.

    Raises:
        TaskError: A robot would be able to push objects.
    """

    make: Callable[..., EPuckEnv] = EPuckEnv
    step_rows = staticmethod(step_rows)
    copied = ("pose", "wheel_speeds", "wheel_positions", "ps")

    def _adopt(self, envs: Sequence[Any], num_envs: int) -> None:
        if any(env.setup.pushes for env in envs):
            raise TaskError(
                "a batch cannot push objects; expected on_collision='terminate', a "
                "world without objects that have a mass, or vectorization_mode='sync'"
            )
        self._envs = [envs[i % len(envs)] for i in range(num_envs)]

    def _prepare(self) -> None:
        self._factors = np.array([env.sensor_noise for env in self._envs])
        self._noisy = set(np.flatnonzero(self._factors).tolist())
        self._floors = np.array([env.task.ground.floor for env in self._envs])
        self._last_ps = self.robots.readings.copy()
        self._last_ground = np.zeros((self.num_envs, 3), np.float32)

    def _seen(self) -> Observations:
        robots = self.robots
        return {
            "pose": robots.pose,
            "goal": self.goals,
            "wheel_speeds": robots.wheel_speeds,
            "ps": robots.readings,
            "wheel_positions": robots.turned,
        }

    def _complete(self, observations: Observations, robots: Sequence[int]) -> None:
        one = self._envs[0]
        if self._noisy:
            self._add_noise([i for i in robots if i in self._noisy])
            observations["ps"][:] = np.where(
                self._factors[:, None], self._last_ps, observations["ps"]
            )
        if "ground" in one.further:
            for i in robots:
                self._last_ground[i] = self._ground(i)
            observations["ground"] = self._last_ground.copy()
        add_instruments(observations, one.further, self.robots, self._floors)
        if self._disturbances.odometry:
            seen = self._disturbances.measure(robots, self.robots, self._noise)
            observations["odometry"] = seen

    def _assign(self, i: int, task: Any) -> None:
        if task.ground is not self.tasks[i].ground:
            self.setups[i].enter(self.robots.constants[i], task)
            self._floors[i] = task.ground.floor
        super()._assign(i, task)

    def _add_noise(self, robots: Sequence[int]) -> None:
        """Draws new noise for these robots; the others keep their last readings."""
        spreads = self.robots.hits[robots, :, 2] * self._factors[robots, None]
        normal = np.empty(spreads.shape)
        for i, row in zip(robots, normal, strict=True):
            self._noise(i).standard_normal(out=row)
        readings = self.robots.readings[robots]
        self._last_ps[robots] = noisy(readings, spreads, normal)

    def _ground(self, i: int) -> Observed:
        """Readings of one robot's ground sensors."""
        env = self._envs[i]
        seen, floor = env.setup.around(self.tasks[i]).visible, self._floors[i]
        readings, spreads = ground_readings(seen, floor, row_of(self.robots, i))
        if i not in self._noisy:
            return readings
        normal = self._noise(i).standard_normal(readings.size)
        return noisy(readings, env.sensor_noise * spreads, normal)
