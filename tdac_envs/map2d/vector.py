"""The vector environment of TDAC-Map2D-v0."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from tdac_envs.core.errors import TaskError
from tdac_envs.drive.gap_search import GapWatch
from tdac_envs.drive.stepping import HEADING, STEPS, row_of
from tdac_envs.drive.vector import Actions, DrivenVectorEnv, Observations, Result
from tdac_envs.grid.map_units import MapFrame, MapUnits
from tdac_envs.map2d.among import step_rows_among
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.map2d.kernels import step_rows
from tdac_envs.map2d.metric_input import options_in_pixels
from tdac_envs.map2d.metric_view import MetricView
from tdac_envs.map2d.observed import infos_of
from tdac_envs.movers.state import Movers


class Map2DVectorEnv(DrivenVectorEnv, VectorEnv[Observations, Actions, Any]):
    """A vector of `Map2DEnv` that steps in one compiled call on all cores.

    Made by `gym.make_vec("TDAC-Map2D-v0", num_envs=1024)`. Robot i behaves bit for bit
    as a `Map2DEnv` does with the same seed and actions. Observations, rewards,
    terminations, truncations and infos are those of Gymnasium's `SyncVectorEnv`.

    Args:
        num_envs: Number of robots.
        autoreset_mode: `"NextStep"`, `"SameStep"`, `"Disabled"`, or a member of
            `gymnasium.vector.AutoresetMode`.
        threads: Number of threads, which does not affect the results. Default: the
            number of cores.
        each: Arguments that differ between robots, such as `[{"map": "maze"},
            {"map": "office"}]`; robot i takes entry `i % len(each)`. All robots need
            the same `n_rays`, `delay`, `odometry` and `frame`; their movers may differ.
        render_mode: `"rgb_array"`, for up to 64 robots, or None.
        max_episode_steps: Steps after which an episode is truncated, if its horizon is
            longer.
        **options: Arguments of `Map2DEnv` for all robots.
    """

    make: Callable[..., Map2DEnv] = Map2DEnv
    copied = ("pose", "wheel_speeds", "ranges")
    infos_of = staticmethod(infos_of)

    def _adopt(self, envs: Sequence[Any], num_envs: int) -> None:
        self._among = any(env.setup.has_movers for env in envs)
        self._movers = [Movers.none() for _ in range(num_envs)]

    def _prepare(self) -> None:
        self._units = MapUnits(self.setups[0].metric)
        self._view = _view_of([setup.metric for setup in self.setups])
        noisy = [setup.has_inexact_ranges for setup in self.setups]
        self._noisy = np.flatnonzero(noisy)
        self._inexact = np.array([_inexact(setup) for setup in self.setups])
        sonar = [setup.sonar is not None for setup in self.setups]
        self._listening = np.flatnonzero(sonar)
        self._receivers = [setup.receiver() for setup in self.setups]
        inexact = [each is not None for each in self._receivers]
        self._receiving = np.flatnonzero(inexact)
        # Last observation: robots that are not reset keep their noise.
        self._ranges = self.robots.ranges.copy()

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Starts episodes, as `DrivenVectorEnv.reset` does."""
        if self._view is None:
            return super().reset(seed=seed, options=options)
        own = options_in_pixels(options or {}, self._units)
        seen, infos = super().reset(seed=seed, options=own)
        return self._view.seen(seen), self._view.info(infos)

    def step(self, actions: Actions) -> Result:
        """Runs one time step, as `DrivenVectorEnv.step` does."""
        view, result = self._view, super().step(actions)
        if view is None:
            return result
        seen, rewards, terminated, truncated, infos = result
        infos = view.info(infos)
        if "final_obs" in infos:
            for i in np.flatnonzero(infos["_final_obs"]).tolist():
                infos["final_obs"][i] = view.seen(infos["final_obs"][i], i)
            infos["final_info"] = view.info(infos["final_info"])
        return view.seen(seen), rewards, terminated, truncated, infos

    @property
    def step_rows(self) -> Callable[..., None]:  # type: ignore[override]
        """The compiled loop over robots."""
        return step_rows_among if self._among else step_rows

    def watch_gap(self, robot: int) -> GapWatch:
        """A watch of a robot's smallest gap in the episode that has just begun.

        Raises:
            ValueError: There are movers, whose motion in a step a batch does not keep.
        """
        if self.setups[robot].has_movers:
            raise ValueError("the gap to movers needs a single environment")
        return super().watch_gap(robot)

    def movers(self, i: int) -> Movers:
        """The movers of robot i in the current step; only to be read."""
        return self._movers[i]

    def _arrays(self, i: int) -> tuple[NDArray[Any], ...]:
        arrays = super()._arrays(i)
        return (*arrays, *self._movers[i]) if self._among else arrays

    def _assign(self, i: int, task: Any) -> None:
        super()._assign(i, task)
        if self._among:
            self._movers[i] = task.fresh_movers()
            self._addresses.put(i, self._arrays(i))
            if self._frames is not None:
                self._frames.show(i, movers=self._movers[i])

    def _seen(self) -> Observations:
        robots = self.robots
        return {
            "pose": robots.pose,
            "goal": self.goals,
            "wheel_speeds": robots.wheel_speeds,
            "ranges": robots.ranges,
        }

    def _complete(self, observations: Observations, robots: Sequence[int]) -> None:
        if self._listening.size:
            for i in np.intersect1d(self._listening, robots).tolist():
                self._listen(i, observations["ranges"])
        if self._noisy.size:
            self._disturb(np.intersect1d(self._noisy, robots))
            observations["ranges"][self._noisy] = self._ranges[self._noisy]
        if self._disturbances.odometry:
            seen = self._disturbances.measure(robots, self.robots, self._noise)
            observations["odometry"] = seen
        if self._receiving.size:
            for i in np.intersect1d(self._receiving, robots).tolist():
                self._receive(i, observations["ranges"][i].copy())
            for i in self._receiving.tolist():
                receiver = self._receivers[i]
                observations["pose"][i] = receiver.pose
                observations["ranges"][i] = receiver.ranges

    def observed_poses(self) -> NDArray[np.float64]:
        """The poses as they are observed, shape (num_envs, 3)."""
        poses = self.pose()
        for i in self._receiving.tolist():
            poses[i] = self._receivers[i].pose
        return poses

    def _receive(self, i: int, ranges: NDArray[np.float32]) -> None:
        """Gives robot i its pose and these ranges, in its own way."""
        state, random = self.robots.state[i], self._noise(i)
        pose = state[: HEADING + 1].copy()
        self._receivers[i].receive(pose, ranges, bool(state[STEPS] == 0.0), random)

    def _disturb(self, robots: NDArray[np.int64]) -> None:
        """Disturbs the ranges of these robots, each as `noisy` does."""
        seen = self.robots.ranges[robots].astype(np.float64)
        spread, dropped, least, blind, most = self._inexact[robots].T[..., None]
        rays = seen.shape[1]
        if spread.any():
            factors = np.ones_like(seen)
            for i, row in zip(robots.tolist(), factors, strict=True):
                size = self.setups[i].range_noise
                if size:
                    row[:] = self._noise(i).normal(1.0, size, rays)
            inexact = np.clip(seen * factors, 0.0, most)
            seen = np.where(spread > 0.0, inexact, seen)
        if least.any():
            seen = np.where(seen < least, blind, seen)
        if dropped.any():
            for i, row in zip(robots.tolist(), seen, strict=True):
                share = self.setups[i].range_dropout
                if share:
                    far = self.setups[i].nominal.robot.range_max
                    row[self._noise(i).random(rays) < share] = far
        self._ranges[robots] = seen

    def _listen(self, i: int, ranges: NDArray[np.float32]) -> None:
        """Replaces the ranges of robot i by those of its sonars."""
        robots, discs = row_of(self.robots, i), self._movers[i].discs()
        terrain = self.tasks[i].terrain
        self.setups[i].sonar.read(terrain, robots.state, discs, robots.ranges)
        ranges[i] = robots.ranges


def _inexact(setup: Any) -> tuple[float, ...]:
    """Noise, dropouts, smallest range, what is read below it, and largest range."""
    return (
        *(setup.range_noise, setup.range_dropout, setup.range_min, setup.blind),
        setup.nominal.robot.range_max,
    )


def _view_of(frames: Sequence[MapFrame | None]) -> MetricView | None:
    """What the robots observe in metres; None for pixels.

    Raises:
        TaskError: Some have metres, and others pixels.
    """
    metric = [frame for frame in frames if frame is not None]
    if not metric:
        return None
    if len(metric) < len(frames):
        raise TaskError("all robots of a batch need the same frame: pixels or metres")
    return MetricView(metric)
