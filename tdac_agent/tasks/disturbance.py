"""Disturbances of a robust verification: noise, slip, hidden errors, lag and delay."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from tdac_envs.core.arguments import finite, whole_number
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.disturbances import MOST_HIDDEN

# With a longer delay, no action of an ordinary episode takes effect in time.
MAX_DELAY = 1000
_NOT_EVERYWHERE = ("wheel_gains", "axle_error", "range_dropout")


@dataclass(frozen=True, slots=True)
class Disturbance:
    """Noise and delays of a robot, in addition to a jittered start; 0 disables each.

    The defaults follow published models of small robots.

    Attributes:
        range_noise: Relative standard deviation of each range; for an e-puck, the mean
            over all distances. Webots' table for the e-puck has 0.2 to 4.9 %, 2.4 % on
            average.
        wheel_slip: Relative standard deviation of each wheel's speed in each step.
            Enki draws it uniformly within ±5 % for the e-puck and Khepera, which is a
            standard deviation of 2.9 %.
        motor_lag: Time constant of the wheel speeds, s. The default is 0 because the
            e-puck has stepper motors.
        delay: Number of steps until an action takes effect. The default is 1: sensing,
            computing and sending take one step on a robot that reads, then acts.
        wheel_gains: Bound of the hidden relative error of each wheel's speed, which is
            constant during an episode.
        axle_error: Bound of the hidden relative error of the axle length, constant too.
        range_dropout: Probability that a ray reads its maximum range in a step; only
            on maps.
    """

    range_noise: float = 0.025
    wheel_slip: float = 0.03
    motor_lag: float = 0.0
    delay: int = 1
    wheel_gains: float = 0.0
    axle_error: float = 0.0
    range_dropout: float = 0.0

    def __post_init__(self) -> None:
        _check_range("range noise", self.range_noise, 1.0)
        _check_range("wheel slip", self.wheel_slip, 1.0)
        _check_range("motor lag", self.motor_lag, 60.0)
        _check_range("bound of the wheel gains", self.wheel_gains, MOST_HIDDEN)
        _check_range("bound of the axle error", self.axle_error, MOST_HIDDEN)
        _check_range("range dropout", self.range_dropout, 1.0)
        if whole_number("delay", self.delay, 0) > MAX_DELAY:
            raise TaskError(
                f"expected a delay of at most {MAX_DELAY} steps, got {self.delay}"
            )

    def env_options(self) -> dict[str, Any]:
        """Returns the additional arguments of `Map2DEnv`, with a jittered start.

        Those that not every environment has are included only if they are not 0.
        """
        given = {
            name: size
            for name, size in asdict(self).items()
            if size or name not in _NOT_EVERYWHERE
        }
        return {"variation": "jitter", **given}

    def __str__(self) -> str:
        parts = {
            f"range noise {100 * self.range_noise:g} %": self.range_noise,
            f"range dropout {100 * self.range_dropout:g} %": self.range_dropout,
            f"wheel slip {100 * self.wheel_slip:g} %": self.wheel_slip,
            f"wheel gains ±{100 * self.wheel_gains:g} %": self.wheel_gains,
            f"axle error ±{100 * self.axle_error:g} %": self.axle_error,
            f"motor lag {self.motor_lag:g} s": self.motor_lag,
            f"delay {self.delay} step{'' if self.delay == 1 else 's'}": self.delay,
        }
        return ", ".join(["jittered starts", *(p for p, size in parts.items() if size)])


def _check_range(name: str, value: float, most: float) -> None:
    if not 0.0 <= finite(name, value) <= most:
        raise TaskError(f"expected a {name} from 0 to {most:g}, got {value!r}")
