"""Shortest paths on a grid: 8-connected, octile cost, no corner cutting."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, read_only, subkernel
from tdac_envs.grid.astar import ROUNDING, Guide, Lengths, lengths_between
from tdac_envs.grid.grid import BoolGrid

Path = NDArray[np.float64]
Field = NDArray[np.float64]

_DX = np.array([1, -1, 0, 0, 1, 1, -1, -1])
_DY = np.array([0, 0, 1, -1, 1, -1, 1, -1])
_SQRT2 = 2.0**0.5
_SOLID, _OPEN, _TRIED = 0, 1, 2


@kernel
def _spread(
    free: BoolGrid, goal: int, padded: Field, buckets: NDArray[np.int32]
) -> bool:
    """Dijkstra with buckets of width 1; returns False if a bucket is full.

    No step is shorter than 1, so a bucket receives no cells while it is processed, and
    three buckets in rotation suffice.

    Args:
        free: Shape (height, width).
        goal: Index of the goal in `padded`, flattened.
        padded: Shape (height + 2, width + 2), overwritten: the lengths; negative where
            no path may go.
        buckets: Shape (3, n), overwritten.
    """
    width = free.shape[1]
    _fill_open(free, padded)
    field, row, room = padded.ravel(), width + 2, buckets.shape[1]
    one, two, three = 0, 1, 2
    n_one, n_two, n_three = 1, 0, 0
    buckets[one, 0] = goal
    field[goal] = 0.0
    level = 0
    while n_one + n_two + n_three > 0:
        for index in range(n_one):
            cell = buckets[one, index]
            length = field[cell]
            if int(length) < level:
                continue  # It was in an earlier bucket, too.
            if n_two + 8 > room or n_three + 8 > room:
                return False
            for k in range(8):
                to = cell + _DX[k] + _DY[k] * row
                candidate = length + (1.0 if k < 4 else _SQRT2)
                if candidate >= field[to] - 1e-12:
                    continue
                if k >= 4 and (field[cell + _DX[k]] < 0.0 or field[to - _DX[k]] < 0.0):
                    continue
                field[to] = candidate
                if int(candidate) == level + 1:
                    buckets[two, n_two] = to
                    n_two += 1
                else:
                    buckets[three, n_three] = to
                    n_three += 1
        one, two, three = two, three, one
        n_one, n_two, n_three = n_two, n_three, 0
        level += 1
    return True


@subkernel
def _fill_open(free: BoolGrid, padded: Field) -> None:
    """Fills `padded` with inf where the path may go, and -1 elsewhere."""
    height, width = free.shape
    padded[0], padded[height + 1] = -1.0, -1.0
    for y in range(height):
        padded[y + 1, 0], padded[y + 1, width + 1] = -1.0, -1.0
        for x in range(width):
            padded[y + 1, x + 1] = math.inf if free[y, x] else -1.0


@kernel
def _cropped(padded: Field, field: Field) -> None:
    """Copies the lengths without their border; inf where there is no path."""
    height, width = field.shape
    for y in range(height):
        for x in range(width):
            length = padded[y + 1, x + 1]
            field[y, x] = math.inf if length < 0.0 else length


def distance_field(free: BoolGrid, goal: tuple[int, int]) -> Field:
    """Length of the shortest path from every free pixel to the goal, in px.

    Args:
        free: Shape (height, width), bool, True where the path may go.
        goal: Pixel (x, y).

    Returns:
        Shape (height, width), float64; inf where there is no path to the goal.
    """
    if not _is_free(free, goal):
        return np.full(free.shape, np.inf)
    height, width = free.shape
    first = (goal[1] + 1) * (width + 2) + goal[0] + 1
    padded, field = np.empty((height + 2, width + 2)), np.empty(free.shape)
    room = 4 * sum(free.shape) + 1024
    while not _spread(read_only(free), first, padded, np.empty((3, room), np.int32)):
        room *= 4
    _cropped(padded, field)
    return field


def _is_free(free: BoolGrid, pixel: tuple[int, int]) -> bool:
    height, width = free.shape
    inside = 0 <= pixel[0] < width and 0 <= pixel[1] < height
    return inside and bool(free[pixel[::-1]])


@kernel
def _descend(
    free: BoolGrid, field: Field, start_x: int, start_y: int, path: NDArray[np.int64]
) -> int:
    """Writes the pixels of the path; returns their number."""
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
            if through < best - ROUNDING:
                best, best_x, best_y = through, nx, ny
        x, y = best_x, best_y


def descend(free: BoolGrid, field: Field, start: tuple[int, int]) -> Path:
    """The shortest path from `start` down a `distance_field`.

    Returns:
        Shape (n, 2), float64, columns x and y, start and goal included; empty if there
        is no path.
    """
    height, width = free.shape
    inside = 0 <= start[0] < width and 0 <= start[1] < height
    if not inside or not np.isfinite(field[start[1], start[0]]):
        return np.empty((0, 2))
    pixels = np.empty((int(field[start[1], start[0]]) + 2, 2), np.int64)
    known = read_only(field, np.float64)
    count = _descend(read_only(free), known, *start, pixels)
    return pixels[:count].astype(np.float64)


def plan_path(
    free: BoolGrid,
    start: tuple[int, int],
    goal: tuple[int, int],
    guide: Guide | None = None,
) -> Path:
    """The shortest path between two pixels, as from `descend` on a complete field.

    Args:
        free: Shape (height, width), bool, True where the path may go.
        start: Pixel (x, y).
        goal: Pixel (x, y).
        guide: From `guide_between`, for the same ends and a superset of `free`. It
            speeds up the search and does not change the result.
    """
    if not (_is_free(free, start) and _is_free(free, goal)):
        return np.empty((0, 2))
    return _path_in(free, lengths_between(free, start, goal, guide), start)


def plan_paths(
    spaces: Sequence[BoolGrid],
    start: tuple[int, int],
    goal: tuple[int, int],
    guide: Guide,
) -> list[Path]:
    """The results of `plan_path` in each of several similar spaces.

    Usually a single search in their union is enough: it finds the path of each space
    whose shortest path is as short as that of the union.

    Args:
        spaces: Each of shape (height, width), bool; fastest with the largest last.
        start: Pixel (x, y).
        goal: Pixel (x, y).
        guide: From `guide_between`, for a superset of all spaces.
    """
    paths: list[Path] = [np.empty((0, 2))] * len(spaces)
    lengths: Lengths | None = None
    for number in reversed(range(len(spaces))):
        path = _path_in(spaces[number], lengths, start)
        if len(path) == 0:
            union = np.logical_or.reduce(spaces[: number + 1])
            if not (_is_free(union, start) and _is_free(union, goal)):
                break
            lengths = lengths_between(union, start, goal, guide)
            if np.isinf(lengths[start[1] + 1, start[0] + 1]):
                break
            path = _path_in(spaces[number], lengths, start)
        if len(path) == 0:
            path = plan_path(spaces[number], start, goal, guide)
        paths[number] = path
    return paths


def _path_in(free: BoolGrid, lengths: Lengths | None, start: tuple[int, int]) -> Path:
    """The result of `plan_path` in a subset, if it is as short as in the whole space.

    Args:
        free: The subset, shape (height, width).
        lengths: From `lengths_between` in the space; None if not yet computed.
        start: Pixel (x, y).

    Returns:
        Shape (n, 2); empty if the subset has no path of this length.
    """
    if lengths is None or not _is_free(free, start):
        return np.empty((0, 2))
    length = lengths[start[1] + 1, start[0] + 1]
    if np.isinf(length):
        return np.empty((0, 2))
    most = int(length) + 2
    pixels, turns = np.empty((most, 2), np.int64), np.zeros(most, np.int64)
    open_ = np.pad(free, 1).view(np.uint8)
    count = _walk(open_, lengths, start[0] + 1, start[1] + 1, pixels, turns)
    return pixels[:count].astype(np.float64) - 1


@kernel
def _walk(
    open_: NDArray[np.uint8],
    lengths: Lengths,
    start_x: int,
    start_y: int,
    path: NDArray[np.int64],
    turns: NDArray[np.int64],
) -> int:
    """Writes the first shortest path down the lengths; returns its number of pixels.

    All paths to a pixel are equally long, so a pixel that leads to a dead end is not
    tried again. Returns 0 if there is no path.
    """
    path[0, 0], path[0, 1] = start_x, start_y
    count = 1
    while count > 0:
        x, y, k = path[count - 1, 0], path[count - 1, 1], turns[count - 1]
        length = lengths[y, x]
        if length == 0.0:
            return count
        if k == 8:
            open_[y, x] = _TRIED
            count -= 1
            continue
        turns[count - 1] = k + 1
        i, j = x + _DX[k], y + _DY[k]
        through = lengths[j, i] + (1.0 if k < 4 else _SQRT2)
        if open_[j, i] != _OPEN or abs(through - length) > ROUNDING:
            continue
        if k >= 4 and (open_[y, i] == _SOLID or open_[j, x] == _SOLID):
            continue
        path[count, 0], path[count, 1], turns[count] = i, j, 0
        count += 1
    return 0


def guide_between(
    free: BoolGrid, start: tuple[int, int], goal: tuple[int, int]
) -> Guide | None:
    """A guide that speeds up searches between two pixels in subsets of `free`.

    Returns:
        None if there is no path in `free`, and so in no subset.
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
    """The first point of a path at least `far` from (x, y), or else its last point."""
    distant = np.hypot(path[:, 0] - x, path[:, 1] - y) >= far
    to_x, to_y = path[int(np.argmax(distant)) if distant.any() else -1].tolist()
    return to_x, to_y
