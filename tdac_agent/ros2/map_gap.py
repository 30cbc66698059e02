"""The smallest gap between a body on its poses and the walls of the map."""

from __future__ import annotations

import math

import numpy as np

from tdac_agent.environments.map2d.setting import map_setting
from tdac_agent.tasks.task import Task
from tdac_envs.grid.map_units import MapUnits

REACH = 1.0
"""Farthest obstacle of which a gap is computed, m."""
Pose = tuple[float, float, float]


def map_gap(
    task: Task, poses: list[Pose]
) -> tuple[float | None, tuple[float, float] | None]:
    """The smallest distance of the body from an occupied pixel, and where, m.

    It is negative where the body overlaps one. None beyond `REACH`.
    """
    setting = map_setting(task.setting)
    cells, units = setting.nominal.terrain.grid.cells, MapUnits.metres(setting.params)
    scale, radius = units.per_pixel, setting.nominal.robot.radius
    reach = math.ceil(REACH / scale)
    # Outside the map, all is occupied.
    padded = np.pad(cells, reach + 1, constant_values=True)
    best, place = math.inf, None
    for x, y, _ in poses:
        i, j = units.pixels((x, y))
        if not (0 <= i < cells.shape[1] and 0 <= j < cells.shape[0]):
            return -radius * scale, (round(x, 4), round(y, 4))
        column, row = round(i), round(j)
        window = padded[
            row + 1 : row + 2 * reach + 2, column + 1 : column + 2 * reach + 2
        ]
        rows, columns = np.nonzero(window)
        if not rows.size:
            continue
        # Distance to the square of each occupied pixel.
        right = np.maximum(np.abs(columns - reach + column - i) - 0.5, 0.0)
        down = np.maximum(np.abs(rows - reach + row - j) - 0.5, 0.0)
        away = float(np.hypot(right, down).min()) - radius
        if away < best:
            best, place = away, (round(x, 4), round(y, 4))
    return (None, None) if place is None else (best * scale, place)
