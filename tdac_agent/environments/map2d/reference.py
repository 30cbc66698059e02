"""The privileged reference for maps: the oracle's path on the exact grid.

It shows that a task and its suite can be passed, so it may use information that
controllers lack. It shares no code with `builtin`.
"""

from __future__ import annotations

import math

import numpy as np

from tdac_agent.tasks.units import Point
from tdac_agent.verification.suite.reference import without_flat_points
from tdac_envs.grid.grid import BoolGrid, body_free
from tdac_envs.grid.plan import Path, descend, distance_field
from tdac_envs.map2d.straight import is_line_free
from tdac_envs.map2d.task import Map2DTask

# Clearances beyond the body that are tried for the path, px, widest first. With the
# last but one, float32 actions cannot touch a corner that a path with 0 would graze.
MARGINS = (4.0, 2.0, 1.0, 0.5, 0.05, 0.0)
# Clearance of a shortcut beyond the body in privileged controllers, px: much larger
# than the rounding errors of float32.
_SAFE_IN_FLOAT32 = 0.02


def oracle_path(task: Map2DTask, x: float, y: float) -> Path:
    """Returns the path from (x, y) to the goal with the widest possible margin.

    Returns:
        Shape (n, 2), px, both ends included; only the ends if there is no path.
    """
    ends = np.array([[x, y], task.goal])
    for margin in MARGINS:
        free = _roomy(task, (x, y), margin)
        around = _near(*task.goal, free.shape)
        last = next(((i, j) for i, j in around if free[j, i]), None)
        if last is None:
            continue
        field = distance_field(free, last)
        # The nearest pixel on a path to the goal that the body can drive to.
        for i, j in _near(x, y, field.shape):
            if np.isfinite(field[j, i]) and _free(task, (x, y), (i, j)):
                return np.vstack([ends[:1], descend(free, field, (i, j)), ends[1:]])
    return ends


def reference_path(task: Map2DTask, x: float, y: float) -> list[Point]:
    """Returns the oracle's path to the goal after shortcuts; both ends included."""
    return without_flat_points(task.pulled(oracle_path(task, x, y), _SAFE_IN_FLOAT32))


def _free(task: Map2DTask, begin: Point, end: Point) -> bool:
    """Whether the body can drive straight between two points."""
    return is_line_free(task.terrain.padded_clear, begin, end, task.robot.radius)


def _roomy(task: Map2DTask, start: Point, margin: float) -> BoolGrid:
    """Returns pixels with room for the body and `margin` px; less near both ends."""
    clear, radius = task.terrain.clear, task.robot.radius
    free = body_free(clear, radius + margin)
    if margin == 0.0:
        return free
    reach = math.ceil(radius + margin) + 2
    for x, y in (start, task.goal):
        column, row = math.floor(x + 0.5), math.floor(y + 0.5)
        window = np.s_[
            max(row - reach, 0) : row + reach + 1,
            max(column - reach, 0) : column + reach + 1,
        ]
        free[window] = body_free(clear[window], radius + min(margin, 0.05))
    return free


def _near(x: float, y: float, shape: tuple[int, ...]) -> list[tuple[int, int]]:
    """Returns the pixels (i, j) around a point, up to 3 px away, nearest first."""
    column, row = math.floor(x + 0.5), math.floor(y + 0.5)
    pixels = [
        (i, j)
        for j in range(max(row - 3, 0), min(row + 4, shape[0]))
        for i in range(max(column - 3, 0), min(column + 4, shape[1]))
    ]
    return sorted(pixels, key=lambda pixel: math.dist(pixel, (x, y)))
