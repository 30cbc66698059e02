"""The part of a given map that is around the robot, as the robot faces it.

For task sets that give their map (`known`, `crowd`). The view has two scales: a near
one of 16 x 16 points, half a body radius apart, and a far one, two body radii apart.
Each point shows its clearance: it says whether a body fits there, and how near walls
are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from tdac_envs.core.errors import TaskError
from tdac_envs.drive.env import Observation

SIDE = 16
"""Points on each side of a view."""
SPACINGS = (0.5, 2.0)
"""Distances between the points of the near and the far view, body radii."""
CLEAR = 3.0
"""Clearance that is observed as 1, body radii."""
SHAPE = (len(SPACINGS), SIDE, SIDE)


class MapViews:
    """The views of one or several robots, each on its own map.

    Args:
        tasks: Current task of each robot.
    """

    def __init__(self, tasks: Sequence[Any]) -> None:
        self._tasks: list[Any] = [None] * len(tasks)
        self._clear = np.zeros((len(tasks), 0, 0), np.float32)
        self._radii = np.array([task.body_radius for task in tasks])
        middle = (np.arange(SIDE) - (SIDE - 1) / 2)[::-1]
        ahead, left = np.meshgrid(middle, middle, indexing="ij")
        scales = np.array(SPACINGS)[:, None, None]
        self._ahead, self._left = scales * ahead, scales * left
        self.refresh(tasks)

    def refresh(self, tasks: Sequence[Any]) -> None:
        """Updates the maps of the robots whose task has changed."""
        for i, task in enumerate(tasks):
            if task is not self._tasks[i]:
                self._tasks[i] = task
                self._put(i, task)

    def around(self, poses: NDArray[np.float64]) -> NDArray[np.float32]:
        """The views from poses on the maps, shape (n, 3).

        Returns:
            Shape (n, 2, 16, 16), in [0, 1]: near and far view; from the row farthest
            ahead to the one farthest behind, and from left to right. Values are
            clearances (`CLEAR` is 1); 0 in walls and outside the map.
        """
        x, y, heading, radius = (
            column[:, None, None, None] for column in (*poses.T, self._radii)
        )
        cosine, sine = np.cos(heading), np.sin(heading)
        ahead, left = radius * self._ahead, radius * self._left
        # y points down, so that left of heading 0 is up.
        columns = np.rint(x + ahead * cosine + left * sine).astype(np.int64)
        rows = np.rint(y + ahead * sine - left * cosine).astype(np.int64)
        height, width = self._clear.shape[1:]
        robots = np.arange(len(poses))[:, None, None, None]
        # Indices outside fall on the border of zeros.
        columns, rows = (columns + 1).clip(0, width - 1), (rows + 1).clip(0, height - 1)
        views: NDArray[np.float32] = self._clear[robots, rows, columns]
        return views

    def _put(self, i: int, task: Any) -> None:
        """Stores the map of a robot, with a border of zeros."""
        clear = task.terrain.clear
        height, width = clear.shape[0] + 2, clear.shape[1] + 2
        most = self._clear.shape[1:]
        if height > most[0] or width > most[1]:
            more = max(height - most[0], 0), max(width - most[1], 0)
            self._clear = np.pad(self._clear, [(0, 0), (0, more[0]), (0, more[1])])
        self._clear[i] = 0.0
        scaled = clear / np.float32(CLEAR * task.body_radius)
        self._clear[i, 1 : height - 1, 1 : width - 1] = np.minimum(scaled, 1.0)


def check_map_view(setup: Any) -> None:
    """Checks that an environment's robots are given a map.

    Args:
        setup: Setup of the environment.

    Raises:
        TaskError: They are not.
    """
    if not getattr(setup.source, "gives_map", False):
        raise TaskError(
            "there is no map to view, as only some task sets give one: leave out the "
            "wrapper 'map-view'"
        )


def viewed_space(own: spaces.Space[Any]) -> spaces.Dict:
    """An observation space with `map` added.

    Raises:
        TaskError: It is not a `Dict`.
    """
    if not isinstance(own, spaces.Dict):
        raise TaskError(f"expected observations in a Dict, got {own}")
    return spaces.Dict({**own.spaces, "map": spaces.Box(0.0, 1.0, SHAPE, np.float32)})


class MapView(
    gym.ObservationWrapper[Observation, NDArray[np.float32], Observation],
    gym.utils.RecordConstructorArgs,
):
    """Adds the given map around the robot, as the robot faces it.

    | key | shape | range | content |
    |---|---|---|---|
    | `map` | (2, 16, 16) | [0, 1] | clearance, as a share of 3 body radii, at points |
    | | | | 0.5 (near view) and 2 body radii (far view) apart; rows |
    | | | | from ahead to behind, columns from left to right |

    The robot is in the middle. Walls and what is outside the map are 0.

    Args:
        env: An environment of a task set that gives its map; observations are a `Dict`.
    """

    def __init__(self, env: gym.Env[Any, NDArray[np.float32]]) -> None:
        gym.utils.RecordConstructorArgs.__init__(self)
        gym.ObservationWrapper.__init__(self, env)
        plain: Any = env.unwrapped
        check_map_view(plain.setup)
        space = viewed_space(env.observation_space)
        self.observation_space = space  # type: ignore[assignment]
        self._views = MapViews([plain.task])

    def observation(self, observation: Observation) -> Observation:
        """See the class."""
        plain: Any = self.unwrapped
        self._views.refresh([plain.task])
        return {
            **observation,
            "map": self._views.around(plain.observed_pose()[None])[0],
        }
