"""How much of a path has a line of sight to the goal."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, read_only
from tdac_envs.map2d.rays import LeapGrid, in_sight

_SPACING = 1.0
"""Distance between the points of a path that are tested, px."""


def share_in_sight(
    leaps: LeapGrid, points: NDArray[np.float64], goal: tuple[float, float]
) -> float:
    """Share of a path's length from which no obstacle hides the goal, in [0, 1].

    Args:
        leaps: From `rays.leaps_of`.
        points: Shape (n, 2): the path, px.
        goal: Point (x, y), px.
    """
    return float(_share(leaps, read_only(points), float(goal[0]), float(goal[1])))


@kernel
def _share(
    leaps: LeapGrid, points: NDArray[np.float64], goal_x: float, goal_y: float
) -> float:
    """Tests the middle of each piece of at most `_SPACING`."""
    seen, whole = 0.0, 0.0
    for k in range(points.shape[0] - 1):
        x, y = points[k, 0], points[k, 1]
        dx, dy = points[k + 1, 0] - x, points[k + 1, 1] - y
        length = math.sqrt(dx * dx + dy * dy)
        pieces = max(math.ceil(length / _SPACING), 1)
        for piece in range(pieces):
            part = (piece + 0.5) / pieces
            if in_sight(leaps, x + part * dx, y + part * dy, goal_x, goal_y):
                seen += length / pieces
        whole += length
    return seen / whole if whole > 0.0 else 1.0
