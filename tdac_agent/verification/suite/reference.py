"""Driving of the privileged references: turns in place, straight drives, shortcuts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

from tdac_envs.drive.stepping import wrap_angle
from tdac_envs.grid.plan import Path

Point = tuple[float, float]

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


def taut(path: Path, is_free: Callable[[Point, Point], bool]) -> list[Point]:
    """Returns the corners of a path after all shortcuts.

    The search doubles and halves the number of skipped points, so a path of n points
    needs O(n log n) contact tests.

    Args:
        path: Shape (n, 2).
        is_free: Returns whether the body can drive straight between two points.
    """
    points = [(float(x), float(y)) for x, y in path]
    corners, at = points[:1], 0
    while at < len(points) - 1:
        reach = 1
        while at + 2 * reach < len(points) and is_free(
            points[at], points[at + 2 * reach]
        ):
            reach *= 2
        stride = reach
        while stride >= 1:
            beyond = at + reach + stride
            if beyond < len(points) and is_free(points[at], points[beyond]):
                reach += stride
            stride //= 2
        at += reach
        corners.append(points[at])
    return corners


def without_flat_points(points: Sequence[Point]) -> list[Point]:
    """Returns a polyline without the points at which it does not turn."""
    kept = list(points[:1])
    for here, after in pairwise(points[1:]):
        (x0, y0), (x1, y1), (x2, y2) = kept[-1], here, after
        ax, ay, bx, by = x1 - x0, y1 - y0, x2 - x1, y2 - y1
        if ax * by != ay * bx or ax * bx + ay * by <= 0.0:
            kept.append(here)
    return [*kept, *points[1:][-1:]]
