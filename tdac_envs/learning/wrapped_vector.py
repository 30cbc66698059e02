"""Observation wrappers for batched environments, vectorised over the robots."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from tdac_envs.core.addresses import Addresses
from tdac_envs.core.errors import TaskError
from tdac_envs.core.slices import Slices
from tdac_envs.drive.stepping import STEPS
from tdac_envs.drive.vector import DrivenVectorEnv, Observations
from tdac_envs.learning.dead_reckoning import DeadReckoning, reckoning, source_of
from tdac_envs.learning.guidance import GuidedRoute, look_ahead, route_to_goal
from tdac_envs.learning.map_view import MapViews, check_map_view, viewed_space
from tdac_envs.learning.seen_map import (
    VIEWS,
    Seeing,
    SeenMaps,
    View,
    with_view,
)
from tdac_envs.learning.wrappers import (
    Frame,
    check_closeness,
    check_guidance,
    check_wrappers,
    guided_space,
    lacks_pose,
)

Array = NDArray[np.float64]
Seen = Any
"""Observations of a batch: a dict of arrays, or one array if flattened."""


class Routes:
    """The routes of all robots of a batch; all waypoints are found in one call.

    Args:
        batch: The batch, with the tasks of its robots.
    """

    def __init__(self, batch: DrivenVectorEnv) -> None:
        count = batch.num_envs
        self._batch = batch
        self._tasks: list[Any] = list(batch.tasks)
        self._cells, self._found = np.zeros((count, 2)), np.zeros((count, 2))
        self._goals, self._corners = np.zeros((count, 2)), np.zeros((count, 2))
        self._reaches = np.zeros(count)
        self._spacings, self.reach = np.ones((count, 1)), np.ones((count, 1))
        # At first, robots of one setup usually share their task.
        known = {id(task): task for task in self._tasks}
        routes = {key: route_to_goal(task) for key, task in known.items()}
        own = [routes[id(task)] for task in self._tasks]
        self._addresses = Addresses((route.roomy, route.shortest) for route in own)
        for i, route in enumerate(own):
            self._store(i, route)
        shared = self._addresses.words, self._cells, self._reaches, self._found
        self._shared = Addresses([shared])
        self._slices, self._all = Slices(batch.threads), np.arange(count)

    def refresh(self) -> None:
        """Updates the routes of the robots whose task has changed."""
        tasks = self._batch.tasks
        if self._tasks == tasks:
            return
        for i, task in enumerate(tasks):
            if task is not self._tasks[i]:
                route = route_to_goal(task)
                self._addresses.put(i, (route.roomy, route.shortest))
                self._store(i, route)
        self._tasks = list(tasks)

    def ahead(self, poses: Array) -> Array:
        """The next waypoint of each robot, shape (n, 2); see `GuidedRoute.ahead`."""
        np.divide(poses[:, :2] - self._corners, self._spacings, out=self._cells)
        self._slices.run(partial(look_ahead, self._shared.words[0]), self._all)
        at = self._found * self._spacings + self._corners
        return np.where(np.isfinite(self._found), at, self._goals)

    def close(self) -> None:
        """Stops the threads."""
        self._slices.close()

    def _store(self, i: int, route: GuidedRoute) -> None:
        """Stores frame, goal and reach of a robot's route."""
        *self._corners[i], self._spacings[i] = route.frame
        self._goals[i], self.reach[i] = route.goal, route.reach
        self._reaches[i] = route.reach / route.frame[2]


class WrappedVectorEnv(VectorWrapper):
    """A batched environment with observation wrappers.

    The observations are bit-identical to those of `wrap` for single environments.

        batch = gym.make_vec("TDAC-Map2D-v0", 64, autoreset_mode="SameStep")
        batch = WrappedVectorEnv(batch, ("goal-relative", "guidance", "flatten"))

    Args:
        batch: A batched environment of this package.
        names: Names in `tdac_envs.wrappers.WRAPPERS`, the innermost first.

    Raises:
        TaskError: The batch is not of this package, a name is unknown, or a wrapper
            does not support the observations.
    """

    def __init__(self, batch: VectorEnv[Any, Any, Any], names: Sequence[str]) -> None:
        if not isinstance(batch, DrivenVectorEnv):
            raise TaskError(f"expected a batch made by gym.make_vec, got {batch}")
        check_wrappers(names)
        super().__init__(batch)
        self.batch = batch
        self.names = tuple(names)
        self._reckoned: DeadReckoning | None = None
        self._maps: SeenMaps | None = None
        self._bind()
        self.single_observation_space = self._space
        self.observation_space = batch_space(self._space, self.num_envs)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Seen, dict[str, Any]]:
        """Starts episodes; see `DrivenVectorEnv.reset`."""
        observations, infos = self.batch.reset(seed=seed, options=options)
        return self._current(observations), infos

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Seen, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Steps once; see `DrivenVectorEnv.step`."""
        observations, rewards, terminated, truncated, infos = self.batch.step(actions)
        if "final_obs" in infos:
            self._wrap_final(observations, infos)
        return self._current(observations), rewards, terminated, truncated, infos

    def close(self, **kwargs: Any) -> None:
        """Stops the threads."""
        for threads in (self._routes, self._maps):
            if threads is not None:
                threads.close()
        super().close(**kwargs)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_routes": None, "_views": None, "_stages": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._bind()

    def _bind(self) -> None:
        """Prepares the computation of each wrapper."""
        self._routes: Routes | None = None
        self._views: MapViews | None = None
        self._space: spaces.Space[Any] = self.batch.single_observation_space
        self._stages = [self._stage(name) for name in self.names]

    def _stage(self, name: str) -> Callable[[Any, Array], Any]:
        own, setups = self._space, self.batch.setups
        frame = _joined([Frame.of_setup(setup) for setup in setups])
        if name == "goal-relative":
            self._space = frame.relative_space(own)
            if lacks_pose(own):
                self._source = str(source_of(own))
                axles = [setup.nominal.axle_length for setup in setups]
                made = reckoning(self._source, axles, self.num_envs)
                self._reckoned = self._reckoned or made
            return lambda seen, _: frame.goal_relative(seen)
        if name == "closeness":
            check_closeness(own)
            return lambda seen, _: frame.closeness(seen)
        if name in VIEWS:
            return self._own_map_stage(VIEWS[name])
        if name == "guidance":
            check_guidance(setups[0])
            true = _joined([Frame.of_task(setup.nominal) for setup in setups])
            self._space = guided_space(own)
            routes = self._routes = self._routes or Routes(self.batch)
            return lambda seen, poses: {
                **seen,
                "guidance": true.guidance_to(routes.ahead(poses), poses, routes.reach),
            }
        if name == "map-view":
            check_map_view(setups[0])
            self._space = viewed_space(own)
            views = self._views = self._views or MapViews(self.batch.tasks)
            return lambda seen, poses: {**seen, "map": views.around(poses)}
        return self._flattening()

    def _flattening(self) -> Callable[[Any, Array], Any]:
        own = self._space
        self._space = spaces.flatten_space(own)
        if not isinstance(own, spaces.Dict):
            return lambda seen, _: seen
        keys = tuple(own.spaces)
        return lambda seen, _: np.concatenate(
            [seen[key].reshape(self.num_envs, -1) for key in keys], axis=-1
        )

    def _own_map_stage(self, key: View) -> Callable[[Any, Array], Any]:
        each = [Seeing.of(setup, self._space) for setup in self.batch.setups]
        if any(not seeing.is_like(each[0]) for seeing in each):
            raise TaskError("seen-map and waypoints need robots that see alike")
        made = SeenMaps(each[0], self.num_envs, self.batch.threads)
        self._maps = maps = self._maps or made
        self._space = with_view(self._space, key)
        return lambda seen, _: {**seen, key: maps.view(key)}

    def _given_maps(self) -> list[Any]:
        """The map that each robot is given, or None."""
        tasks = self.batch.tasks
        given = self._maps is not None and self._maps.seeing.given
        return [task.terrain.grid.cells if given else None for task in tasks]

    def _current(self, observations: Observations) -> Seen:
        if self._maps is not None:
            steps = self.batch.robots.state[:, STEPS]
            self._maps.follow(observations, steps, self._given_maps())
        if self._routes is not None:
            self._routes.refresh()
        if self._views is not None:
            self._views.refresh(self.batch.tasks)
        if self._reckoned is not None:
            steps = self.batch.robots.state[:, STEPS]
            pose: Any = self._reckoned.follow(observations[self._source], steps)
            observations = {**observations, "pose": pose}
        return self._wrapped(observations, self.batch.observed_poses())

    def _wrapped(self, observations: Observations, poses: Array) -> Seen:
        seen: Any = observations
        for stage in self._stages:
            seen = stage(seen, poses)
        return seen

    def _wrap_final(self, observations: Observations, infos: dict[str, Any]) -> None:
        """Wraps the last observations of the episodes that have ended."""
        final = infos["final_obs"]
        over = np.flatnonzero(infos["_final_obs"]).tolist()
        last = {key: value.copy() for key, value in observations.items()}
        for i in over:
            for key, value in final[i].items():
                last[key][i] = value
        if self._maps is not None:
            self._maps.end(np.array(over), last)
        if self._reckoned is not None:
            final_pose: Any = self._reckoned.ahead(last[self._source])
            last["pose"] = final_pose
        seen = self._wrapped(last, self.batch.last_observed_poses)
        for i in over:
            single = not isinstance(seen, dict)
            final[i] = seen[i] if single else {key: v[i] for key, v in seen.items()}


def _joined(frames: Sequence[Frame]) -> Frame:
    """The frame of all robots, with a radius and a largest reading for each robot."""
    first = frames[0]
    radii = np.array([[frame.radius] for frame in frames])
    largest = np.array([[frame.largest] for frame in frames])
    return Frame(radii, first.up, first.readings, largest)
