"""A privileged planner in space and time: the earliest arrival among movers.

It knows where all movers will be, as if there were no robot, and moves between the
nodes of a lattice, or waits. Turns take no time. A world is admitted if it arrives; its
time is a reference for results.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, read_only, subkernel
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.map2d.encounters import foresee
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.movers.destinations import Destinations
from tdac_envs.movers.state import RADIUS, SPEED, Movers

Array = NDArray[np.float64]
Layers = NDArray[np.uint8]
Node = tuple[int, int]
"""Column and row of a node."""


class Arrival(NamedTuple):
    """The earliest arrival at the goal.

    Attributes:
        steps: Time of the arrival, steps.
        path: Shape (n, 3): time (steps), x, y (px) of each node.
    """

    steps: int
    path: Array


def earliest_arrival(task: Map2DTask) -> Arrival | None:
    """The earliest arrival that is found within the horizon; None if there is none.

    Args:
        task: The task with its movers, which are only read.
    """
    movers = Movers.none() if task.movers is None else task.movers
    places = foreseen(task, task.horizon)
    for steps in (2, 1):
        found = _plan(task, movers, places, steps)
        if found is not None:
            return found
    return None


def foreseen(task: Map2DTask, steps: int) -> Array:
    """Where the movers of a task will be, as if there were no robot.

    Returns:
        Shape (steps + 1, n, 2): x, y in each step, px.
    """
    movers = Movers.none() if task.movers is None else task.movers.fresh()
    places = np.empty((steps + 1, len(movers.traits), 2))
    # Arrays of a task that was pickled can be written to.
    kept = {key: read_only(getattr(movers, key)) for key in Destinations._fields}
    terrain, own = task.terrain, movers._replace(**kept)
    foresee(terrain.padded_clear, terrain.leaps, *own, task.dt, places)
    return places


def _plan(task: Map2DTask, movers: Movers, places: Array, steps: int) -> Arrival | None:
    """The earliest arrival with layers that are `steps` steps apart."""
    spacing = int(math.sqrt(0.5) * task.full_step * steps)
    if spacing < 1:
        return None
    radius, layers = task.robot.radius, places[::steps]
    free = task.terrain.clear[::spacing, ::spacing] >= radius
    begin = _near(free, spacing, task.start[:2], 2.0 * spacing)
    within = max(task.goal_tolerance, 2.0 * spacing)
    goal = _near(free, spacing, task.goal, within)
    if begin is None or goal is None:
        return None
    # A mover is always within half of its way between two layers of one of its places;
    # so is every point of an edge of the lattice, of one of its nodes.
    half = 0.5 * steps * np.array([task.full_step, task.dt])
    reach = radius + movers.traits[:, RADIUS] + half[1] * movers.traits[:, SPEED]
    reach = np.hypot(reach, half[0])
    reached = np.zeros((len(layers), *free.shape), np.uint8)
    last = _spread(
        read_only(free), read_only(layers), reach, spacing, begin, goal, reached
    )
    if last < 0:
        return None
    nodes = np.empty((last + 1, 2), np.int64)
    _trace(reached, goal, last, nodes)
    times = steps * np.arange(last + 1)
    return Arrival(last * steps, np.column_stack([times, spacing * nodes]))


def _near(
    free: BoolGrid, spacing: int, point: tuple[float, float], within: float
) -> Node | None:
    """The free node nearest to a point; None if it is farther away than `within` px."""
    rows, columns = np.nonzero(free)
    far = np.hypot(spacing * columns - point[0], spacing * rows - point[1])
    if not far.size or far.min() > within:
        return None
    nearest = int(far.argmin())
    return int(columns[nearest]), int(rows[nearest])


@kernel
def _spread(
    free: BoolGrid,
    layers: Array,
    reach: Array,
    spacing: int,
    begin: Node,
    goal: Node,
    reached: Layers,
) -> int:
    """Marks the nodes that can be reached in each layer; returns that of the goal.

    Args:
        free: Nodes where the body fits, shape (rows, columns).
        layers: Shape (layers, n, 2): places of the movers, px.
        reach: Shape (n,): distance that is kept from each mover, px.
        spacing: Distance of the nodes, px.
        begin: Node (column, row) at the start.
        goal: Node at the goal.
        reached: Shape (layers, rows, columns), all 0; overwritten.
    """
    rows, columns = free.shape
    open_now, open_next = free.copy(), free.copy()
    _close(layers[0], reach, spacing, open_now)
    if not open_now[begin[1], begin[0]]:
        return -1
    reached[0, begin[1], begin[0]] = 1
    for layer in range(1, layers.shape[0]):
        open_next[:] = free
        _close(layers[layer], reach, spacing, open_next)
        some = False
        for j in range(rows):
            for i in range(columns):
                if not open_next[j, i] or not open_now[j, i]:
                    continue
                found = False
                for b in range(max(j - 1, 0), min(j + 2, rows)):
                    for a in range(max(i - 1, 0), min(i + 2, columns)):
                        # Whoever leaves a node is not driven over there, either.
                        if reached[layer - 1, b, a] and open_next[b, a]:
                            # No corner is cut.
                            found = found or (free[b, i] and free[j, a])
                if found:
                    reached[layer, j, i] = 1
                    if i == goal[0] and j == goal[1]:
                        return layer
                    some = True
        if not some:
            return -1
        open_now[:] = open_next
    return -1


@subkernel
def _close(places: Array, reach: Array, spacing: int, free: BoolGrid) -> None:
    """Closes the nodes that are in reach of movers."""
    rows, columns = free.shape
    for m in range(places.shape[0]):
        x, y, far = places[m, 0], places[m, 1], reach[m]
        for j in range(
            max(math.ceil((y - far) / spacing), 0),
            min(math.floor((y + far) / spacing), rows - 1) + 1,
        ):
            for i in range(
                max(math.ceil((x - far) / spacing), 0),
                min(math.floor((x + far) / spacing), columns - 1) + 1,
            ):
                off_x, off_y = i * spacing - x, j * spacing - y
                if off_x * off_x + off_y * off_y < far * far:
                    free[j, i] = False


@kernel
def _trace(reached: Layers, goal: Node, last: int, nodes: NDArray[np.int64]) -> None:
    """Writes the node (column, row) of each layer, back from the goal."""
    rows, columns = reached.shape[1], reached.shape[2]
    i, j = goal
    nodes[last, 0], nodes[last, 1] = i, j
    for back in range(last):
        layer, found = last - 1 - back, False
        # Straight steps and pauses before oblique ones.
        for far in range(3):
            for b in range(max(j - 1, 0), min(j + 2, rows)):
                for a in range(max(i - 1, 0), min(i + 2, columns)):
                    if (
                        not found
                        and abs(a - i) + abs(b - j) == far
                        and reached[layer, b, a]
                    ):
                        nodes[layer, 0], nodes[layer, 1] = a, b
                        found = True
        i, j = nodes[layer, 0], nodes[layer, 1]
