"""An environment that differs in one way from what its controller is told."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np
from gymnasium import Space
from numpy.typing import NDArray

from tdac_agent.tasks.deviation import Deviation
from tdac_agent.tasks.setting import JudgedEnv, Nominal
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.env import Observation
from tdac_envs.drive.gap_search import GapWatch
from tdac_envs.drive.stepping import AXLE

RANGES = "ranges"
"""Observation key of a robot that measures lengths."""


class DeviatedEnv:
    """A `JudgedEnv` with a deviation between the controller and the environment.

    Actions are delayed, then lag, slip, and are scaled for each wheel; the axle is the
    robot's own; pose and readings are changed before the controller sees them. Start
    and obstacles must have been shifted before.

    Args:
        plain: The environment.
        deviation: What differs.
        seed: Seed of the slip.
    """

    def __init__(self, plain: JudgedEnv, deviation: Deviation, seed: int) -> None:
        self.plain, self._own, self._seed = plain, deviation, seed
        self._random = np.random.default_rng(seed)
        self._late: deque[NDArray[np.float64]] = deque()
        self._speeds = np.zeros(2)
        half = 0.5 * deviation.wheels
        self._wheels = np.array([1.0 + half, 1.0 - half])
        lag = deviation.lag
        self._follow = 1.0 if not lag else -math.expm1(-plain.nominal.dt / lag)

    @property
    def observation_space(self) -> Space[Any]:
        """See `JudgedEnv`."""
        return self.plain.observation_space

    @property
    def action_space(self) -> Space[Any]:
        """See `JudgedEnv`."""
        return self.plain.action_space

    @property
    def readings(self) -> str:
        """See `JudgedEnv`."""
        return self.plain.readings

    @property
    def nominal(self) -> Nominal:
        """See `JudgedEnv`."""
        return self.plain.nominal

    @property
    def task(self) -> Nominal:
        """See `JudgedEnv`."""
        return self.plain.task

    @property
    def required_gap(self) -> float:
        """See `JudgedEnv`."""
        return self.plain.required_gap

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """See `JudgedEnv`.

        Raises:
            TaskError: The start is not feasible.
        """
        try:
            seen, info = self.plain.reset(seed=seed, options=options)
        except TaskError as error:
            why = str(error).rpartition(": ")[2]
            raise TaskError(f"no episode begins with this deviation: {why}") from None
        self._random = np.random.default_rng(self._seed)
        self._late = deque([np.zeros(2)] * self._own.delay)
        self._speeds = np.zeros(2)
        self._change_axle()
        return self._seen(seen), info

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """See `JudgedEnv`."""
        # Faster than `np.clip`, for each step of many episodes.
        inside = np.minimum(np.maximum(action, -1.0), 1.0)
        self._late.append(inside.astype(np.float64))
        self._speeds += self._follow * (self._late.popleft() - self._speeds)
        wheels = self._speeds * self._wheels
        if self._own.slip:
            wheels = wheels * self._random.normal(1.0, self._own.slip, 2)
        after = self.plain.step(wheels.astype(np.float32))
        seen, reward, terminated, truncated, info = after
        return self._seen(seen), reward, terminated, truncated, info

    def pose(self) -> NDArray[np.float64]:
        """See `JudgedEnv`."""
        return self.plain.pose()

    def discs(self) -> NDArray[np.float64]:
        """See `JudgedEnv`."""
        return self.plain.discs()

    def watch_gap(self) -> GapWatch:
        """See `JudgedEnv`."""
        return self.plain.watch_gap()

    def _change_axle(self) -> None:
        """Gives the robot another axle for this episode."""
        robot = getattr(self.plain, "robot", None)
        if robot is None:
            if self._own.axle:
                raise TaskError("this environment has no axle that could differ")
            return
        own: Any = self.plain
        # What an earlier episode left, unless the axle has just been drawn.
        if not own.disturbances.axle_error:
            robot.constants[AXLE] = own.task.axle_length
        robot.constants[AXLE] *= 1.0 + self._own.axle

    def _seen(self, seen: Observation) -> Observation:
        """An observation with the errors of pose and readings."""
        own, found = self._own, dict(seen)
        space: Any = self.observation_space
        if "pose" in found and (own.pose_x or own.pose_y or own.pose_heading):
            radius = self._radius()
            pose = found["pose"].astype(np.float64)
            pose += (own.pose_x * radius, own.pose_y * radius, own.pose_heading)
            pose[2] = math.remainder(pose[2], math.tau)
            found["pose"] = _within(pose, space["pose"])
        key = self.readings
        if own.range_scale or own.range_bias:
            bias = own.range_bias * self._radius() * (key == RANGES)
            readings = found[key] * (1.0 + own.range_scale) + bias
            # A ray without a return says so, whatever its scale.
            kept = (key == RANGES) & (found[key] >= space[key].high)
            found[key] = _within(np.where(kept, found[key], readings), space[key])
        return found

    def _radius(self) -> float:
        """The body radius in the units of the observations."""
        own: Any = getattr(self.plain, "set", None)
        scale = 1.0 if own is None else float(own.file.per_unit)
        return float(self.nominal.body_radius) * scale


def _within(values: NDArray[Any], box: Any) -> NDArray[np.float32]:
    """Values as an observation of a box."""
    inside: NDArray[np.float32] = np.clip(values, box.low, box.high).astype(np.float32)
    return inside


def plain_env(env: JudgedEnv) -> JudgedEnv:
    """The environment without a deviation, for what a policy must know of it."""
    return env.plain if isinstance(env, DeviatedEnv) else env
