"""Seeded disturbances of both robots: slip, hidden errors of a robot, odometry.

All numbers are drawn from the environment's own generator, in this order and only if
their option is not 0. At a reset, after the start and goal: wheel gains (left, right),
axle error, wheel radii (left, right), odometry scales (distance, turn). In each step:
slip (left, right), noise of the distance sensors, dropouts of the rays, odometry noise
(distance, turn). The first observation of an episode has sensor noise, and dropouts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from tdac_envs.core.arguments import non_negative, number_up_to
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.stepping import (
    AXLE,
    DISTANCE_SCALE,
    FORWARD,
    GAIN_LEFT,
    GAIN_RIGHT,
    SLIP_LEFT,
    SLIP_RIGHT,
    STEPS,
    TURN,
    TURN_SCALE,
    WHEEL_LEFT,
    WHEEL_RIGHT,
)

Array = NDArray[np.float64]
Observed = NDArray[np.float32]
Random = np.random.Generator

MOST_HIDDEN = 0.9
"""Largest bound of hidden errors: wheels and axle stay positive."""
_MOST_DEVIATIONS = 10.0
# Parts of the arrays of a robot.
_ARC, _SCALES = slice(FORWARD, TURN + 1), slice(DISTANCE_SCALE, TURN_SCALE + 1)
_GAINS, _SLIPS = slice(GAIN_LEFT, GAIN_RIGHT + 1), slice(SLIP_LEFT, SLIP_RIGHT + 1)
_WHEELS = slice(WHEEL_LEFT, WHEEL_RIGHT + 1)


@dataclass(frozen=True, slots=True)
class Disturbances:
    """The disturbances that both robots have; 0 disables each.

    Attributes:
        wheel_slip: Relative standard deviation of each wheel's speed over ground.
        wheel_gains: Bound b of the wheels' hidden gains, uniform in [1 - b, 1 + b].
        axle_error: Bound of the hidden relative error of the axle length, uniform.
        odometry: Whether the odometry is observed.
        odometry_scale: Standard deviation of its two scale errors in an episode.
        odometry_noise: Relative standard deviation of each measurement.
        wheel_radius_error: Bound of each wheel's hidden relative error of its radius,
            uniform; of robots that observe the angles of their wheels.

    Raises:
        TaskError: A value is out of range, or has no effect without `odometry`.
    """

    wheel_slip: float = 0.0
    wheel_gains: float = 0.0
    axle_error: float = 0.0
    odometry: bool = False
    odometry_scale: float = 0.0
    odometry_noise: float = 0.0
    wheel_radius_error: float = 0.0

    def __post_init__(self) -> None:
        limits = {
            "wheel_gains": MOST_HIDDEN,
            "axle_error": MOST_HIDDEN,
            "wheel_radius_error": MOST_HIDDEN,
            "odometry_scale": 1.0,
            "odometry_noise": 1.0,
        }
        checked: dict[str, Any] = {
            name: number_up_to(name, getattr(self, name), most)
            for name, most in limits.items()
        }
        checked["wheel_slip"] = non_negative("wheel_slip", self.wheel_slip)
        checked["odometry"] = bool(self.odometry)
        for name in ("odometry_scale", "odometry_noise"):
            if checked[name] and not self.odometry:
                raise TaskError(f"{name} needs odometry=True")
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @property
    def hidden(self) -> bool:
        """Whether an episode has hidden errors, which are drawn at its reset."""
        own = self.wheel_gains, self.axle_error, self.wheel_radius_error
        return any((*own, self.odometry_scale))

    def hide(self, constants: Array, axle_length: float, random: Random) -> None:
        """Draws the hidden errors of an episode.

        Args:
            constants: The robot's constants; gains, axle length, wheel radii and
                odometry scales are overwritten.
            axle_length: Axle length without error.
            random: Random number generator of the environment.
        """
        if self.wheel_gains:
            bounds = 1.0 - self.wheel_gains, 1.0 + self.wheel_gains
            constants[_GAINS] = random.uniform(*bounds, 2)
        if self.axle_error:
            error = random.uniform(-self.axle_error, self.axle_error)
            constants[AXLE] = axle_length * (1.0 + error)
        if self.wheel_radius_error:
            most = self.wheel_radius_error
            constants[_WHEELS] = random.uniform(1.0 - most, 1.0 + most, 2)
        if self.odometry_scale:
            constants[_SCALES] = random.normal(1.0, self.odometry_scale, 2)

    def slip(self, state: Array, random: Random) -> None:
        """Draws the slip of both wheels in the next step and stores it in `state`."""
        state[_SLIPS] = random.normal(1.0, self.wheel_slip, 2)

    def noise(self, state: Array, random: Random) -> Array | float:
        """The factors of the noise of a measurement, shape (2,), or 1.0 if none."""
        if self.odometry_noise and state[STEPS]:
            return random.normal(1.0, self.odometry_noise, 2)
        return 1.0

    def odometry_limits(self, full_step: float, axle_length: float) -> Array:
        """Largest measured distance and turn, shape (2,); far beyond usual noise.

        Args:
            full_step: Distance driven in a step at full speed.
            axle_length: Axle length without error.
        """
        turn = 2.0 * full_step / (axle_length * (1.0 - self.axle_error))
        scale = 1.0 + _MOST_DEVIATIONS * self.odometry_scale
        noise = 1.0 + _MOST_DEVIATIONS * self.odometry_noise
        return np.array([full_step, turn]) * scale * noise


def measured(
    state: Array, constants: Array, noise: Array | float, limits: Array
) -> Observed:
    """The odometry of one robot, shape (2,), or of many, shape (n, 2).

    Args:
        state: The `state` of a robot, or of many.
        constants: Their `constants`.
        noise: Factors of the noise, shape (2,) or (n, 2), or 1.0.
        limits: Of `odometry_limits`, shape (2,) or (n, 2).
    """
    seen = state[..., _ARC] * constants[..., _SCALES] * noise
    return np.clip(seen, -limits, limits).astype(np.float32)


def with_odometry(space: spaces.Dict, limits: Array) -> spaces.Dict:
    """An observation space with the odometry of these limits, shape (2,), added."""
    most = limits.astype(np.float32)
    # A new `Dict` sorts its keys, as that of a batch does.
    return spaces.Dict({**space.spaces, "odometry": spaces.Box(-most, most)})


class BatchDisturbances:
    """The disturbances of the robots of a batch, which may differ.

    Each method takes `random`, a function that returns the generator of robot i.

    Args:
        setups: The robots' setups, which all observe the odometry or none.

    Attributes:
        slippery: Indices of the robots whose wheels slip.
        hidden: Whether any robot has hidden errors.
        odometry: Whether the odometry is observed.
    """

    def __init__(self, setups: Sequence[Any]) -> None:
        self._own: list[Disturbances] = [setup.disturbances for setup in setups]
        tasks = [setup.nominal for setup in setups]
        self.slippery = [i for i, own in enumerate(self._own) if own.wheel_slip]
        self.hidden = any(own.hidden for own in self._own)
        self.odometry = self._own[0].odometry
        self._limits = np.array(
            [
                own.odometry_limits(task.full_step, task.axle_length)
                for own, task in zip(self._own, tasks, strict=True)
            ]
        )
        # Robots that are not reset keep their last measurement.
        self._last = np.zeros((len(setups), 2), np.float32)

    def slip(
        self, over: NDArray[np.bool_], state: Array, random: Callable[[int], Random]
    ) -> None:
        """Draws the slip of the robots whose episodes are not over."""
        for i in self.slippery:
            if not over[i]:
                self._own[i].slip(state[i], random(i))

    def hide(
        self,
        robots: Sequence[int],
        tasks: Sequence[Any],
        constants: Array,
        random: Callable[[int], Random],
    ) -> None:
        """Draws the hidden errors of the next episodes of these robots.

        Args:
            robots: Indices of the robots.
            tasks: The tasks of all robots.
            constants: The constants of all robots.
            random: See the class.
        """
        for i in robots:
            self._own[i].hide(constants[i], tasks[i].axle_length, random(i))

    def measure(
        self, robots: Sequence[int], batch: Any, random: Callable[[int], Random]
    ) -> Observed:
        """The odometry of all robots, measured anew for these ones, shape (n, 2).

        Args:
            robots: Indices of the robots.
            batch: The arrays of all robots.
            random: See the class.
        """
        rows, noise = np.array(robots, np.int64), np.ones((len(robots), 2))
        for i, factors in zip(robots, noise, strict=True):
            factors[:] = self._own[i].noise(batch.state[i], random(i))
        self._last[rows] = measured(
            batch.state[rows], batch.constants[rows], noise, self._limits[rows]
        )
        return self._last.copy()
