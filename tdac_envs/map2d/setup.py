"""Configuration of a TDAC-Map2D-v0 environment, and the tasks of its episodes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from tdac_envs.core.arguments import check_reset_options, positive, whole_number
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.disturbances import Disturbances
from tdac_envs.drive.rewards import RewardWeights
from tdac_envs.map2d.rays import fan
from tdac_envs.map2d.robot import constants_of
from tdac_envs.map2d.task import (
    Map2DTask,
    default_horizon,
    jittered_start,
    make_task,
    mixed_start,
    random_task,
)
from tdac_envs.mapping.params import RobotParams


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """The part of an environment that does not change between episodes.

    Attributes:
        nominal: The task without variation.
        variation: `"nominal"`, `"jitter"`, `"mixed"` or `"random"`.
        fixed_horizon: Whether the user set the horizon; else it follows from the task.
        on_collision: `"terminate"` or `"block"`.
        range_noise: Relative standard deviation of each range.
        range_dropout: Probability that a ray reads the largest range.
        motor_lag: Time constant of the wheel speeds, s.
        delay: Number of steps until an action takes effect.
        disturbances: Slip, hidden errors, odometry.
        weights: Weights of the reward.
        directions: Directions of the rays, from `rays.fan`.
    """

    nominal: Map2DTask
    variation: str
    fixed_horizon: bool
    on_collision: str
    range_noise: float
    range_dropout: float
    motor_lag: float
    delay: int
    disturbances: Disturbances
    weights: RewardWeights
    directions: NDArray[np.float64] = field(init=False)

    def __post_init__(self) -> None:
        robot = self.nominal.robot
        view = np.radians(robot.field_of_view_deg)
        object.__setattr__(self, "directions", fan(float(view), robot.n_rays))

    @property
    def has_inexact_ranges(self) -> bool:
        """Whether ranges have noise or dropouts."""
        return bool(self.range_noise or self.range_dropout)

    def constants(self) -> NDArray[np.float64]:
        """`Robot.constants` of the nominal task."""
        return constants_of(
            self.nominal,
            self.weights,
            motor_lag=self.motor_lag,
            delay=self.delay,
            stops=self.on_collision == "terminate",
        )

    def world(self, task: Map2DTask) -> tuple[NDArray[Any], ...]:
        """The arrays that `begin` and `drive` take in addition to the robot's."""
        terrain = task.terrain
        return terrain.leaps, terrain.padded_clear, task.field, self.directions

    def draw(self, options: dict[str, Any], random: np.random.Generator) -> Map2DTask:
        """The task of an episode.

        Args:
            options: Options of `reset`: `start` and `goal`, which override the
                variation.
            random: Random number generator of the variation.

        Raises:
            TaskError: An option is unknown, or the start or goal is not feasible.
        """
        check_reset_options(options)
        task = self.nominal
        if options:
            start = (*options.get("start", task.start), task.start.heading)[:3]
            drawn = make_task(
                task.terrain,
                start,
                options.get("goal", task.goal),
                task.robot,
                dt=task.dt,
                goal_tolerance=task.goal_tolerance,
                horizon=task.horizon,
            )
        elif self.variation == "random":
            drawn = random_task(task, random)
        elif self.variation == "mixed":
            return task.moved(mixed_start(task, random))
        elif self.variation == "jitter":
            return task.moved(jittered_start(task, random))
        else:
            return task
        if self.fixed_horizon or drawn.goal == task.goal:
            return drawn
        steps = default_horizon(drawn.shortest, drawn.robot, drawn.dt)
        return replace(drawn, horizon=steps)


def override(robot: RobotParams, **given: float | None) -> RobotParams:
    """The robot with the options that are not None.

    Raises:
        TaskError: An option is not valid.
    """
    changes: dict[str, float] = {}
    for name, value in given.items():
        if value is None:
            continue
        if name == "n_rays":
            changes[name] = whole_number(name, value, 1)
        else:
            key = "field_of_view_deg" if name == "field_of_view" else name
            changes[key] = positive(name, value)
    try:
        return RobotParams.model_validate({**robot.model_dump(), **changes})
    except ValidationError as error:
        first = error.errors()[0]
        name = str(first["loc"][0]).removesuffix("_deg")
        raise TaskError(f"{name} {first['input']!r}: {first['msg']}") from None
