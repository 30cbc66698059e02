"""Shortest paths on a grid: 8-connected, octile cost, no corner cutting."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tdac_envs.grid import BoolGrid

Path = NDArray[np.float64]
Field = NDArray[np.float64]

_DX = np.array([1, -1, 0, 0, 1, 1, -1, -1])
_DY = np.array([0, 0, 1, -1, 1, -1, 1, -1])
_SQRT2 = 2.0**0.5


@njit(cache=True, nogil=True)
def _push(bucket: NDArray[np.int64], count: int, cell: int) -> NDArray[np.int64]:
    if count == bucket.size:
        grown = np.empty(2 * bucket.size, np.int64)
        grown[:count] = bucket
        bucket = grown
    bucket[count] = cell
    return bucket


@njit(cache=True, nogil=True)
def _spread(free: BoolGrid, goal_x: int, goal_y: int, stop: int) -> Field:
    """Dijkstra in buckets of width 1.

    No step is shorter than 1, so a bucket never receives a cell while it is
    worked off, and three buckets in rotation suffice.
    """
    height, width = free.shape
    distance = np.full(height * width, np.inf)
    settled = np.zeros(height * width, np.bool_)
    one = np.empty(256, np.int64)
    two, three = np.empty(256, np.int64), np.empty(256, np.int64)
    n_one, n_two, n_three = 1, 0, 0
    one[0] = goal_y * width + goal_x
    distance[one[0]] = 0.0
    level = 0
    while n_one + n_two + n_three > 0:
        for index in range(n_one):
            cell = one[index]
            if settled[cell]:
                continue
            settled[cell] = True
            y, x = cell // width, cell % width
            for k in range(8):
                nx, ny = x + _DX[k], y + _DY[k]
                if nx < 0 or ny < 0 or nx >= width or ny >= height:
                    continue
                if not free[ny, nx]:
                    continue
                if k >= 4 and not (free[y, nx] and free[ny, x]):
                    continue
                candidate = distance[cell] + (1.0 if k < 4 else _SQRT2)
                neighbour = ny * width + nx
                if candidate < distance[neighbour] - 1e-12:
                    distance[neighbour] = candidate
                    if int(candidate) == level + 1:
                        two = _push(two, n_two, neighbour)
                        n_two += 1
                    else:
                        three = _push(three, n_three, neighbour)
                        n_three += 1
        if stop >= 0 and settled[stop]:
            break
        one, two, three = two, three, one
        n_one, n_two, n_three = n_two, n_three, 0
        level += 1
    return distance.reshape(height, width)


def distance_field(
    free: BoolGrid, goal: tuple[int, int], until: tuple[int, int] | None = None
) -> Field:
    """Length of the shortest path from every free pixel to the goal, in px.

    Args:
        free: Shape (height, width), bool, True where the path may go.
        goal: Pixel (x, y).
        until: Stop as soon as this pixel is settled; pixels farther away keep inf.

    Returns:
        Shape (height, width), float64; inf where the goal cannot be reached.
    """
    height, width = free.shape
    if not (0 <= goal[0] < width and 0 <= goal[1] < height) or not free[goal[::-1]]:
        return np.full(free.shape, np.inf)
    stop = -1 if until is None else until[1] * width + until[0]
    field: Field = _spread(np.ascontiguousarray(free), goal[0], goal[1], stop)
    return field


@njit(cache=True, nogil=True)
def _descend(
    free: BoolGrid, field: Field, start_x: int, start_y: int
) -> NDArray[np.int64]:
    height, width = field.shape
    path = np.empty((int(field[start_y, start_x]) + 2, 2), np.int64)
    x, y, count = start_x, start_y, 0
    while True:
        path[count, 0], path[count, 1] = x, y
        count += 1
        if field[y, x] == 0.0:
            return path[:count]
        best, best_x, best_y = np.inf, x, y
        for k in range(8):
            nx, ny = x + _DX[k], y + _DY[k]
            if nx < 0 or ny < 0 or nx >= width or ny >= height:
                continue
            if not free[ny, nx]:
                continue
            if k >= 4 and not (free[y, nx] and free[ny, x]):
                continue
            through = field[ny, nx] + (1.0 if k < 4 else _SQRT2)
            if through < best - 1e-9:
                best, best_x, best_y = through, nx, ny
        x, y = best_x, best_y


def descend(free: BoolGrid, field: Field, start: tuple[int, int]) -> Path:
    """The shortest path from `start` down a `distance_field`.

    Returns:
        Shape (n, 2), float64, columns x and y, start and goal included; empty
        where the goal cannot be reached.
    """
    height, width = free.shape
    inside = 0 <= start[0] < width and 0 <= start[1] < height
    if not inside or not np.isfinite(field[start[1], start[0]]):
        return np.empty((0, 2))
    return np.asarray(_descend(free, field, start[0], start[1]), np.float64)


def plan_path(free: BoolGrid, start: tuple[int, int], goal: tuple[int, int]) -> Path:
    """The shortest path between two pixels; see `descend` for its form."""
    return descend(free, distance_field(free, goal, until=start), start)


def path_length(path: Path) -> float:
    """Length of a polyline, in its own unit."""
    if len(path) < 2:
        return 0.0
    return float(np.hypot(*np.diff(path, axis=0).T).sum())
