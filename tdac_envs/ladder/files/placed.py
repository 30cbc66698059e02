"""From a world in a file to a world of a task set, with its figures."""

from __future__ import annotations

import math

import numpy as np

from tdac_envs.core.compiled import read_only
from tdac_envs.core.errors import TaskError
from tdac_envs.grid.grid import body_free, clearance
from tdac_envs.grid.plan import distance_field
from tdac_envs.ladder.admission import Conditions, measured
from tdac_envs.ladder.files.file_world import FileWorld
from tdac_envs.ladder.passages import bottleneck
from tdac_envs.ladder.random_stream import rounded
from tdac_envs.ladder.worlds import LadderWorld


def placed_world(
    found: FileWorld, radius: float, step: float, tolerance: float, dt: float
) -> LadderWorld:
    """A feasible world of a file with the figures of its difficulty.

    Args:
        found: The world.
        radius: Radius of the body, px.
        step: Distance of one step at full speed, px.
        tolerance: Distance at which the goal is reached, px.
        dt: Duration of a step, s.

    Raises:
        TaskError: The task takes no time: L is within the tolerance.
    """
    cells, (start, goal) = found.cells, (found.start, found.goal)
    clear = clearance(cells)
    gap = rounded(bottleneck(cells, clear, start, goal) / radius)
    field = distance_field(body_free(clear, radius), goal)
    padded = read_only(np.pad(clear, 1))
    sizes = Conditions(radius, step, tolerance, 0.0, 0.0, 0.0)
    ready = measured(read_only(cells), padded, start, goal, field, gap, sizes)
    if ready.difficulty.steps <= 0.0:
        raise TaskError(f"{found.file}: the start is within the tolerance of the goal")
    seconds = found.barn_seconds
    steps = None if seconds is None else seconds / dt
    heading = math.remainder(found.heading, math.tau)
    return LadderWorld.of(ready, heading, barn_steps=steps)
