"""Observation wrappers for learning: map-independent observations, and guidance.

A policy for maps on which it was not trained must not observe its position.
`GoalRelativeObservation` gives the goal relative to the robot, `Guidance` the next
waypoint. Both are Gymnasium wrappers for either environment:

    env = gym.make("TDAC-Map2D-v0", map="office", variation="jitter")
    env = wrap(env, ("goal-relative", "guidance", "flatten"))

Their computations accept one observation or a batch of observations;
`tdac_envs.learning.wrapped_vector` wraps batched environments.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.wrappers import FlattenObservation
from numpy.typing import ArrayLike, NDArray

from tdac_envs.core.errors import TaskError
from tdac_envs.drive.env import Observation
from tdac_envs.drive.stepping import STEPS
from tdac_envs.epuck.infrared import LARGEST
from tdac_envs.learning.body_frame import seen_from
from tdac_envs.learning.dead_reckoning import SOURCES, reckoning, source_of
from tdac_envs.learning.guidance import REACH, GuidedRoute, route_to_goal
from tdac_envs.learning.map_view import MapView
from tdac_envs.learning.seen_map import SHAPES, SeenMap, Waypoints
from tdac_envs.map2d.task import Map2DTask

if TYPE_CHECKING:
    from tdac_envs.epuck.task import EPuckTask

Env = gym.Env[Any, NDArray[np.float32]]

MIDDLE = 10.0
"""Goal distance that is observed as 1/2, in body radii."""


@dataclass(frozen=True, slots=True)
class Frame:
    """Frame and scales of relative observations.

    Attributes:
        radius: Body radius, px or m; for a batch, shape (n, 1).
        up: Whether y points up, and headings are counter-clockwise.
        readings: Key of the distance sensors.
        largest: Their largest reading; for a batch, shape (n, 1).
    """

    radius: float | NDArray[np.float64]
    up: bool
    readings: str
    largest: float | NDArray[np.float64]

    @classmethod
    def of(cls, env: Env) -> Frame:
        """The frame of the observations of an environment, wrapped or not.

        Raises:
            TaskError: It is not an environment of `tdac_envs`.
        """
        plain: Any = env.unwrapped
        if not hasattr(plain, "nominal"):
            raise TaskError(f"expected an environment of tdac_envs, got {plain}")
        return cls.of_setup(plain.setup)

    @classmethod
    def of_setup(cls, setup: Any) -> Frame:
        """The frame of what a robot observes."""
        frame, metric = cls.of_task(setup.nominal), getattr(setup, "metric", None)
        scale = getattr(setup, "resolution", None) or (metric and metric.resolution)
        if scale is None:
            return frame
        return cls(frame.radius * scale, True, frame.readings, frame.largest * scale)

    @classmethod
    def of_task(cls, task: Map2DTask | EPuckTask) -> Frame:
        """The frame of a task's robot and its true poses."""
        if isinstance(task, Map2DTask):
            return cls(task.body_radius, False, "ranges", float(task.robot.range_max))
        return cls(task.body_radius, True, "ps", float(LARGEST))

    def seen(self, poses: ArrayLike, places: ArrayLike) -> NDArray[np.float64]:
        """Points in the robot's frame: distances ahead and to its left.

        Args:
            poses: Shape (…, 3): x, y, heading.
            places: Shape (…, 2).
        """
        return seen_from(poses, places, self.up)

    def goal_relative(self, observation: Observation) -> Observation:
        """Converts an observation, or a batch, as `GoalRelativeObservation` does.

        Args:
            observation: With the keys `pose` and `goal`.
        """
        seen = self.seen(observation["pose"], observation["goal"])
        distance = np.hypot(seen[..., 0], seen[..., 1])[..., None]
        near = distance / (distance + MIDDLE * self.radius)
        bearing = seen / np.maximum(distance, 1e-9)
        own = {"goal": np.concatenate([bearing, near], axis=-1).astype(np.float32)}
        if "wheel_speeds" in observation:
            own["wheel_speeds"] = observation["wheel_speeds"]
        if self.readings in observation:
            readings = observation[self.readings] / np.asarray(self.largest, np.float32)
            own[self.readings] = np.clip(readings, 0.0, 1.0)
        return own | {key: observation[key] for key in SHAPES if key in observation}

    def closeness(self, observation: Observation) -> Observation:
        """Converts relative observations, or a batch, as `Closeness` does."""
        ranges = observation["ranges"] * np.asarray(self.largest, np.float32)
        radius = np.asarray(self.radius, np.float32)
        near = radius / np.maximum(ranges, radius)
        return {**observation, "ranges": near.astype(np.float32)}

    def guidance(self, route: GuidedRoute, poses: ArrayLike) -> NDArray[np.float32]:
        """The `guidance` of one route at poses of shape (n, 3)."""
        return self.guidance_to(route.ahead(poses), poses, route.reach)

    def guidance_to(
        self, places: ArrayLike, poses: ArrayLike, reach: float | NDArray[np.float64]
    ) -> NDArray[np.float32]:
        """The `guidance` to given waypoints, shape (n, 2)."""
        seen = self.seen(poses, places) / reach
        return np.clip(seen, -1.0, 1.0).astype(np.float32)

    def relative_space(self, own: spaces.Space[Any]) -> spaces.Dict:
        """The space of `goal_relative`.

        Args:
            own: Space of the original observations.

        Raises:
            TaskError: It has no goal, or nothing that tells of the pose.
        """
        keys = set(own.spaces) if isinstance(own, spaces.Dict) else set()
        if "goal" not in keys or not keys & {"pose", *SOURCES}:
            raise TaskError(
                "expected observations with a goal, and a pose, odometry or encoders, "
                f"got {own}"
            )
        assert isinstance(own, spaces.Dict)
        found: dict[str, spaces.Space[Any]] = {
            "goal": spaces.Box(-1.0, 1.0, (3,), np.float32)
        }
        if "wheel_speeds" in keys:
            found["wheel_speeds"] = spaces.Box(-1.0, 1.0, (2,), np.float32)
        if self.readings in keys:
            shape = own[self.readings].shape
            found[self.readings] = spaces.Box(0.0, 1.0, shape, np.float32)
        found |= {key: own[key] for key in SHAPES if key in keys}
        return spaces.Dict(found)


def lacks_pose(own: spaces.Space[Any]) -> bool:
    """Whether the pose of original observations must come from odometry."""
    return isinstance(own, spaces.Dict) and "pose" not in own.spaces


def check_guidance(setup: Any) -> None:
    """Checks that an environment's robot may be guided.

    Args:
        setup: Setup of the environment.

    Raises:
        TaskError: It drives on a task set.
    """
    if setup.source is not None:
        raise TaskError(
            "guidance comes from the true map and pose, which no robot knows on a task "
            "set: leave out the wrapper 'guidance'"
        )


def check_closeness(own: spaces.Space[Any]) -> None:
    """Checks that observations have ranges as `GoalRelativeObservation` gives them.

    Raises:
        TaskError: They do not have such ranges.
    """
    found = own.spaces.get("ranges") if isinstance(own, spaces.Dict) else None
    if not isinstance(found, spaces.Box) or found.high.max() > 1.0:
        raise TaskError(
            f"expected ranges in a Dict, after the wrapper goal-relative, got {own}"
        )


def guided_space(own: spaces.Space[Any]) -> spaces.Dict:
    """An observation space with `guidance` added.

    Raises:
        TaskError: It is not a `Dict`.
    """
    if not isinstance(own, spaces.Dict):
        raise TaskError(f"expected observations in a Dict, got {own}")
    more = spaces.Box(-1.0, 1.0, (2,), np.float32)
    return spaces.Dict({**own.spaces, "guidance": more})


class GoalRelativeObservation(
    gym.ObservationWrapper[Observation, NDArray[np.float32], Observation],
    gym.utils.RecordConstructorArgs,
):
    """The goal relative to the robot, and normalised sensors; no position, no map.

    `Dict` of float32 arrays:

    | key | shape | range | content |
    |---|---|---|---|
    | `goal` | (3,) | [-1, 1] | direction of the goal in the robot's frame: ahead and |
    | | | | left (a unit vector); its distance d as d / (d + 10 body radii) |
    | `wheel_speeds` | (2,) | [-1, 1] | left, right, as last applied |
    | `ranges` or `ps` | (n,) | [0, 1] | reading / largest possible reading |

    Left is the robot's left in the picture, in both environments. Without a pose, as on
    some task sets, the goal is relative to the pose that the odometry since the start
    adds up to, with all its errors. Keys that the environment does not have are left
    out.

    Args:
        env: An environment of `tdac_envs` with its original observations.
    """

    def __init__(self, env: Env) -> None:
        gym.utils.RecordConstructorArgs.__init__(self)
        gym.ObservationWrapper.__init__(self, env)
        self.frame = Frame.of(env)
        space = self.frame.relative_space(env.observation_space)
        self.observation_space = space  # type: ignore[assignment]
        self._source = source_of(env.observation_space)
        lacks = self._source is not None and lacks_pose(env.observation_space)
        plain: Any = env.unwrapped
        axle = plain.nominal.axle_length
        self._reckoned = reckoning(str(self._source), axle) if lacks else None

    def observation(self, observation: Observation) -> Observation:
        """See the class."""
        if self._reckoned is None:
            return self.frame.goal_relative(observation)
        plain: Any = self.unwrapped
        steps = plain.robot.state[STEPS]
        pose: Any = self._reckoned.follow(observation[str(self._source)], steps)
        return self.frame.goal_relative({**observation, "pose": pose})


class Closeness(
    gym.ObservationWrapper[Observation, NDArray[np.float32], Observation],
    gym.utils.RecordConstructorArgs,
):
    """Ranges as closeness: body radius / distance, which is 1 at contact.

    | key | shape | range | content |
    |---|---|---|---|
    | `ranges` | (n,) | [0, 1] | body radius / distance from the robot's centre |

    A difference of one pixel changes it more, the nearer the wall is. As fractions of
    the maximum range, the small distances in a narrow passage would hardly differ.

    Args:
        env: An environment with ranges, wrapped in `GoalRelativeObservation`.
    """

    def __init__(self, env: Env) -> None:
        gym.utils.RecordConstructorArgs.__init__(self)
        gym.ObservationWrapper.__init__(self, env)
        check_closeness(env.observation_space)
        self.frame = Frame.of(env)

    def observation(self, observation: Observation) -> Observation:
        """See the class."""
        return self.frame.closeness(observation)


class Guidance(
    gym.ObservationWrapper[Observation, NDArray[np.float32], Observation],
    gym.utils.RecordConstructorArgs,
):
    """Adds the next waypoint of the reference route, relative to the robot.

    | key | shape | range | content |
    |---|---|---|---|
    | `guidance` | (2,) | [-1, 1] | distances ahead and to the robot's left, as shares |
    | | | | of `reach` |

    The route is the shortest path for the body that keeps a margin
    (`tdac_envs.learning.guidance`), from the robot's current position. The waypoint is
    `reach` further along it, or the goal if that is nearer. The route is computed from
    the whole map and the true pose, so guidance gives a policy more than sensor data.

    Args:
        env: Either environment; its observations must be a `Dict`. Task sets have no
            guidance.
        reach: Distance of the waypoint along the route, in body radii.
    """

    def __init__(self, env: Env, reach: float = REACH) -> None:
        gym.utils.RecordConstructorArgs.__init__(self, reach=reach)
        gym.ObservationWrapper.__init__(self, env)
        plain: Any = env.unwrapped
        check_guidance(plain.setup)
        self.frame = Frame.of_task(plain.nominal)
        self.reach = reach
        space = guided_space(env.observation_space)
        self.observation_space = space  # type: ignore[assignment]
        self._task: Any = None
        self._route: GuidedRoute | None = None

    def observation(self, observation: Observation) -> Observation:
        """See the class."""
        plain: Any = self.unwrapped
        if self._route is None or plain.task is not self._task:
            self._task, self._route = plain.task, route_to_goal(plain.task, self.reach)
        poses = plain.observed_pose()[None]
        return {**observation, "guidance": self.frame.guidance(self._route, poses)[0]}

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_task": None, "_route": None}


WRAPPERS: dict[str, Callable[[Env], Env]] = {
    "goal-relative": GoalRelativeObservation,
    "closeness": Closeness,
    "guidance": Guidance,
    "map-view": MapView,
    "seen-map": SeenMap,
    "waypoints": Waypoints,
    "flatten": FlattenObservation,
}
"""Wrappers by the names that `wrap`, `tdac train` and `tdac evaluate` accept."""


def check_wrappers(names: Sequence[str]) -> None:
    """Checks that all names are in `WRAPPERS`.

    Raises:
        TaskError: A name is unknown.
    """
    for name in names:
        if name not in WRAPPERS:
            known = ", ".join(WRAPPERS)
            raise TaskError(f"unknown wrapper {name!r}; expected some of {known}")


def wrap(env: Env, names: Sequence[str]) -> Env:
    """Wraps an environment, the first wrapper innermost.

    Args:
        env: An environment of `tdac_envs`.
        names: Names in `WRAPPERS`; `flatten` concatenates a `Dict` by sorted keys.

    Raises:
        TaskError: A name is unknown, or a wrapper does not support the observations.
    """
    check_wrappers(names)
    for name in names:
        env = WRAPPERS[name](env)
    return env
