"""Frames and wheels: poses of a map, and commands within the limits of a robot."""

from __future__ import annotations

import math
from typing import Any


def yaw_of(x: float, y: float, z: float, w: float) -> float:
    """Yaw of a quaternion, in (-pi, pi]."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def compose(
    first: tuple[float, float, float], second: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Pose of C in A, from the pose of B in A and the pose of C in B."""
    x, y, yaw = first
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return (
        x + cosine * second[0] - sine * second[1],
        y + sine * second[0] + cosine * second[1],
        wrapped(yaw + second[2]))


def stamp_of(whole: float, localised: float, tolerance: float) -> float:
    """
    Stamp of a pose whose localiser stamps ahead of its data, as AMCL does.

    Args:
        whole: Stamp of the pose in the map, as tf gives it.
        localised: Stamp of the odometry's frame in the map.
        tolerance: How far the localiser stamps ahead.
    """
    return min(whole, localised - tolerance)


def inverse(pose: tuple[float, float, float]) -> tuple[float, float, float]:
    """Pose of A in B, from the pose of B in A."""
    x, y, yaw = pose
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return -cosine * x - sine * y, sine * x - cosine * y, -yaw


def wrapped(angle: float) -> float:
    """Angle in (-pi, pi]."""
    return math.pi - (math.pi - angle) % math.tau


class Wheels:
    """Fractions of the full wheel speed, within the robot's limits, as in the verification."""

    def __init__(self, robot: dict[str, Any], dt: float) -> None:
        full, axle = float(robot['max_wheel_speed']), float(robot['axle_length'])
        self.full, self.axle = full, axle
        self.last = (0.0, 0.0)

        def share(name: str, scale: float, most: float) -> float:
            return min(robot[name] * scale / full, most) if robot.get(name) else most

        self._change = share('max_acceleration', dt, 2.0)
        self._sum = share('max_speed', 2.0, 2.0)
        self._apart = share('max_turn_rate', axle, 2.0)
        self._turn = share('max_turn_acceleration', dt * axle, 4.0)

    def limited(self, left: float, right: float) -> tuple[float, float]:
        """Next fractions: clipped, on the same curve within the limits, and ramped."""
        left, right = min(max(left, -1.0), 1.0), min(max(right, -1.0), 1.0)
        both, apart = abs(left + right), abs(left - right)
        if both > self._sum or apart > self._apart:
            part = min(self._sum / max(both, self._sum), self._apart / max(apart, self._apart))
            left, right = part * left, part * right
        before_left, before_right = self.last
        left = min(max(left, before_left - self._change), before_left + self._change)
        right = min(max(right, before_right - self._change), before_right + self._change)
        turn = left - right - (before_left - before_right)
        if abs(turn) > self._turn:
            beyond = 0.5 * (turn - math.copysign(self._turn, turn))
            left, right = left - beyond, right + beyond
        self.last = left, right
        return self.last

    def twist(self, left: float, right: float) -> tuple[float, float]:
        """Speed (m/s) and turn rate (rad/s) of wheel fractions."""
        return 0.5 * (left + right) * self.full, (right - left) * self.full / self.axle

    def fractions(self, v: float, omega: float) -> tuple[float, float]:
        """Inverse of `twist`."""
        half = 0.5 * omega * self.axle
        return (v - half) / self.full, (v + half) / self.full
