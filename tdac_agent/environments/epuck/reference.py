"""The privileged reference for the e-puck: the oracle's path in the exact world.

The counterpart for maps is `tdac_agent.environments.map2d.reference`.
"""

from __future__ import annotations

import math

import numpy as np

from tdac_agent.tasks.units import Point
from tdac_agent.verification.suite.reference import without_flat_points
from tdac_envs.epuck.contact import first_touch
from tdac_envs.epuck.paths import open_field, path_entry
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.grid.plan import Path, descend, distance_field
from tdac_envs.grid.shortcuts import taut
from tdac_envs.worlds.bodies import BODY_RADIUS

# Clearances beyond the body that are tried for the path, m, widest first.
MARGINS = (0.02, 0.01, 0.005, 0.002, 0.0005, 0.0)
# Clearance of a shortcut beyond the body, m; exceeds the rounding errors of float32.
_SAFE = 1e-4


def oracle_path(task: EPuckTask, x: float, y: float) -> Path:
    """Returns the path from (x, y) to the goal with the widest possible margin.

    Returns:
        Shape (n, 2), m, both ends included; only the ends if there is no path.
    """
    ground = task.ground
    ends = np.array([[x, y], task.goal])
    for margin in MARGINS:
        free = _roomy(task, (x, y), margin)
        last = path_entry(ground, open_field(free), task.goal)
        if last is None:
            continue
        field = distance_field(free, last)
        first = path_entry(ground, field.astype(np.float32), (x, y))
        if first is not None:
            path = descend(free, field, first) * ground.spacing + ground.bounds[:2]
            return np.vstack([ends[:1], path, ends[1:]])
    return ends


def reference_path(task: EPuckTask, x: float, y: float) -> list[Point]:
    """Returns the oracle's path to the goal after shortcuts; both ends included."""
    path = oracle_path(task, x, y)
    return without_flat_points(taut(path, lambda a, b: _free(task, a, b)))


def _free(task: EPuckTask, begin: Point, end: Point) -> bool:
    """Whether the body, slightly grown, can drive straight between two points."""
    solid = task.ground.solid
    heading = math.atan2(end[1] - begin[1], end[0] - begin[0])
    pose, length = (float(begin[0]), float(begin[1]), heading), math.dist(begin, end)
    touch = first_touch(*solid.arrays(), *pose, length, 0.0, BODY_RADIUS + _SAFE)
    return touch > 1.0


def _roomy(task: EPuckTask, start: Point, margin: float) -> BoolGrid:
    """Returns grid points with room for the body and a margin; less near both ends."""
    ground = task.ground
    free = ground.free(BODY_RADIUS + margin).copy()
    tight = ground.free(BODY_RADIUS + min(margin, MARGINS[-2]))
    reach = math.ceil((BODY_RADIUS + margin) / ground.spacing) + 2
    left, low, _, _ = ground.bounds
    for x, y in (start, task.goal):
        column = round((x - left) / ground.spacing)
        row = round((y - low) / ground.spacing)
        window = np.s_[
            max(row - reach, 0) : row + reach + 1,
            max(column - reach, 0) : column + reach + 1,
        ]
        free[window] = tight[window]
    return free
