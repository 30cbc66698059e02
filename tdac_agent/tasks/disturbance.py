"""Disturbances of a robust verification: sensor noise, wheel slip, lag and delay."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from tdac_envs.core.arguments import finite, whole_number
from tdac_envs.core.errors import TaskError

# With a longer delay, no action of an ordinary episode takes effect in time.
MAX_DELAY = 1000


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
    """

    range_noise: float = 0.025
    wheel_slip: float = 0.03
    motor_lag: float = 0.0
    delay: int = 1

    def __post_init__(self) -> None:
        _check_range("range noise", self.range_noise, 1.0)
        _check_range("wheel slip", self.wheel_slip, 1.0)
        _check_range("motor lag", self.motor_lag, 60.0)
        if whole_number("delay", self.delay, 0) > MAX_DELAY:
            raise TaskError(
                f"expected a delay of at most {MAX_DELAY} steps, got {self.delay}"
            )

    def env_options(self) -> dict[str, Any]:
        """Returns the additional arguments of `Map2DEnv`, with a jittered start."""
        return {"variation": "jitter", **asdict(self)}

    def __str__(self) -> str:
        parts = {
            f"range noise {100 * self.range_noise:g} %": self.range_noise,
            f"wheel slip {100 * self.wheel_slip:g} %": self.wheel_slip,
            f"motor lag {self.motor_lag:g} s": self.motor_lag,
            f"delay {self.delay} step{'' if self.delay == 1 else 's'}": self.delay,
        }
        return ", ".join(["jittered starts", *(p for p, size in parts.items() if size)])


def _check_range(name: str, value: float, most: float) -> None:
    if not 0.0 <= finite(name, value) <= most:
        raise TaskError(f"expected a {name} from 0 to {most:g}, got {value!r}")
