"""TDAC-Map2D-v0 in one go for many robots."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from tdac_envs.core.arguments import whole_number
from tdac_envs.drive.batching import no_pictures, several
from tdac_envs.drive.vector import DrivenVectorEnv, Observations
from tdac_envs.map2d.env import Map2DEnv, noisy
from tdac_envs.map2d.kernels import step_rows


class Map2DVectorEnv(DrivenVectorEnv):
    """Many `Map2DEnv`, stepped in one compiled call on all cores.

    `gym.make_vec("TDAC-Map2D-v0", num_envs=1024)`. Robot i does, to the last bit, what
    a `Map2DEnv` does with its seed and its actions. Observations, rewards, ends and
    infos are those of Gymnasium's `SyncVectorEnv`.

    Args:
        num_envs: Number of robots.
        autoreset_mode: `"NextStep"`, `"SameStep"` or `"Disabled"`, or a member of
            `gymnasium.vector.AutoresetMode`.
        threads: How many work at a time. Default: as many as there are cores. Results
            do not depend on it.
        each: Arguments that differ from robot to robot, as `[{"map": "maze"},
            {"map": "office"}]`; robot i has the entry `i % len(each)`. All robots have
            the same `n_rays` and `delay`.
        render_mode: None; pictures are those of a `Map2DEnv`.
        **options: Arguments of `Map2DEnv`, for all robots.
    """

    step_rows = staticmethod(step_rows)
    copied = ("pose", "wheel_speeds", "ranges")

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
        super().__init__(
            several(Map2DEnv, each, options, num_envs),
            num_envs,
            autoreset_mode=autoreset_mode,
            threads=threads,
        )
        noises = [setup.range_noise for setup in self.setups]
        self._noisy = np.flatnonzero(noises)
        # As observed last: a robot that is not reset keeps its noise, too.
        self._ranges = self.robots.ranges.copy()

    def _seen(self) -> Observations:
        robots = self.robots
        return {
            "pose": robots.pose,
            "goal": self.goals,
            "wheel_speeds": robots.wheel_speeds,
            "ranges": robots.ranges,
        }

    def _complete(self, observations: Observations, robots: Sequence[int]) -> None:
        if not self._noisy.size:
            return
        for i in np.intersect1d(self._noisy, robots).tolist():
            exact, random = self.robots.ranges[i], self._random(i)
            self._ranges[i] = noisy(exact, self.setups[i], random)
        observations["ranges"][self._noisy] = self._ranges[self._noisy]
