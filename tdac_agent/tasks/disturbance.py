"""What a robust verification disturbs, and how much."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from tdac_envs.core.arguments import finite, whole_number
from tdac_envs.core.errors import TaskError

# Later than this, no action of an ordinary episode takes effect in time to matter.
MAX_DELAY = 1000


@dataclass(frozen=True, slots=True)
class Disturbance:
    """Noise and lateness of a robot, beside a jittered start; zeros for none.

    The defaults are of the size that published models of small robots have.

    Attributes:
        range_noise: Standard deviation of each range, relative to it. The table of the
            e-puck's sensors in Webots has 0.2 to 4.9 %, on average 2.4 %; of an
            e-puck it is that average.
        wheel_slip: Standard deviation of each wheel's speed in each step, relative to
            it. Enki's e-puck and Khepera draw it within 5 % either way: 2.9 %.
        motor_lag: Time constant of the wheel speeds, s. The robot has none: its wheels
            are stepped.
        delay: Steps by which an action takes effect late. One: sensing, computing and
            sending take a step, as on any robot that reads, then acts.
    """

    range_noise: float = 0.025
    wheel_slip: float = 0.03
    motor_lag: float = 0.0
    delay: int = 1

    def __post_init__(self) -> None:
        _within("range noise", self.range_noise, 1.0)
        _within("wheel slip", self.wheel_slip, 1.0)
        _within("motor lag", self.motor_lag, 60.0)
        if whole_number("delay", self.delay, 0) > MAX_DELAY:
            raise TaskError(
                f"expected a delay of at most {MAX_DELAY} steps, got {self.delay}"
            )

    def env_options(self) -> dict[str, Any]:
        """Arguments of `Map2DEnv` beside the task's own; the start is jittered, too."""
        return {"variation": "jitter", **asdict(self)}

    def __str__(self) -> str:
        parts = {
            f"range noise {100 * self.range_noise:g} %": self.range_noise,
            f"wheel slip {100 * self.wheel_slip:g} %": self.wheel_slip,
            f"motor lag {self.motor_lag:g} s": self.motor_lag,
            f"delay {self.delay} step{'' if self.delay == 1 else 's'}": self.delay,
        }
        return ", ".join(["jittered starts", *(p for p, size in parts.items() if size)])


def _within(name: str, value: float, most: float) -> None:
    if not 0.0 <= finite(name, value) <= most:
        raise TaskError(f"expected a {name} from 0 to {most:g}, got {value!r}")
