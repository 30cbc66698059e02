"""TDAC-EPuck-v0 in one go for many robots."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from tdac_envs.core.arguments import whole_number
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.batching import no_pictures, several
from tdac_envs.drive.vector import DrivenVectorEnv, Observations
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.kernels import step_rows
from tdac_envs.epuck.observed import Observed, ground_readings, noisy, north, position


class EPuckVectorEnv(DrivenVectorEnv):
    """Many `EPuckEnv`, stepped in one compiled call on all cores.

    `gym.make_vec("TDAC-EPuck-v0", num_envs=1024)`. Robot i does, to the last bit, what
    an `EPuckEnv` does with its seed and its actions. Observations, rewards, ends and
    infos are those of Gymnasium's `SyncVectorEnv`. Robots do not meet: each is alone in
    its world. Nothing is pushed, so `on_collision="block"` is for worlds without things
    that have a mass.

    Args:
        num_envs: Number of robots.
        autoreset_mode: `"NextStep"`, `"SameStep"` or `"Disabled"`, or a member of
            `gymnasium.vector.AutoresetMode`.
        threads: How many work at a time. Default: as many as there are cores. Results
            do not depend on it.
        each: Arguments that differ from robot to robot, as `[{"world": "maze"},
            {"world": "yard"}]`; robot i has the entry `i % len(each)`. All robots have
            the same `delay` and the same sensors.
        render_mode: None; pictures are those of an `EPuckEnv`.
        **options: Arguments of `EPuckEnv`, for all robots.

    Raises:
        TaskError: A robot would push things.
    """

    step_rows = staticmethod(step_rows)
    copied = ("pose", "wheel_speeds", "wheel_positions", "ps")

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        each: Sequence[dict[str, Any]] = ({},),
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        no_pictures(render_mode)
        num_envs = whole_number("num_envs", num_envs, 1)
        envs = several(EPuckEnv, each, options, num_envs)
        if any(env.setup.pushes for env in envs):
            raise TaskError(
                "a batch cannot push things; expected on_collision='terminate', a "
                "world without things that have a mass, or vectorization_mode='sync'"
            )
        super().__init__(
            envs,
            num_envs,
            autoreset_mode=autoreset_mode,
            threads=threads,
        )
        self._kinds = [envs[i % len(envs)] for i in range(num_envs)]
        self._factors = np.array([env.sensor_noise for env in self._kinds])
        self._noisy = set(np.flatnonzero(self._factors).tolist())
        self._floors = np.array([env.task.ground.floor for env in self._kinds])
        self._last_ps = self.robots.readings.copy()
        self._last_ground = np.zeros((num_envs, 3), np.float32)

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
        one = self._kinds[0]
        if self._noisy:
            self._add_noise([i for i in robots if i in self._noisy])
            observations["ps"][:] = np.where(
                self._factors[:, None], self._last_ps, observations["ps"]
            )
        if one.ground_sensors:
            for i in robots:
                self._last_ground[i] = self._ground(i)
            observations["ground"] = self._last_ground.copy()
        if one.gps:
            observations["gps"] = position(self.robots, self._floors)
        if one.compass:
            observations["compass"] = north(self.robots)

    def _add_noise(self, robots: Sequence[int]) -> None:
        """Draws the readings of these robots anew; the others keep theirs."""
        spreads = self.robots.hits[robots, :, 2] * self._factors[robots, None]
        normal = np.empty(spreads.shape)
        for i, row in zip(robots, normal, strict=True):
            self._random(i).standard_normal(out=row)
        readings = self.robots.readings[robots]
        self._last_ps[robots] = noisy(readings, spreads, normal)

    def _ground(self, i: int) -> Observed:
        """Readings of one robot's ground sensors."""
        env = self._kinds[i]
        seen, floor = env.setup.around.visible, env.task.ground.floor
        readings, spreads = ground_readings(seen, floor, self.robots.row(i))
        if i not in self._noisy:
            return readings
        normal = self._random(i).standard_normal(readings.size)
        return noisy(readings, env.sensor_noise * spreads, normal)
