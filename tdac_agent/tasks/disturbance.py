"""Disturbances of a robust verification: noise, slip, hidden errors, lag and delay."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, NamedTuple

from tdac_envs.core.arguments import LARGEST, finite, whole_number
from tdac_envs.core.errors import TaskError, hint
from tdac_envs.drive.disturbances import MOST_HIDDEN
from tdac_envs.map2d.reception import MOST_STEPS_LATE, Reception

# With a longer delay, no action of an ordinary episode takes effect in time.
MAX_DELAY = 1000


class Part(NamedTuple):
    """A part of a disturbance.

    Attributes:
        words: What it is, in words.
        most: Its largest size.
        text: Format of its size in reports; `{}` stands for a number of steps.
        percent: Whether its size is shown in per cent.
        everywhere: Whether each environment has it; else only maps, but see `OF_ALL`.
    """

    words: str
    most: float
    text: str
    percent: bool = False
    everywhere: bool = False


PARTS = {
    "range_noise": Part("range noise", 1.0, "range noise {:g} %", True, True),
    "range_dropout": Part("range dropout", 1.0, "range dropout {:g} %", True),
    "wheel_slip": Part("wheel slip", 1.0, "wheel slip {:g} %", True, True),
    "wheel_gains": Part(
        "bound of the wheel gains", MOST_HIDDEN, "wheel gains ±{:g} %", True
    ),
    "axle_error": Part(
        "bound of the axle error", MOST_HIDDEN, "axle error ±{:g} %", True
    ),
    "motor_lag": Part("motor lag", 60.0, "motor lag {:g} s", everywhere=True),
    "delay": Part("delay", MAX_DELAY, "delay {}", everywhere=True),
    "wheel_radius_error": Part(
        "bound of the wheel radius error", MOST_HIDDEN, "wheel radii ±{:g} %", True
    ),
    "pose_noise": Part("pose noise", LARGEST, "pose noise {:g}"),
    "heading_noise": Part("heading noise", 3.1, "heading noise {:g} rad"),
    "pose_correlation": Part("pose correlation", 3600.0, "correlated over {:g} s"),
    "pose_jumps": Part("rate of pose jumps", 6000.0, "{:g} pose jumps a minute"),
    "pose_delay": Part("pose delay", MOST_STEPS_LATE, "pose {} late"),
    "scan_delay": Part("scan delay", MOST_STEPS_LATE, "scan {} late"),
    "message_drop": Part("message drop", 1.0, "{:g} % of messages lost", True),
}
"""All parts by their names, in the order in which reports list them."""
STEPS = "delay", "pose_delay", "scan_delay"
"""Parts that are numbers of steps."""
OF_ALL = "wheel_gains", "axle_error", "wheel_radius_error"
"""Parts of both robots which other environments may not have."""
LENGTHS = ("pose_noise",)
"""Parts that are lengths, in the units of the task."""


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
        wheel_radius_error: Bound of the hidden relative error of each wheel's radius.
        pose_noise: Standard deviation of the observed x and y, in units of the task;
            this and what follows only on maps.
        heading_noise: Standard deviation of the observed heading, rad.
        pose_correlation: Time constant of both errors, s.
        pose_jumps: Jumps of the observed pose in a minute.
        pose_delay: Steps by which the pose is late.
        scan_delay: Steps by which the ranges are late.
        message_drop: Probability that pose and scan of a step are lost.
    """

    range_noise: float = 0.025
    wheel_slip: float = 0.03
    motor_lag: float = 0.0
    delay: int = 1
    wheel_gains: float = 0.0
    axle_error: float = 0.0
    range_dropout: float = 0.0
    wheel_radius_error: float = 0.0
    pose_noise: float = 0.0
    heading_noise: float = 0.0
    pose_correlation: float = 0.0
    pose_jumps: float = 0.0
    pose_delay: int = 0
    scan_delay: int = 0
    message_drop: float = 0.0

    def __post_init__(self) -> None:
        for name, part in PARTS.items():
            _check(name, part, getattr(self, name))
        Reception(
            self.pose_noise, self.heading_noise, self.pose_correlation, self.pose_jumps
        )

    @classmethod
    def none(cls) -> Disturbance:
        """Returns a disturbance whose parts are all 0."""
        return cls(range_noise=0.0, wheel_slip=0.0, delay=0)

    def changed(self, sizes: Mapping[str, Any]) -> Disturbance:
        """Returns the same with other sizes of some parts.

        Raises:
            TaskError: There is no such part, or a size is out of range.
        """
        known = [each.name for each in fields(self)]
        for name in sizes:
            if name not in known:
                raise TaskError(
                    f"unknown disturbance {name!r}{hint(str(name), known)}; known: "
                    f"{', '.join(known)}"
                )
        return Disturbance(**{**asdict(self), **sizes})

    def env_options(self) -> dict[str, Any]:
        """Returns the additional arguments of `Map2DEnv`, with a jittered start.

        Those that not every environment has are included only if they are not 0.
        """
        given = {
            name: size
            for name, size in asdict(self).items()
            if size or PARTS[name].everywhere
        }
        return {"variation": "jitter", **given}

    def __str__(self) -> str:
        return ", ".join(["jittered starts", *self._texts()])

    def _texts(self) -> list[str]:
        texts = []
        for name, part in PARTS.items():
            size = getattr(self, name)
            if not size:
                continue
            steps = f"{size} step{'' if size == 1 else 's'}"
            shown = 100 * size if part.percent else size
            texts.append(part.text.format(steps if name in STEPS else shown))
        return texts


def _check(name: str, part: Part, size: Any) -> None:
    words, most = part.words, part.most
    if name in STEPS:
        if whole_number(words, size, 0) > most:
            raise TaskError(f"expected a {words} of at most {most:g} steps, got {size}")
    elif not 0.0 <= finite(words, size) <= most:
        raise TaskError(f"expected a {words} from 0 to {most:g}, got {size!r}")
