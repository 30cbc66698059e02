"""Speed of a robot's motors in one step, computed as in Webots."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(slots=True)
class MotorState:
    """State of a rotational motor.

    Attributes:
        limit: Maximum speed, rad/s.
        position: Target position, rad; infinite in velocity control.
        velocity: Target velocity, rad/s; in position control the maximum speed.
        acceleration: Maximum acceleration, rad/s²; -1 is unlimited.
        pid: Gains of the position controller.
        speed: Current speed, rad/s.
    """

    limit: float
    position: float = 0.0
    velocity: float = math.nan
    acceleration: float = -1.0
    pid: tuple[float, float, float] = (10.0, 0.0, 0.0)
    speed: float = 0.0
    _integral: float = 0.0
    _previous: float = 0.0

    def __post_init__(self) -> None:
        if math.isnan(self.velocity):
            self.velocity = self.limit

    def set_velocity(self, velocity: float) -> str | None:
        """Sets the target velocity; returns a warning if it exceeds the limit."""
        self.velocity = min(max(velocity, -self.limit), self.limit)
        if abs(velocity) <= self.limit:
            return None
        return (
            f"The requested velocity {velocity:g} exceeds 'maxVelocity' = "
            f"{self.limit:g}."
        )

    def set_position(self, position: float) -> None:
        """Sets the target position; infinite selects velocity control."""
        self.position = position
        self._integral = self._previous = 0.0

    def next_speed(self, angle: float, dt: float) -> float:
        """Computes the speed in the next step, rad/s.

        Args:
            angle: Current wheel angle, rad.
            dt: Duration of the step, s.
        """
        target = self._target_speed(angle, dt)
        if self.acceleration < 0.0:
            self.speed = target
        else:
            most = self.acceleration * dt
            self.speed += min(max(target - self.speed, -most), most)
        return self.speed

    def _target_speed(self, angle: float, dt: float) -> float:
        if math.isinf(self.position):
            # As in Webots, -inf selects velocity control, too.
            return self.velocity
        error = self.position - angle
        self._integral += error * dt
        change = (error - self._previous) / dt
        self._previous = error
        p, i, d = self.pid
        output = p * error + i * self._integral + d * change
        most = abs(self.velocity)
        return min(max(output, -most), most)
