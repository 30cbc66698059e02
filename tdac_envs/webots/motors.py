"""What the motors of a robot do in one step, as Webots computes it."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(slots=True)
class MotorState:
    """A rotational motor.

    Attributes:
        limit: Highest speed, rad/s.
        position: Wanted, rad; infinite in velocity control.
        velocity: Wanted; in position control the highest.
        acceleration: rad/s²; -1 is unlimited.
        pid: Gains of the control of the position.
        speed: Now, rad/s.
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
        """Sets the wanted velocity; the warning where it is beyond the limit."""
        self.velocity = min(max(velocity, -self.limit), self.limit)
        if abs(velocity) <= self.limit:
            return None
        return (
            f"The requested velocity {velocity:g} exceeds 'maxVelocity' = "
            f"{self.limit:g}."
        )

    def set_position(self, position: float) -> None:
        """Sets the wanted position; infinite is velocity control."""
        self.position = position
        self._integral = self._previous = 0.0

    def next_speed(self, angle: float, dt: float) -> float:
        """Speed in the next step, rad/s.

        Args:
            angle: Of the wheel now, rad.
            dt: Duration of the step, s.
        """
        wanted = self._wanted(angle, dt)
        if self.acceleration < 0.0:
            self.speed = wanted
        else:
            most = self.acceleration * dt
            self.speed += min(max(wanted - self.speed, -most), most)
        return self.speed

    def _wanted(self, angle: float, dt: float) -> float:
        if math.isinf(self.position):
            # -inf, too, is velocity control, as it is in Webots.
            return self.velocity
        error = self.position - angle
        self._integral += error * dt
        change = (error - self._previous) / dt
        self._previous = error
        p, i, d = self.pid
        output = p * error + i * self._integral + d * change
        most = abs(self.velocity)
        return min(max(output, -most), most)
