"""A goal-conditioned view of the environments, for hindsight experience replay."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from tdac_envs.core.arguments import non_negative
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.env import Observation
from tdac_envs.epuck import paths
from tdac_envs.learning.wrappers import Env, Frame, lacks_pose
from tdac_envs.map2d import terrain
from tdac_envs.map2d.task import Map2DTask

if TYPE_CHECKING:
    from tdac_envs.epuck.task import EPuckTask

Array = NDArray[np.float64]


class GoalView(
    gym.Wrapper[
        dict[str, NDArray[Any]], NDArray[np.float32], Observation, NDArray[np.float32]
    ],
    gym.utils.RecordConstructorArgs,
):
    """Either environment as a goal environment, as gymnasium-robotics defines it.

    Afterwards, any place that the robot reached can replace the goal:
    `compute_reward`, `compute_terminated` and `compute_truncated` return what the
    step would have returned. Stable-Baselines3's `HerReplayBuffer` uses the first.

    Observations are a `Dict`:

    | key | shape | range | content |
    |---|---|---|---|
    | `achieved_goal` | (2,) | [-1, 1] | x, y of the robot, float64 |
    | `desired_goal` | (2,) | [-1, 1] | x, y of the goal, float64 |
    | `observation` | (n + 4,) | [-1, 1] | cosine and sine of the heading; left and |
    | | | | right wheel speed; the n readings / largest reading |

    Positions are relative to the centre of the map or world and divided by half the
    length of its longer side.

    The reward is sparse: 0 at the goal and -1 elsewhere. A contact that ends the
    episode also costs `contact_cost`; otherwise it would save the cost of the remaining
    steps. `info["collision"]` reports the contact, so hindsight replay needs
    `HerReplayBuffer(..., copy_info_dict=True)`. With `on_collision="block"`, no contact
    ends an episode, and this argument is not needed.

    Args:
        env: `TDAC-Map2D-v0` or `TDAC-EPuck-v0` with its original observations.
        contact_cost: Cost of a contact that ends the episode, in steps.

    Raises:
        TaskError: `env` is not such an environment, or the cost is negative.
    """

    def __init__(self, env: Env, contact_cost: float = 100.0) -> None:
        gym.utils.RecordConstructorArgs.__init__(self, contact_cost=contact_cost)
        gym.Wrapper.__init__(self, env)
        self.contact_cost = non_negative("contact_cost", contact_cost)
        self.frame = Frame.of(env)
        self.frame.relative_space(env.observation_space)
        if lacks_pose(env.observation_space):
            raise TaskError(
                f"expected observations with a pose, got {env.observation_space}"
            )
        own: Any = env.observation_space
        low, high = (np.asarray(b, float) for b in (own["goal"].low, own["goal"].high))
        self._centre, self._scale = (low + high) / 2.0, float((high - low).max()) / 2.0
        goals = spaces.Box(-1.0, 1.0, (2,), np.float64)
        count = 4 + own[self.frame.readings].shape[0]
        space = spaces.Dict(
            {
                "achieved_goal": goals,
                "desired_goal": goals,
                "observation": spaces.Box(-1.0, 1.0, (count,), np.float32),
            }
        )
        self.observation_space = space  # type: ignore[assignment]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Starts an episode; see the environment."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._view(observation), info

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[dict[str, NDArray[Any]], float, bool, bool, dict[str, Any]]:
        """Runs one step; `info` also has `truncated`, for `compute_truncated`."""
        observation, _, terminated, truncated, info = self.env.step(action)
        info = {**info, "truncated": truncated}
        seen = self._view(observation)
        achieved, desired = seen["achieved_goal"], seen["desired_goal"]
        reward = self.compute_reward(achieved, desired, info)
        return seen, reward, terminated, truncated, info

    def compute_reward(
        self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: Any
    ) -> Any:
        """The reward of a step that reached a place, given a goal.

        Args:
            achieved_goal: Place or places, shape (2,) or (n, 2), as observed.
            desired_goal: Goal or goals, of the same shape.
            info: The `info` of the step, or one for each of n steps.

        Returns:
            A float, or an array of shape (n,).
        """
        reached = self._reached(achieved_goal, desired_goal)
        costs = self.contact_cost * self._contacts(info)
        return _plain(np.where(reached, 0.0, -1.0) - costs)

    def compute_terminated(
        self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: Any
    ) -> Any:
        """Whether the step would have ended the episode; see `compute_reward`."""
        reached = self._reached(achieved_goal, desired_goal)
        return _plain(reached | self._contacts(info))

    def compute_truncated(
        self,
        achieved_goal: ArrayLike,  # noqa: ARG002 - the horizon holds for any goal
        desired_goal: ArrayLike,  # noqa: ARG002
        info: Any,
    ) -> Any:
        """Whether the horizon has ended the episode; see `compute_reward`."""
        return _plain(_flags(info, "truncated"))

    def _view(self, observation: Observation) -> dict[str, NDArray[Any]]:
        plain: Any = self.unwrapped
        x, y, heading = plain.pose().tolist()
        readings = observation[self.frame.readings] / np.float32(self.frame.largest)
        parts = (
            [np.cos(heading), np.sin(heading)],
            observation["wheel_speeds"],
            np.clip(readings, 0.0, 1.0),
        )
        return {
            "achieved_goal": self._scaled((x, y)),
            "desired_goal": self._scaled(plain.task.goal),
            "observation": np.concatenate(parts, dtype=np.float32),
        }

    def _scaled(self, place: ArrayLike) -> Array:
        scaled: Array = (np.asarray(place, float) - self._centre) / self._scale
        return scaled

    def _reached(self, achieved: ArrayLike, desired: ArrayLike) -> NDArray[np.bool_]:
        """Whether places are within the tolerance of goals, with nothing in between."""
        plain: Any = self.unwrapped
        task = plain.task
        places, goals = (
            np.asarray(given, float) * self._scale + self._centre
            for given in (achieved, desired)
        )
        # Preselects with a slightly larger tolerance; `_at_goal` decides.
        gaps = np.linalg.norm(places - goals, axis=-1)
        near = np.asarray(gaps <= task.goal_tolerance * 1.01)
        for index in np.argwhere(near):
            at = tuple(index)
            near[at] = _at_goal(task, goals[at].tolist(), *places[at].tolist())
        return near

    def _contacts(self, info: Any) -> NDArray[np.bool_]:
        """Whether contacts ended episodes."""
        plain: Any = self.unwrapped
        hits = _flags(info, "collision")
        return hits if plain.on_collision == "terminate" else np.zeros_like(hits)


def _at_goal(
    task: Map2DTask | EPuckTask, goal: tuple[float, float], x: float, y: float
) -> bool:
    """Whether (x, y) is at a goal, as the environment decides it."""
    if isinstance(task, Map2DTask):
        return terrain.at_goal(task.terrain, goal, task.goal_tolerance, x, y)
    return paths.at_goal(task.ground, goal, task.goal_tolerance, x, y)


def _flags(info: Any, key: str) -> NDArray[np.bool_]:
    """A flag of one info or of several; False where it is missing."""
    if isinstance(info, dict):
        return np.asarray(bool(info.get(key, False)))
    return np.array([bool(one.get(key, False)) for one in info], np.bool_)


def _plain(values: NDArray[Any]) -> Any:
    """A plain value for a single step, else the array."""
    return values if np.ndim(values) else np.asarray(values).item()
