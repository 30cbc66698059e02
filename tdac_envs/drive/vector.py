"""Base class of the vector environments, which step a batch of robots on all cores."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from tdac_envs.core.addresses import Addresses, words_of
from tdac_envs.core.arguments import whole_number
from tdac_envs.core.slices import Rows, Slices
from tdac_envs.drawing.canvas import Image
from tdac_envs.drive import stepping
from tdac_envs.drive.batching import (
    Array,
    Flags,
    autoreset_mode_of,
    check_exact,
    ends_of,
    infos_of,
    joint_space,
    make_envs,
    mask_of,
    seeds_of,
    store_actions,
    time_limit_of,
)
from tdac_envs.drive.disturbances import BatchDisturbances
from tdac_envs.drive.frames import frames_of
from tdac_envs.drive.gap_search import GapWatch

Observations = dict[str, NDArray[np.float32]]
Actions = NDArray[np.float32]
Result = tuple[Observations, Array, Flags, Flags, dict[str, Any]]


class DrivenVectorEnv(VectorEnv[Observations, Actions, Any]):
    """Base class of the vector environments: many independent robots.

    Robot i behaves bit for bit as an environment does with the same arguments, seed and
    actions: both call the same compiled functions.

    Args:
        num_envs: Number of robots.
        autoreset_mode: When the next episode begins after one has ended.
        threads: Number of threads; by default the number of cores.
        each: Arguments that differ between robots; see `Map2DVectorEnv`. The arrays of
            all robots have the same shapes.
        render_mode: `"rgb_array"`, for up to 64 robots, or None.
        max_episode_steps: Steps after which an episode is truncated, in addition to
            its horizon, as by Gymnasium's `TimeLimit`; None for no further limit.
        **options: Arguments of all environments.

    Attributes:
        make: Class of the environments.
        step_rows: The compiled loop over robots; see
            `tdac_envs.map2d.kernels.step_rows`.
        copied: Observation keys that this loop fills in.
        infos_of: The infos of a step; see `tdac_envs.drive.batching.infos_of`.
        last_poses: True poses of all robots before the last `SAME_STEP` autoreset,
            shape (num_envs, 3).
        last_observed_poses: The same as they were observed.
    """

    make: Callable[..., Any]
    step_rows: Callable[..., None]
    copied: tuple[str, ...]
    infos_of: Callable[[Array, Flags], dict[str, Any]] = staticmethod(infos_of)

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        each: Sequence[dict[str, Any]] = ({},),
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        **options: Any,
    ) -> None:
        num_envs = whole_number("num_envs", num_envs, 1)
        envs = make_envs(self.make, each, options, num_envs)
        check_exact(envs)
        self._adopt(envs, num_envs)
        self._most_steps = time_limit_of(max_episode_steps)
        self.num_envs = num_envs
        self.autoreset_mode = autoreset_mode_of(autoreset_mode)
        self.threads = None if threads is None else whole_number("threads", threads, 1)
        self._first = first = envs[0]
        self.metadata = {**first.metadata, "render_modes": ["rgb_array"]}
        self.metadata["autoreset_mode"] = self.autoreset_mode
        self.single_action_space = first.action_space
        self.action_space = batch_space(first.action_space, num_envs)
        self.single_observation_space = joint_space(envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.setups: list[Any] = [envs[i % len(envs)].setup for i in range(num_envs)]
        self.tasks = [setup.nominal for setup in self.setups]
        self.robots = type(first.robot)(
            *(np.zeros((num_envs, *each.shape), each.dtype) for each in first.robot)
        )
        for constants, setup in zip(self.robots.constants, self.setups, strict=True):
            constants[:] = setup.constants()
        self.last_poses = self.last_observed_poses = self.pose()
        self.render_mode = render_mode
        self._frames = frames_of(render_mode, envs, self.robots, num_envs)
        self._slices = Slices(self.threads)
        self._all = np.arange(num_envs)
        self._everyone = np.ones(num_envs, np.bool_)
        self._disturbances = BatchDisturbances(self.setups)
        self._randoms: list[np.random.Generator | None] = [None] * num_envs
        self._noises: list[np.random.Generator | None] = [None] * num_envs
        self._seeds: list[int | None] = [None] * num_envs
        self._vary = [setup.varies for setup in self.setups]
        # Whether a robot's task may change from episode to episode.
        self._tasks_change = any(self._vary)
        self._over = np.zeros(num_envs, np.bool_)
        self._never_begun = np.ones(num_envs, np.bool_)
        self._begun = False
        self._commands = np.zeros((num_envs, 2))
        self.goals = np.array([task.goal for task in self.tasks], np.float32)
        self._starts = np.array([(*task.start, task.shortest) for task in self.tasks])
        self._bind()
        self._prepare()

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Starts the episodes of all robots, or of those in `options["reset_mask"]`.

        Args:
            seed: One int, so that robot i gets `seed + i`, or one seed for each robot.
            options: The reset options of a single environment, and `reset_mask`: shape
                (num_envs,), bool.

        Raises:
            ValueError: The number of seeds is wrong, the mask is not one bool for each
                robot, or `options` is not a dict.
            TypeError: The mask is not an array of bools.
            TaskError: An option is unknown, or the start or goal is not feasible.
        """
        if not isinstance(options, Mapping | None):
            raise ValueError(f"expected options to be a dict, got {options!r}")
        rest = dict(options or {})
        mask = self._everyone
        if "reset_mask" in rest:
            mask = mask_of(rest.pop("reset_mask"), self.num_envs)
        for i, one in enumerate(seeds_of(seed, self.num_envs)):
            if one is not None and mask[i]:
                self._randoms[i], self._seeds[i] = seeding.np_random(one)
        self._begin(mask, rest)
        self._never_begun[mask] = False
        self._begun = not self._never_begun.any()
        observations = {key: seen.copy() for key, seen in self._seen().items()}
        self._complete(observations, np.flatnonzero(mask).tolist())
        return observations, self._infos(mask)

    def step(self, actions: Actions) -> Result:
        """Runs one time step with wheel speeds of shape (num_envs, 2).

        Raises:
            ValueError: The actions are not two finite numbers for each robot.
            ResetNeeded: Not all robots have been reset yet, or the autoreset mode is
                `DISABLED` and an episode has ended.
        """
        if not self._begun:
            raise gym.error.ResetNeeded("call reset() of all robots before step()")
        store_actions(actions, self._commands)
        if self.autoreset_mode is AutoresetMode.DISABLED and self._over.any():
            ended = np.flatnonzero(self._over)
            raise gym.error.ResetNeeded(
                f"call reset(options={{'reset_mask': ...}}) for the robots whose "
                f"episodes have ended: {ended[:10].tolist()}"
            )
        if self._disturbances.slippery:
            self._disturbances.slip(self._over, self.robots.state, self._noise)
        if self._tasks_change or self._disturbances.hidden:
            self._draw(np.flatnonzero(self._over), {})
        observations, outcome = self._results()
        self._act(self._all, observations, outcome)
        if self._frames is not None:
            self._frames.begin(np.flatnonzero(self._over).tolist(), self.tasks)
            self._frames.note(np.flatnonzero(~self._over).tolist())
        rewards, terminated, truncated = ends_of(outcome)
        truncated |= self.robots.state[:, stepping.STEPS] >= self._most_steps
        infos = self.infos_of(outcome, self._everyone)
        np.logical_or(terminated, truncated, out=self._over)
        self._complete(observations, range(self.num_envs))
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._over.any():
            infos |= self._restart(observations, infos)
        return observations, rewards, terminated, truncated, infos

    def render(self) -> tuple[Image, ...] | None:
        """A frame of each robot, uint8 (height, width, 3); all fit on 1280 x 1280.

        Raises:
            ResetNeeded: Not all robots have been reset yet.
        """
        if self._frames is None:
            gym.logger.warn("render() needs gym.make_vec(..., render_mode='rgb_array')")
            return None
        if not self._begun:
            raise gym.error.ResetNeeded("call reset() of all robots before render()")
        return self._frames.drawn()

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """What a method or attribute of the batch gives for each robot.

        Libraries call `render` in this way, since `SyncVectorEnv` supports it.
        """
        values = getattr(self, name)
        if callable(values):
            values = values(*args, **kwargs)
        one_each = isinstance(values, tuple | np.ndarray)
        return tuple(values) if one_each else (values,) * self.num_envs

    def close_extras(self, **_: Any) -> None:
        """Stops the threads."""
        # Gymnasium 1.2 also calls this if `__init__` has failed.
        if hasattr(self, "_slices"):
            self._slices.close()

    def pose(self) -> Array:
        """The true poses, shape (num_envs, 3): x, y (px or m), heading (rad)."""
        poses: Array = self.robots.state[:, : stepping.HEADING + 1].copy()
        return poses

    def observed_poses(self) -> Array:
        """The poses as they are observed, shape (num_envs, 3)."""
        return self.pose()

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """Random number generator of each robot."""
        return tuple(self._random(i) for i in range(self.num_envs))

    @property
    def np_random_seed(self) -> tuple[int | None, ...]:  # type: ignore[override]
        """Seed of each robot; drawn if it has none yet."""
        for i in range(self.num_envs):
            self._random(i)
        return tuple(self._seeds)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_slices": None, "_addresses": None, "_shared": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._slices = Slices(self.threads)
        if self._frames is not None:
            self._frames.bind(self.robots)
        self._bind()

    def _adopt(self, envs: Sequence[Any], num_envs: int) -> None:
        """Takes from the environments what a subclass needs before arrays are bound."""

    def _prepare(self) -> None:
        """Prepares what a subclass adds, after all else."""

    def _seen(self) -> Observations:
        """The robots' own observation arrays, without noise."""
        raise NotImplementedError

    def _complete(self, observations: Observations, robots: Sequence[int]) -> None:
        """Adds observations that no kernel computes, and new noise for these robots."""
        raise NotImplementedError

    def watch_gap(self, robot: int) -> GapWatch:
        """A watch of a robot's smallest gap in the episode that has just begun."""
        kept = self.setups[robot].gap_in_episode(self.tasks[robot])
        words = self._addresses.words[robot]
        watch: GapWatch = self._first.watch_gap(words, kept)
        return watch

    def _bind(self) -> None:
        """Collects the addresses of all arrays that the kernels read and write."""
        self._addresses = Addresses(map(self._arrays, range(self.num_envs)))
        words = self._addresses.words
        self._scratch = self._results()
        shared = self._over, self._commands, self._starts, words
        self._shared = Addresses([shared])

    def _results(self) -> tuple[Observations, Array]:
        """New arrays for the result of a step; fills in keys that no step changes."""
        seen = self._seen()
        results = {key: np.empty_like(array) for key, array in seen.items()}
        for key in seen.keys() - set(self.copied):
            results[key][:] = seen[key]
        return results, np.empty_like(self.robots.outcome)

    def _act(self, rows: Rows, observations: Observations, outcome: Array) -> None:
        """Steps some robots, or begins the next episodes of those that are over.

        Args:
            rows: Indices of the robots, which are divided among the threads.
            observations: Their rows are overwritten, without noise.
            outcome: Their rows are overwritten with the outcomes of the steps.
        """
        out = words_of((outcome, *(observations[key] for key in self.copied)))
        batch = np.concatenate([self._shared.words[0], out])
        self._slices.run(partial(self.step_rows, batch), rows)

    def _arrays(self, i: int) -> tuple[NDArray[Any], ...]:
        """The arrays of a robot and its world that the kernels take."""
        return *self.setups[i].world(self.tasks[i]), *stepping.row_of(self.robots, i)

    def _begin(self, mask: Flags, options: dict[str, Any]) -> None:
        chosen = np.flatnonzero(mask)
        if options or self._tasks_change or self._disturbances.hidden:
            self._draw(chosen, options)
        self._over[chosen] = True
        self._act(chosen, *self._scratch)
        self._over[chosen] = False
        if self._frames is not None:
            self._frames.begin(chosen.tolist(), self.tasks)

    def _draw(self, robots: Rows, options: dict[str, Any]) -> None:
        """Draws the next tasks of some robots, then their hidden errors."""
        drawn = [
            (i, *self.setups[i].draw(options, self._random(i)))
            for i in robots.tolist()
            if options or self._vary[i] or self.tasks[i] is not self.setups[i].nominal
        ]
        for i, task, noise in drawn:
            self._assign(i, task)
            self._noises[i] = None if noise is self._randoms[i] else noise
        if self._disturbances.hidden:
            constants, chosen = self.robots.constants, robots.tolist()
            self._disturbances.hide(chosen, self.tasks, constants, self._noise)

    def _assign(self, i: int, task: Any) -> None:
        self._tasks_change = True
        before = self.tasks[i]
        self.tasks[i], self._starts[i] = task, (*task.start, task.shortest)
        self.goals[i] = task.goal
        if task.field is not before.field:
            self._addresses.put(i, self.setups[i].world(task))
        stepping.place(self.robots, task, i)

    def _random(self, i: int) -> np.random.Generator:
        random = self._randoms[i]
        if random is None:
            random, self._seeds[i] = seeding.np_random()
            self._randoms[i] = random
        return random

    def _noise(self, i: int) -> np.random.Generator:
        """Random numbers of the disturbances of robot i."""
        return self._noises[i] or self._random(i)

    def _restart(
        self, observations: Observations, infos: dict[str, Any]
    ) -> dict[str, Any]:
        """Resets the robots whose episodes have ended; returns the `final_*` infos.

        Overwrites the observations and infos of these robots.
        """
        ended = self._over.copy()
        over = np.flatnonzero(ended)
        final = np.full(self.num_envs, None, object)
        for i in over.tolist():
            final[i] = {key: value[i].copy() for key, value in observations.items()}
        last = self._infos(ended)
        self.last_poses, self.last_observed_poses = self.pose(), self.observed_poses()
        self._begin(ended, {})
        for key, seen in self._seen().items():
            observations[key][over] = seen[over]
        for key, values in self._infos(ended).items():
            infos[key][over] = values[over]
        self._complete(observations, over.tolist())
        return {
            "final_obs": final,
            "_final_obs": ended,
            "final_info": last,
            "_final_info": ended.copy(),
        }

    def _infos(self, mask: Flags) -> dict[str, Any]:
        return self.infos_of(np.where(mask[:, None], self.robots.outcome, 0.0), mask)
