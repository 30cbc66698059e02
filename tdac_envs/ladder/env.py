"""TDAC-Ladder-v0: one controller for worlds that it has never seen."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.drive.disturbances import Disturbances
from tdac_envs.drive.env import Observation
from tdac_envs.drive.rewards import weights_of
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.ladder.observed import View
from tdac_envs.ladder.source import SetSource, read_salt
from tdac_envs.ladder.task_sets import TaskSet, load_set
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.map2d.setup import Setup

TRAIN_POOL = 4096
"""Default number of training worlds."""


class LadderEnv(Map2DEnv):
    """A robot drives to a goal in worlds that are new to it, one for each episode.

    ## Description
    Robot and physics are those of TDAC-Map2D-v0; a task set defines the worlds, the
    robot, what it observes, and the disturbances (`docs/task-sets.md`). `tdac sets`
    lists the levels:
    - `known`: the map and the exact pose on it,
    - `unknown`: the exact pose and short ranges, no map,
    - `lost`: odometry with errors and noisy ranges; wheels that slip and are not
      equally fast; neither a pose nor a map.

    ## Action Space
    As in TDAC-Map2D-v0.

    ## Observation Space
    `Dict` of float32 arrays, the same for all worlds of a level. Without a map, the
    frame of reference has its origin and its x axis at the start pose.

    | key | levels | content |
    |---|---|---|
    | `pose` | `known`, `unknown` | x, y (px), heading (rad, in (-pi, pi]) |
    | `goal` | all | x, y, px |
    | `wheel_speeds` | all | left, right, as last applied, fraction |
    | `ranges` | all | distance to the first wall along each ray, px |
    | `odometry` | `lost` | measured distance (px) and turn (rad) of the last step |

    ## Rewards
    As in TDAC-Map2D-v0. They use the length of the true shortest path, which no
    observation shows: they are for training only.

    ## Starting State
    In `reset(seed=...)`, the seed draws a world of the split;
    `reset(options={"index": 3})` chooses one.

    ## Info
    `collisions` and `clipped`; at the end of an episode also `is_success` and
    `collision`. With `privileged=True`, all entries of TDAC-Map2D-v0 and `pose`, the
    true pose on the map.

    ## Episode End
    As in TDAC-Map2D-v0: a contact ends the episode.

    ## Arguments
    Args:
        level: Name of a task set, or path of a `set.yaml`.
        split: `"train"`, `"dev"`, `"test"` or `"hidden"`.
        train_pool: Number of training worlds. A world is made when it is first drawn,
            and kept in the user's cache folder. 0 for a new world in each episode.
        salt_file: File with the salt of the split `"hidden"`, 16 bytes or more.
        privileged: Whether `info` is complete. A rival or a judge never sets it.
        reward_weights: Reward weights by name, where they differ from the defaults.
        render_mode: `"rgb_array"`, `"human"` (extra `tdac[human]`) or None.

    ## Version History
    * v0: Initial version.
    """

    title = "TDAC-Ladder-v0"

    def __init__(
        self,
        level: str | Path = "unknown",
        split: str = "train",
        train_pool: int = TRAIN_POOL,
        salt_file: str | Path | None = None,
        privileged: bool = False,
        reward_weights: Mapping[str, float] | None = None,
        render_mode: str | None = None,
    ) -> None:
        salt = None if salt_file is None else read_salt(salt_file)
        self.set = load_set(level)
        source = SetSource(self.set, split, train_pool, salt)
        self._prepare(_setup(self.set, source, reward_weights), render_mode)
        self.view = View(self.set.file, self.set.largest_side, bool(privileged))
        self._anchor = self.view.anchor(self.nominal)
        self.observation_space = self.view.space(self.observation_space)  # type: ignore[assignment, arg-type]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts an episode; the class documents `options`.

        Raises:
            TaskError: An option is unknown, or there is no feasible world.
        """
        seen, info = super().reset(seed=seed, options=options)
        return seen, self.view.info(info, self.pose(), ended=False)

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Runs one time step with the wheel speeds of an action.

        Raises:
            ValueError: The action is not two finite numbers.
        """
        seen, reward, terminated, truncated, info = super().step(action)
        info = self.view.info(info, self.pose(), terminated or truncated)
        return seen, reward, terminated, truncated, info

    def given_map(self) -> BoolGrid | None:
        """The map of the episode's world, if the level gives it.

        Returns:
            Shape (height, width), bool, indexed `[y, x]`, True = occupied; or None.
        """
        return self.task.terrain.grid.cells if self.set.file.map else None

    def _draw(self, options: dict[str, Any]) -> Any:
        task = super()._draw(options)
        self._anchor = self.view.anchor(task)
        return task

    def _observation(self) -> Observation:
        return self.view.seen(super()._observation(), self.pose(), self._anchor)


def _setup(
    task_set: TaskSet, source: SetSource, weights: Mapping[str, float] | None
) -> Setup:
    """The setup of a set's environment; its nominal task is that of world 0."""
    file = task_set.file
    own = file.disturbances
    return Setup(
        nominal=source.task(0),
        variation="nominal",
        fixed_horizon=True,
        on_collision="terminate",
        motor_lag=own.motor_lag,
        delay=own.delay,
        disturbances=Disturbances(
            wheel_slip=file.slip,
            wheel_gains=own.wheel_gains,
            axle_error=own.axle_error,
            odometry="odometry" in file.observed,
            odometry_scale=own.odometry_scale,
            odometry_noise=own.odometry_noise,
        ),
        weights=weights_of(weights),
        source=source,
        range_noise=own.range_noise,
        range_dropout=own.range_dropout,
    )
