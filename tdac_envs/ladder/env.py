"""TDAC-Ladder-v0: one controller for worlds that it has never seen."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.salt import read_salt
from tdac_envs.drive.env import DrivenEnv, Observation
from tdac_envs.drive.rewards import weights_of
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.setup import EPuckSetup
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.ladder.observed import SetView
from tdac_envs.ladder.pool import MOST_PLATES
from tdac_envs.ladder.robots import EPuckRobotParams
from tdac_envs.ladder.set_file import find_set_file
from tdac_envs.ladder.source import SetSource
from tdac_envs.ladder.task_sets import TaskSet, load_set
from tdac_envs.map2d.carried import carried_by
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.map2d.setup import Map2DSetup
from tdac_envs.physics.engine_choice import PhysicsOption, engine_of
from tdac_envs.physics.moved import EXACT

TRAIN_POOL = 4096
"""Default number of training worlds."""


class TaskSetEnv(DrivenEnv):
    """What the environments of both robots add for a task set.

    Attributes:
        set: The task set.
        view: What is observed.
        readings: Observation key of the distance sensors.
    """

    title = "TDAC-Ladder-v0"
    set: TaskSet
    view: SetView
    readings: str

    def _look(self, task_set: TaskSet, privileged: bool) -> None:
        """Observes what the set says, after all else has been prepared."""
        self.set = task_set
        self.view = SetView(task_set.file, task_set.largest_side, privileged)
        self._anchor = self.view.anchor(self.nominal)
        self.observation_space = self.view.space(self.observation_space)  # type: ignore[assignment, arg-type]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts an episode; `LadderEnv` documents `options`.

        Raises:
            TaskError: An option is unknown, or there is no feasible world.
        """
        seen, whole = super().reset(seed=seed, options=options)
        info = self.view.info(whole, self.pose(), ended=False)
        return seen, {**info, **deepcopy(self.task.world_facts or {})}

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
        whole = super()._observation()
        return self.view.seen(whole, self.observed_pose(), self._anchor)


class LadderEnv(TaskSetEnv, Map2DEnv):
    """A robot drives to a goal in worlds that are new to it, one for each episode.

    ## Description
    Robot and physics are those of TDAC-Map2D-v0, or of TDAC-EPuck-v0 if the robot is an
    e-puck (`EPuckLadderEnv`); a task set defines the worlds, the robot, what it
    observes, and the disturbances (`docs/task-sets.md`). `tdac sets` lists the levels:
    - `known`: the map and the exact pose on it,
    - `unknown`: the exact pose and ranges all around, no map,
    - `lost`: odometry with errors and noisy ranges; wheels that slip and are not
      equally fast; neither a pose nor a map,
    - `moving`: as `unknown`, with room to pass, among discs that move,
    - `crowd`: the map and the exact pose on it, among people who walk about; wheels
      that are not equally fast, rays that drop out,
    - `epuck`: infra-red sensors and wheel encoders of an e-puck whose wheels slip;
      neither a pose nor a map,
    - `floor`: a TurtleBot3 in metres, with the pose of a localiser and the scan of a
      laser, both with errors and late; no map.

    ## Action Space
    `Box(-1, 1, (2,), float32)`: speed of the left and of the right wheel as a fraction
    of the largest one.

    ## Observation Space
    `Dict` of float32 arrays, the same for all worlds of a level. Without a map, the
    frame of reference has its origin and its x axis at the start pose. On `floor`,
    and on other sets with a `resolution`, px below are m, and y is to the left.

    | key | levels | content |
    |---|---|---|
    | `pose` | all but `lost`, `epuck` | x, y (px), heading (rad, in (-pi, pi]) |
    | `goal` | all | x, y, px; on `epuck` m |
    | `wheel_speeds` | all | left, right, as last applied, fraction |
    | `ranges` | all but `epuck` | distance to the first wall or mover of each ray, px |
    | `odometry` | `lost` | measured distance (px) and turn (rad) of the last step |
    | `ps` | `epuck` | readings of the infra-red sensors, as in TDAC-EPuck-v0 |
    | `encoders` | `epuck` | angles that the wheels have turned, rad |

    ## Rewards
    As in TDAC-Map2D-v0. They use the length of the true shortest path, which no
    observation shows: they are for training only.

    ## Starting State
    In `reset(seed=...)`, the seed draws a world of the split;
    `reset(options={"index": 3})` chooses one.

    ## Info
    `collisions` and `clipped`; at the end of an episode also `is_success` and
    `collision`. With `privileged=True`, all entries of TDAC-Map2D-v0 and `pose`, the
    true pose on the map; their lengths are px on maps, also where m are observed.

    In the splits `train` and `dev`, `reset` also returns `world_index`, the number of
    the world; `generator`, its generator or kind of map; and `difficulty`, a dict of
    figures (`docs/generated-worlds.md`), whose `length` is px on maps, also where m
    are observed, and m for an e-puck. Judged controllers never see them.

    ## Episode End
    As in TDAC-Map2D-v0: a contact ends the episode.

    ## Arguments
    Args:
        level: Name of a task set, or path of a `set.yaml`.
        split: `"train"`, `"dev"`, `"test"` or `"hidden"`.
        train_pool: Number of training worlds. A world is made when it is first drawn,
            and kept in the user's cache folder; those of an e-puck (by default 512)
            are kept in memory. 0 for a new world in each episode.
        salt_file: File with the salt of the split `"hidden"`, 16 bytes or more.
        privileged: Whether `info` is complete. Policies must not use what it adds.
        reward_weights: Reward weights by name, where they differ from the defaults.
        render_mode: `"rgb_array"`, `"human"` (extra `tdac[human]`) or None.
        hidden_folder: Folder with the held-out maps of a set whose worlds are files.
        physics: `"exact"`, or `"mujoco"` (extra `tdac[physics]`): a 3D contact solver
            moves the robot (`docs/physics.md`).
        nearer_starts: Probability with which an episode of the split `"train"` begins
            nearer to the goal: the length of its path is drawn uniformly, up to that
            from the world's own start. This makes learning easier.

    ## Version History
    * v0: Initial version. Before the first release, the e-puck's axle became the
      effective one, 57 mm; since then, dynamics are frozen as Ladder 1.0.
    """

    def __init__(
        self,
        level: str | Path = "unknown",
        split: str = "train",
        train_pool: int = TRAIN_POOL,
        salt_file: str | Path | None = None,
        privileged: bool = False,
        reward_weights: Mapping[str, float] | None = None,
        render_mode: str | None = None,
        hidden_folder: str | Path | None = None,
        nearer_starts: float = 0.0,
        physics: PhysicsOption = EXACT,
    ) -> None:
        task_set, source = _opened(
            level, split, train_pool, salt_file, hidden_folder, nearer_starts
        )
        file = task_set.file
        setup = Map2DSetup(
            **_shared(task_set, source, reward_weights),
            range_noise=file.disturbances.range_noise,
            range_dropout=file.disturbances.range_dropout,
            range_min=file.disturbances.range_min,
            reception=file.disturbances.reception,
            max_acceleration=file.disturbances.max_acceleration,
            resolution=file.resolution,
            physics=engine_of(physics),
            pixel_size=file.resolution,
        )
        self._prepare(setup, render_mode)
        self._look(task_set, bool(privileged))

    def _draw(self, options: dict[str, Any]) -> Any:
        before = self.task.terrain
        task = super()._draw(options)
        if self._carried is not None and task.terrain is not before:
            self._carried = carried_by(self.setup, task)
        return task


class EPuckLadderEnv(TaskSetEnv, EPuckEnv):
    """TDAC-Ladder-v0 with an e-puck; `LadderEnv` documents both.

    Headings, and a positive turn, are counter-clockwise here, as in TDAC-EPuck-v0.
    """

    def __init__(
        self,
        level: str | Path = "epuck",
        split: str = "train",
        train_pool: int = MOST_PLATES,
        salt_file: str | Path | None = None,
        privileged: bool = False,
        reward_weights: Mapping[str, float] | None = None,
        render_mode: str | None = None,
        nearer_starts: float = 0.0,
        physics: PhysicsOption = EXACT,
    ) -> None:
        task_set, source = _opened(
            level, split, train_pool, salt_file, None, nearer_starts
        )
        robot, seen = task_set.file.robot, task_set.file.observed
        assert isinstance(robot, EPuckRobotParams)
        shared = _shared(task_set, source, reward_weights)
        setup = EPuckSetup(
            **shared, webots=False, goal_visible=False, physics=engine_of(physics)
        )
        further = tuple(key for key in ("encoders",) if key in seen)
        EPuckEnv._prepare(self, setup, robot.sensor_noise, further, render_mode)
        self._look(task_set, bool(privileged))


def make(level: str | Path = "unknown", **options: Any) -> LadderEnv | EPuckLadderEnv:
    """The environment of a task set, as `gym.make("TDAC-Ladder-v0")` calls it.

    Args:
        level: Name of a task set, or path of a `set.yaml`.
        **options: Further arguments of `LadderEnv`.

    Raises:
        TaskError: There is no such set, or an argument is not valid.
    """
    return env_class(level)(level, **options)


# `gym.make` reads the render modes here, and so adds `"rgb_array_list"`.
make.metadata = LadderEnv.metadata  # type: ignore[attr-defined]


def env_class(level: str | Path) -> type[LadderEnv | EPuckLadderEnv]:
    """The class of the environments of a task set, which depends on its robot.

    Raises:
        TaskError: There is no such set, or it is not valid.
    """
    return EPuckLadderEnv if find_set_file(level).is_epuck else LadderEnv


def _opened(
    level: str | Path,
    split: str,
    train_pool: int,
    salt_file: str | Path | None,
    hidden_folder: str | Path | None,
    nearer_starts: float,
) -> tuple[TaskSet, SetSource]:
    """A set, and the source of its tasks."""
    salt = None if salt_file is None else read_salt(salt_file)
    task_set = load_set(level, None if hidden_folder is None else Path(hidden_folder))
    return task_set, SetSource(task_set, split, train_pool, salt, nearer_starts)


def _shared(
    task_set: TaskSet, source: SetSource, weights: Mapping[str, float] | None
) -> dict[str, Any]:
    """What the setups of both robots have; the nominal task is that of world 0."""
    file = task_set.file
    own = file.disturbances
    return {
        "nominal": source.task(0),
        "variation": "nominal",
        "fixed_horizon": True,
        "on_collision": "terminate",
        "motor_lag": own.motor_lag,
        "delay": own.delay,
        "disturbances": file.errors,
        "weights": weights_of(weights),
        "source": source,
    }
