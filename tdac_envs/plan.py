"""Shortest paths on a grid: 8-connected, octile cost, no corner cutting."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tdac_envs.astar import Guide, lengths_between
from tdac_envs.compiled import kernel
from tdac_envs.grid import BoolGrid

Path = NDArray[np.float64]
Field = NDArray[np.float64]

_DX = np.array([1, -1, 0, 0, 1, 1, -1, -1])
_DY = np.array([0, 0, 1, -1, 1, -1, 1, -1])
_SQRT2 = 2.0**0.5


@kernel("b1[:,:] i8 i8 f8[:,:] b1[:] i8[:,:] -> b1")
def _spread(
    free: BoolGrid,
    goal_x: int,
    goal_y: int,
    field: Field,
    settled: NDArray[np.bool_],
    buckets: NDArray[np.int64],
) -> bool:
    """Dijkstra in buckets of width 1; False where these have no room.

    No step is shorter than 1, so a bucket never receives a cell while it is
    worked off, and three buckets in rotation suffice.
    """
    height, width = free.shape
    room = buckets.shape[1]
    one, two, three = 0, 1, 2
    n_one, n_two, n_three = 1, 0, 0
    buckets[one, 0] = goal_y * width + goal_x
    field[goal_y, goal_x] = 0.0
    level = 0
    while n_one + n_two + n_three > 0:
        for index in range(n_one):
            cell = buckets[one, index]
            if settled[cell]:
                continue
            settled[cell] = True
            y, x = cell // width, cell % width
            if n_two + 8 > room or n_three + 8 > room:
                return False
            for k in range(8):
                nx, ny = x + _DX[k], y + _DY[k]
                if nx < 0 or ny < 0 or nx >= width or ny >= height:
                    continue
                if not free[ny, nx]:
                    continue
                if k >= 4 and not (free[y, nx] and free[ny, x]):
                    continue
                candidate = field[y, x] + (1.0 if k < 4 else _SQRT2)
                if candidate < field[ny, nx] - 1e-12:
                    field[ny, nx] = candidate
                    if int(candidate) == level + 1:
                        buckets[two, n_two] = ny * width + nx
                        n_two += 1
                    else:
                        buckets[three, n_three] = ny * width + nx
                        n_three += 1
        one, two, three = two, three, one
        n_one, n_two, n_three = n_two, n_three, 0
        level += 1
    return True


def distance_field(free: BoolGrid, goal: tuple[int, int]) -> Field:
    """Length of the shortest path from every free pixel to the goal, in px.

    Args:
        free: Shape (height, width), bool, True where the path may go.
        goal: Pixel (x, y).

    Returns:
        Shape (height, width), float64; inf where the goal cannot be reached.
    """
    if not _is_free(free, goal):
        return np.full(free.shape, np.inf)
    room = 4 * sum(free.shape) + 1024
    while True:
        field: Field = np.full(free.shape, np.inf)
        settled, buckets = np.zeros(free.size, np.bool_), np.empty((3, room), np.int64)
        if _spread(free, goal[0], goal[1], field, settled, buckets):
            return field
        room *= 4


def _is_free(free: BoolGrid, pixel: tuple[int, int]) -> bool:
    height, width = free.shape
    inside = 0 <= pixel[0] < width and 0 <= pixel[1] < height
    return inside and bool(free[pixel[::-1]])


@kernel("b1[:,:] f8[:,:] i8 i8 i8[:,:] -> i8")
def _descend(
    free: BoolGrid, field: Field, start_x: int, start_y: int, path: NDArray[np.int64]
) -> int:
    """Writes the pixels of the path; returns how many."""
    height, width = field.shape
    x, y, count = start_x, start_y, 0
    while True:
        path[count, 0], path[count, 1] = x, y
        count += 1
        if field[y, x] == 0.0:
            return count
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
    pixels = np.empty((int(field[start[1], start[0]]) + 2, 2), np.int64)
    count = _descend(free, field, start[0], start[1], pixels)
    return pixels[:count].astype(np.float64)


def plan_path(
    free: BoolGrid,
    start: tuple[int, int],
    goal: tuple[int, int],
    guide: Guide | None = None,
) -> Path:
    """The shortest path between two pixels, as `descend` has it on the whole field.

    Args:
        free: Shape (height, width), bool, True where the path may go.
        start: Pixel (x, y).
        goal: Pixel (x, y).
        guide: From `guide_between`, for the same ends and pixels that hold all of
            `free`; it makes the search faster and leaves its result as it is.
    """
    if not (_is_free(free, start) and _is_free(free, goal)):
        return np.empty((0, 2))
    lengths = lengths_between(free, start, goal, guide)
    framed = np.pad(free, 1)
    return descend(framed, lengths, (start[0] + 1, start[1] + 1)) - 1


def guide_between(
    free: BoolGrid, start: tuple[int, int], goal: tuple[int, int]
) -> Guide | None:
    """What speeds up searches between two pixels in parts of `free`.

    Returns:
        None where there is no path, so that there is none in any part either.
    """
    if not (_is_free(free, start) and _is_free(free, goal)):
        return None
    lengths = lengths_between(free, goal, start)
    length = float(lengths[goal[1] + 1, goal[0] + 1])
    return Guide(lengths, length) if np.isfinite(length) else None


def path_length(path: Path) -> float:
    """Length of a polyline, in its own unit."""
    if len(path) < 2:
        return 0.0
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def first_beyond(path: Path, x: float, y: float, far: float) -> tuple[float, float]:
    """The first point of a path that is so far from (x, y), or its last one."""
    distant = np.hypot(path[:, 0] - x, path[:, 1] - y) >= far
    to_x, to_y = path[int(np.argmax(distant)) if distant.any() else -1].tolist()
    return to_x, to_y
