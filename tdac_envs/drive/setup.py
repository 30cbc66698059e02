"""Configuration of an environment that both robots share; the tasks of its episodes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.arguments import (
    check_reset_options,
    non_negative,
    one_of,
    whole_number,
)
from tdac_envs.drive.disturbances import Disturbances, Random
from tdac_envs.drive.rewards import RewardWeights
from tdac_envs.drive.smallest_gap import required_gap
from tdac_envs.drive.stepping import UNDISTURBED, UNLIMITED
from tdac_envs.drive.task import (
    VARIATIONS,
    default_horizon,
    mixed_start,
    random_task,
)


class TaskSource(Protocol):
    """Where the tasks of episodes come from, if not from one nominal task."""

    def draw(self, options: dict[str, Any], random: Random) -> tuple[Any, Random]:
        """The task of an episode, and the random numbers of its disturbances.

        Args:
            options: Options of `reset`.
            random: Random number generator of the environment.

        Raises:
            TaskError: An option is unknown or not valid.
        """


@dataclass(frozen=True, slots=True, eq=False)
class DriveSetup:
    """The part of an environment that does not change between episodes.

    Attributes:
        nominal: The task without variation.
        variation: `"nominal"`, `"jitter"`, `"mixed"` or `"random"`.
        fixed_horizon: Whether the user set the horizon; else it follows from the task.
        on_collision: `"terminate"` or `"block"`.
        motor_lag: Time constant of the wheel speeds, s.
        delay: Number of steps until an action takes effect.
        disturbances: Slip, hidden errors, odometry.
        weights: Weights of the reward.
        source: Where the tasks come from; None for variations of the nominal task.

    Raises:
        TaskError: A value is not valid.
    """

    nominal: Any
    variation: str
    fixed_horizon: bool
    on_collision: str
    motor_lag: float
    delay: int
    disturbances: Disturbances
    weights: RewardWeights
    source: TaskSource | None

    def __post_init__(self) -> None:
        one_of("variation", self.variation, VARIATIONS)
        one_of("on_collision", self.on_collision, ("terminate", "block"))
        lag = non_negative("motor_lag", self.motor_lag)
        object.__setattr__(self, "motor_lag", lag)
        object.__setattr__(self, "delay", whole_number("delay", self.delay, 0))

    @property
    def varies(self) -> bool:
        """Whether the task may differ from episode to episode."""
        return self.variation != "nominal" or self.source is not None

    def required_gap(self, task: Any) -> float:
        """The gap to obstacles that the robot should keep in a task, px or m."""
        return required_gap(task.body_radius)

    def gap_in_episode(self, task: Any) -> float:
        """`required_gap` of an episode: other starts on one map have the same one.

        Args:
            task: The task of the episode.
        """
        return self.required_gap(self.nominal if self.source is None else task)

    def constants(self) -> NDArray[np.float64]:
        """The constants of a robot on the nominal task, as in `stepping`."""
        raise NotImplementedError

    def shared_constants(
        self,
        speed: float,
        reach: float,
        friction: float,
        limits: Sequence[float] = UNLIMITED,
    ) -> Any:
        """The entries of `constants` that all robots have, of the nominal task.

        Args:
            speed: Full speed of a wheel.
            reach: Largest range of the distance sensors.
            friction: Coefficient of friction between body and obstacles.
            limits: From `MotionLimits.fractions`.
        """
        task = self.nominal
        return [
            task.axle_length,
            speed,
            task.dt,
            task.body_radius,
            reach,
            math.exp(-task.dt / self.motor_lag) if self.motor_lag else 0.0,
            self.delay,
            self.on_collision == "terminate",
            task.full_step,
            *self.weights,
            *task.goal,
            task.goal_tolerance,
            task.horizon,
            friction,
            *UNDISTURBED,
            *limits,
        ]

    def draw(self, options: dict[str, Any], random: Random) -> tuple[Any, Random]:
        """The task of an episode, and the random numbers of its disturbances.

        Args:
            options: Options of `reset`: `start` and `goal`, which override the
                variation, or those of the source.
            random: Random number generator of the environment.

        Raises:
            TaskError: An option is unknown, or the start or goal is not feasible.
        """
        if self.source is not None:
            return self.source.draw(options, random)
        check_reset_options(options)
        return self._varied(options, random), random

    def _varied(self, options: dict[str, Any], random: Random) -> Any:
        task = self.nominal
        if options:
            drawn = task.with_ends(**options)
        elif self.variation == "random":
            drawn = random_task(task, random)
        elif self.variation == "mixed":
            return task.moved(mixed_start(task, random))
        elif self.variation == "jitter":
            return task.moved(task.jittered(random))
        else:
            return task
        if self.fixed_horizon or drawn.goal == task.goal:
            return drawn
        horizon = default_horizon(drawn.shortest, drawn.full_step)
        return replace(drawn, horizon=horizon)
