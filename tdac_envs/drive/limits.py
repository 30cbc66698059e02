"""Limits of a robot's motion: acceleration of a wheel, speed and turn of the body."""

from __future__ import annotations

from dataclasses import dataclass

from tdac_envs.core.arguments import non_negative, positive
from tdac_envs.drive.stepping import UNLIMITED


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Limits beside the full speed of a wheel.

    Attributes:
        max_acceleration: Of a wheel, px/s² or m/s²; 0 for no limit.
        max_speed: Of the body, px/s or m/s; None for no limit.
        max_turn_rate: Of the body, rad/s; None for no limit.
        max_turn_acceleration: Of the body's turn, rad/s²; None for no limit.

    Raises:
        TaskError: A value is out of range.
    """

    max_acceleration: float = 0.0
    max_speed: float | None = None
    max_turn_rate: float | None = None
    max_turn_acceleration: float | None = None

    def __post_init__(self) -> None:
        most = non_negative("max_acceleration", self.max_acceleration)
        object.__setattr__(self, "max_acceleration", most)
        for name in ("max_speed", "max_turn_rate", "max_turn_acceleration"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, positive(name, value))

    def fractions(
        self, full_speed: float, axle_length: float, dt: float
    ) -> tuple[float, float, float, float]:
        """The limits as the compiled step reads them.

        Args:
            full_speed: Full speed of a wheel.
            axle_length: Axle length without error.
            dt: Duration of a step, s.

        Returns:
            Largest change of a wheel's fraction in a step; largest sum and largest
            difference of both fractions; largest change of this difference in a step.
        """
        change, both, apart, turn = UNLIMITED
        if self.max_acceleration:
            change = min(change, self.max_acceleration * dt / full_speed)
        if self.max_speed is not None:
            both = min(both, 2.0 * self.max_speed / full_speed)
        if self.max_turn_rate is not None:
            apart = min(apart, self.max_turn_rate * axle_length / full_speed)
        if self.max_turn_acceleration is not None:
            most = self.max_turn_acceleration * dt * axle_length / full_speed
            turn = min(turn, most)
        return change, both, apart, turn
