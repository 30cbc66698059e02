"""Compiled code of `tdac_envs.learning.seen_map`: ways on a robot's own map.

Lengths are in cells, as in `tdac_envs.learning.seen_kernels`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.learning.seen_kernels import MARGIN, WALL, Array, Costs, inside

MOST_AHEAD = 128
"""Points of a route that are kept."""
_EVERY = 12
"""Steps after which a new route is found."""
_FOUND, _AT, _SINCE = 0, 1, 2
"""Parts of `routed`: number of points, the nearest one, step at which it was found."""
_DX = np.array([1, -1, 0, 0, 1, 1, -1, -1])
_DY = np.array([0, 0, 1, -1, 1, -1, 1, -1])
_BACK = np.array([1, 0, 3, 2, 7, 6, 5, 4])
_STRAIGHT, _DIAGONAL = 5, 7
_CELL_BITS, _REST_BITS = 20, 13
MOST_SIDE = 1 << _CELL_BITS // 2
"""Largest width and height of a map, cells."""


@kernel
def look_along(
    rows: NDArray[np.int64],
    poses: Array,
    goals: Array,
    reaches: Array,
    steps: Array,
    costs: Costs,
    routes: NDArray[np.int32],
    routed: NDArray[np.int32],
    found: Array,
) -> None:
    """Points ahead on the cheapest way to the goal, through what is unknown, too.

    Args:
        rows: Robots.
        poses: Shape (n, 3).
        goals: Shape (n, 2).
        reaches: Shape (k,), rising: distances of the points along the way.
        steps: Shape (n,): steps of each episode so far.
        costs: See `add_scans`.
        routes: Shape (n, MOST_AHEAD, 2): the way that was found last.
        routed: Shape (n, 3); see `_FOUND`. 0 at the beginning of an episode.
        found: Shape (n, k, 2), overwritten: the points.
    """
    side = costs.shape[1]
    spent = np.zeros(side * side, np.int32)
    ways = np.zeros(side * side, np.int8)
    heap = np.zeros(1 << 12, np.int64)
    for i in rows:
        x, y = inside(poses[i, 0], side), inside(poses[i, 1], side)
        goal_x, goal_y = inside(goals[i, 0], side), inside(goals[i, 1], side)
        late = steps[i] - routed[i, _SINCE] >= _EVERY
        if late or not _lasts(routes[i], routed[i], costs[i]):
            spent[:] = 0
            start = int(y + 0.5) * side + int(x + 0.5)
            end = int(goal_y + 0.5) * side + int(goal_x + 0.5)
            heap = _search(start, end, costs[i], spent, ways, heap)
            routed[i, _FOUND] = _kept(start, end, side, ways, routes[i])
            routed[i, _AT] = 0
            routed[i, _SINCE] = steps[i]
        _nearest(x, y, routes[i], routed[i])
        _points(routes[i], routed[i], reaches, goal_x, goal_y, found[i])


@subkernel
def _lasts(route: NDArray[np.int32], routed: NDArray[np.int32], costs: Costs) -> bool:
    """Whether there is a way, without a wall that was seen since."""
    if routed[_FOUND] == 0:
        return False
    for k in range(routed[_AT], routed[_FOUND]):
        if costs[route[k, 1], route[k, 0]] == WALL:
            return False
    return True


@subkernel
def _search(
    start: int,
    end: int,
    costs: Costs,
    spent: NDArray[np.int32],
    ways: NDArray[np.int8],
    heap: NDArray[np.int64],
) -> Any:
    """A* from the goal to the robot, so that `ways` lead to the goal.

    Args:
        start: Index of the robot's cell.
        end: Index of the goal's cell.
        costs: Cost of a step into a cell.
        spent: Zeros, overwritten: cost from the goal, plus 1.
        ways: Overwritten: the direction in which the goal is.
        heap: Room for the queue.

    Returns:
        The queue's room, which may have grown.
    """
    side = costs.shape[0]
    to_x, to_y = start % side, start // side
    spent[end] = 1
    heap[0], count = np.int64(end), 1
    while count > 0:
        cell = int(heap[0] & ((1 << _CELL_BITS) - 1))
        rank = int(heap[0] >> _CELL_BITS)
        count = _pop(heap, count)
        if cell == start:
            break
        x, y = cell % side, cell // side
        gone = int(spent[cell]) - 1
        if rank > _rank(gone, _least(x, y, to_x, to_y)):
            continue  # It was found on a cheaper way later.
        for k in range(8):
            at_x, at_y = x + _DX[k], y + _DY[k]
            if at_x < MARGIN or at_y < MARGIN:
                continue
            if at_x >= side - MARGIN or at_y >= side - MARGIN:
                continue
            length = _STRAIGHT if k < 4 else _DIAGONAL
            there = at_y * side + at_x
            cost = gone + length * int(costs[at_y, at_x])
            if spent[there] != 0 and spent[there] - 1 <= cost:
                continue
            spent[there] = cost + 1
            ways[there] = _BACK[k]
            if count == len(heap):
                larger = np.zeros(2 * len(heap), np.int64)
                larger[:count] = heap
                heap = larger
            rank_there = _rank(cost, _least(at_x, at_y, to_x, to_y))
            count = _push(heap, count, (rank_there << _CELL_BITS) | there)
    return heap


@subkernel
def _least(x: int, y: int, to_x: int, to_y: int) -> int:
    """The least cost between two cells."""
    dx, dy = abs(x - to_x), abs(y - to_y)
    return _STRAIGHT * max(dx, dy) + (_DIAGONAL - _STRAIGHT) * min(dx, dy)


@subkernel
def _rank(cost: int, rest: int) -> Any:
    """When a cell's turn is: of equal sums, the one nearer to the end comes first."""
    return (np.int64(cost + rest) << _REST_BITS) | min(rest, (1 << _REST_BITS) - 1)


@subkernel
def _push(heap: NDArray[np.int64], count: int, key: int) -> int:
    at = count
    while at > 0:
        above = (at - 1) // 2
        if heap[above] <= key:
            break
        heap[at] = heap[above]
        at = above
    heap[at] = key
    return count + 1


@subkernel
def _pop(heap: NDArray[np.int64], count: int) -> int:
    count -= 1
    key, at = heap[count], 0
    while True:
        below = 2 * at + 1
        if below >= count:
            break
        if below + 1 < count and heap[below + 1] < heap[below]:
            below += 1
        if heap[below] >= key:
            break
        heap[at] = heap[below]
        at = below
    heap[at] = key
    return count


@subkernel
def _kept(
    start: int,
    end: int,
    side: int,
    ways: NDArray[np.int8],
    route: NDArray[np.int32],
) -> int:
    """Stores the first points of a way; returns how many."""
    cell, count = start, 0
    while count < len(route):
        route[count, 0], route[count, 1] = cell % side, cell // side
        count += 1
        if cell == end:
            break
        way = ways[cell]
        cell += _DX[way] + _DY[way] * side
    return count


@subkernel
def _nearest(
    x: float, y: float, route: NDArray[np.int32], routed: NDArray[np.int32]
) -> None:
    """Moves on to the nearest of the next points of the way."""
    best, at = np.inf, routed[_AT]
    for k in range(routed[_AT], min(routed[_AT] + 8, routed[_FOUND])):
        far = (route[k, 0] - x) ** 2 + (route[k, 1] - y) ** 2
        if far < best:
            best, at = far, k
    routed[_AT] = at


@subkernel
def _points(
    route: NDArray[np.int32],
    routed: NDArray[np.int32],
    reaches: Array,
    goal_x: float,
    goal_y: float,
    found: Array,
) -> None:
    """The points of a way at some distances along it; the goal behind its end."""
    which, far = 0, 0.0
    for k in range(routed[_AT] + 1, routed[_FOUND]):
        dx, dy = route[k, 0] - route[k - 1, 0], route[k, 1] - route[k - 1, 1]
        far += math.sqrt(float(dx * dx + dy * dy))
        while which < len(reaches) and far >= reaches[which]:
            found[which, 0], found[which, 1] = route[k, 0], route[k, 1]
            which += 1
        if which == len(reaches):
            return
    ends = routed[_FOUND] < len(route)
    last = routed[_FOUND] - 1
    while which < len(reaches):
        found[which, 0] = goal_x if ends else float(route[last, 0])
        found[which, 1] = goal_y if ends else float(route[last, 1])
        which += 1
