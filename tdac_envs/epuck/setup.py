"""Configuration of a TDAC-EPuck-v0 environment, and the tasks of its episodes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.arguments import check_reset_options, finite_numbers
from tdac_envs.drive.disturbances import Disturbances
from tdac_envs.drive.rewards import RewardWeights
from tdac_envs.drive.stepping import UNDISTURBED
from tdac_envs.epuck.infrared import RANGE
from tdac_envs.epuck.kernels import AXLE_LENGTH
from tdac_envs.epuck.nearby import NearbyParts
from tdac_envs.epuck.prisms import Prisms
from tdac_envs.epuck.task import (
    EPuckTask,
    default_horizon,
    jittered_start,
    make_task,
    mixed_start,
    random_task,
)
from tdac_envs.worlds.bodies import BODY_RADIUS


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """The part of an environment that does not change between episodes.

    Attributes:
        nominal: The task without variation.
        around: The parts that the robot may touch and see, depending on its position.
        variation: `"nominal"`, `"jitter"`, `"mixed"` or `"random"`.
        fixed_horizon: Whether the user set the horizon; else it follows from the task.
        on_collision: `"terminate"` or `"block"`.
        motor_lag: Time constant of the wheel speeds, s.
        delay: Number of steps until an action takes effect.
        disturbances: Slip, hidden errors, odometry.
        weights: Weights of the reward.
    """

    nominal: EPuckTask
    around: NearbyParts
    variation: str
    fixed_horizon: bool
    on_collision: str
    motor_lag: float
    delay: int
    disturbances: Disturbances
    weights: RewardWeights

    @property
    def pushes(self) -> bool:
        """Whether the robot can push objects."""
        return self.on_collision == "block" and len(self.nominal.ground.masses) > 0

    def constants(self) -> NDArray[np.float64]:
        """`Robot.constants` of the nominal task."""
        task = self.nominal
        ground = task.ground
        return np.array(
            [
                AXLE_LENGTH,
                task.max_wheel_speed,
                task.dt,
                BODY_RADIUS,
                RANGE,
                math.exp(-task.dt / self.motor_lag) if self.motor_lag else 0.0,
                self.delay,
                self.on_collision == "terminate",
                task.full_step,
                *self.weights,
                *task.goal,
                task.goal_tolerance,
                task.horizon,
                ground.world.friction,
                *UNDISTURBED,
                ground.floor,
                *ground.bounds[:2],
                ground.spacing,
                self.around.width,
            ],
            np.float64,
        )

    def world(
        self,
        task: EPuckTask,
        solid: Prisms | None = None,
        seen: Prisms | None = None,
    ) -> tuple[NDArray[Any], ...]:
        """The arrays that the kernels take in addition to the robot's.

        Args:
            task: Task of the episode.
            solid: Solid parts, if objects can be pushed; by default the ground's own.
            seen: Visible parts, if objects can be pushed; by default `around.visible`.
        """
        solid = task.ground.solid if solid is None else solid
        seen = self.around.visible if seen is None else seen
        near, sighted = self.around.solid, self.around.seen
        return (
            solid.points, solid.first, solid.extent, near.cells, near.listed,
            seen.points, seen.first, seen.extent, sighted.cells, sighted.listed,
            task.field,
        )  # fmt: skip

    def draw(self, options: dict[str, Any], random: np.random.Generator) -> EPuckTask:
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
            start = tuple(options.get("start", task.start))
            drawn = make_task(
                task.ground,
                finite_numbers("start", (*start, task.start.heading)[:3], 3),
                options.get("goal", task.goal),
                max_wheel_speed=task.max_wheel_speed,
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
        return replace(drawn, horizon=default_horizon(drawn))
