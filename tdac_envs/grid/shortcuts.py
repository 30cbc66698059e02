"""Shortens a path by every straight shortcut that a body can take."""

from __future__ import annotations

from collections.abc import Callable

from tdac_envs.grid.plan import Path

Point = tuple[float, float]


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
