"""Driving of the privileged references: turns in place and straight drives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from tdac_agent.tasks.units import Point
from tdac_envs.drive.stepping import wrap_angle

_ALIGNED = 1e-6  # rad


def steer(
    pose: tuple[float, float, float], point: Point, step: float, axle: float
) -> tuple[float, float]:
    """Returns wheel fractions (left, right): a turn in place or a straight drive.

    Args:
        pose: x, y and heading, rad; y points down, headings are clockwise.
        point: Target (x, y).
        step: Distance driven in one step at full speed.
        axle: Distance between the wheels.
    """
    dx, dy = point[0] - pose[0], point[1] - pose[1]
    error = float(wrap_angle(float(math.atan2(dy, dx) - pose[2])))
    if abs(error) > _ALIGNED:
        wheel = min(max(error * axle / (2.0 * step), -1.0), 1.0)
        return wheel, -wheel
    forward = min(math.hypot(dx, dy) / step, 1.0)
    return forward, forward


def without_flat_points(points: Sequence[Point]) -> list[Point]:
    """Returns a polyline without the points at which it does not turn."""
    kept = list(points[:1])
    for here, after in pairwise(points[1:]):
        (x0, y0), (x1, y1), (x2, y2) = kept[-1], here, after
        ax, ay, bx, by = x1 - x0, y1 - y0, x2 - x1, y2 - y1
        if ax * by != ay * bx or ax * bx + ay * by <= 0.0:
            kept.append(here)
    return [*kept, *points[1:][-1:]]
