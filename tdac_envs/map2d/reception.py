"""What reaches a robot of its pose and its scan: errors of a localiser, late, or never.

The pose is that of a localiser, not the true one: its errors in x, y and heading are
three stationary Ornstein-Uhlenbeck processes with the time constant
`pose_correlation`, in their exact discretisation. Rare jumps draw all three errors
anew, three times as large; from there they decay with the same time constant.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.arguments import non_negative, number_up_to, whole_number
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.disturbances import Random
from tdac_envs.drive.stepping import wrap_angle

Array = NDArray[np.float64]

RECEIVED = (
    *("pose_noise", "heading_noise", "pose_correlation", "pose_jumps"),
    *("pose_delay", "scan_delay"),
)
"""The fields of `Reception` that a robot file gives, in their order."""
JUMP = 3.0
"""Size of the errors after a jump, relative to the usual ones."""
MOST_STEPS_LATE = 1000


@dataclass(frozen=True, slots=True)
class Reception:
    """How pose and scan reach a robot; 0 disables each.

    Attributes:
        pose_noise: Standard deviation of the errors in x and in y, px.
        heading_noise: Standard deviation of the error of the heading, rad.
        pose_correlation: Time constant of these errors, s; 0 for new ones in each step.
        pose_jumps: Mean number of jumps in a minute.
        pose_delay: Steps by which the pose is late.
        scan_delay: Steps by which the ranges are late.
        message_drop: Probability that the pose and the scan of a step are lost.

    Raises:
        TaskError: A value is out of range, or has no effect without a noise.
    """

    pose_noise: float = 0.0
    heading_noise: float = 0.0
    pose_correlation: float = 0.0
    pose_jumps: float = 0.0
    pose_delay: int = 0
    scan_delay: int = 0
    message_drop: float = 0.0

    def __post_init__(self) -> None:
        checked: dict[str, float] = {
            name: non_negative(name, getattr(self, name))
            for name in ("pose_noise", "pose_correlation", "pose_jumps")
        }
        for name, most in (("heading_noise", math.pi), ("message_drop", 1.0)):
            checked[name] = number_up_to(name, getattr(self, name), most)
        for name in ("pose_delay", "scan_delay"):
            checked[name] = whole_number(name, getattr(self, name), 0, MOST_STEPS_LATE)
        for name in ("pose_correlation", "pose_jumps"):
            if checked[name] and not self.has_errors:
                raise TaskError(f"{name} needs pose_noise or heading_noise")
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @property
    def has_errors(self) -> bool:
        """Whether the pose has errors."""
        return bool(self.pose_noise or self.heading_noise)

    @property
    def is_exact(self) -> bool:
        """Whether the robot observes pose and ranges as they are."""
        late = self.pose_delay or self.scan_delay or self.message_drop
        return not (self.has_errors or late)


EXACT = Reception()


class Receiver:
    """What one robot has received in an episode.

    Args:
        reception: How messages reach it.
        dt: Duration of a step, s.
        width: Width of the map, px.
        height: Height of the map, px; observed poses are on the map.

    Attributes:
        pose: Last pose received, shape (3,): x, y (px), heading (rad).
        ranges: Last scan received, shape (n_rays,).
    """

    pose: Array
    ranges: NDArray[np.float32]

    def __init__(
        self, reception: Reception, dt: float, width: int, height: int
    ) -> None:
        own = reception
        self._own = own
        self._sizes = np.array([own.pose_noise, own.pose_noise, own.heading_noise])
        late = own.pose_correlation
        self._kept = math.exp(-dt / late) if late else 0.0
        self._new = math.sqrt(1.0 - self._kept * self._kept)
        self._jump = -math.expm1(-own.pose_jumps * dt / 60.0)
        self._corner = np.array([width - 0.5, height - 0.5])
        self._errors = np.zeros(3)
        self._poses: deque[Array] = deque(maxlen=own.pose_delay + 1)
        self._scans: deque[NDArray[np.float32]] = deque(maxlen=own.scan_delay + 1)

    def receive(
        self, pose: Array, ranges: NDArray[np.float32], begins: bool, random: Random
    ) -> None:
        """Takes the pose and the scan of a step; overwrites `pose` and `ranges`.

        Args:
            pose: The true pose, shape (3,).
            ranges: The ranges as measured, shape (n_rays,).
            begins: Whether an episode begins.
            random: Random number generator of the environment.
        """
        seen = self._measured(pose, begins, random)
        if begins:
            self._poses.extend([seen] * (self._own.pose_delay + 1))
            self._scans.extend([ranges] * (self._own.scan_delay + 1))
        else:
            self._poses.append(seen)
            self._scans.append(ranges)
            drop = self._own.message_drop
            if drop and random.random() < drop:
                return
        self.pose, self.ranges = self._poses[0], self._scans[0]

    def _measured(self, pose: Array, begins: bool, random: Random) -> Array:
        """The pose of the localiser, on the map."""
        if not self._own.has_errors:
            return pose
        jumps = not begins and bool(self._jump) and random.random() < self._jump
        drawn = self._sizes * random.standard_normal(3)
        if begins:
            self._errors = drawn
        elif jumps:
            self._errors = JUMP * drawn
        else:
            self._errors = self._kept * self._errors + self._new * drawn
        seen = pose + self._errors
        np.clip(seen[:2], -0.5, self._corner, out=seen[:2])
        seen[2] = wrap_angle(seen[2])
        return seen
