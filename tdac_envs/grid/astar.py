"""A* on a grid: 8-connected, octile cost, no corner cutting.

The lengths are exact on all shortest paths, not just on one, so a descent takes the
same path as on a complete `plan.distance_field`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, read_only, subkernel
from tdac_envs.grid.grid import BoolGrid

Point = tuple[int, int]
Lengths = NDArray[np.float64]

_DX = np.array([1, -1, 0, 0, 1, 1, -1, -1])
_DY = np.array([0, 0, 1, -1, 1, -1, 1, -1])
_SQRT2 = 2.0**0.5
_BITS, _DIRECTION = 4, 15
"""Number and mask of an entry's low bits: how its pixel was reached."""
_NO_DIRECTION = 8
"""Direction of the first pixel, to which no step leads."""
_ONWARD = np.array([1 << k for k in range(4)] + [0x15, 0x29, 0x46, 0x8A] + [0xFF])
"""Bits of the directions to search, by the direction in which a pixel was reached."""
_ASIDE = np.array([[0x14, 0x28], [0x44, 0x88], [0x11, 0x42], [0x21, 0x82]])
"""Bits to add after a straight step with a wall to one side of its origin."""
_PER_PIXEL = 2
"""Buckets per px of path length: within half a px, few pixels are reached twice."""
_BUCKETS = 8
"""A power of two above `2 sqrt(2) _PER_PIXEL`, the largest increase by one step."""
_PIXELS_PER_ENTRY = 4
"""Pixels of the map per entry of a bucket of initial size."""
ROUNDING = 1e-6
"""Tolerance, px: above the rounding errors, below the gap between lengths (1e-5)."""
_LEVEL, _DONE, _COUNTS = 0, 1, 2


@dataclass(frozen=True, slots=True, eq=False)
class Guide:
    """Lengths from the start, as a heuristic for searches in subsets of the space.

    Attributes:
        lengths: Shape (height + 2, width + 2), float64, from `lengths_between`.
        length: Length of the shortest path, px.
    """

    lengths: Lengths
    length: float


def lengths_between(
    free: BoolGrid, start: Point, goal: Point, guide: Guide | None = None
) -> Lengths:
    """Lengths to the goal from all pixels on the shortest paths from start to goal.

    Args:
        free: Shape (height, width), bool, True where the path may go.
        start: Free pixel (x, y).
        goal: Free pixel (x, y).
        guide: Result of a search in the other direction, in `free` or a superset.

    Returns:
        Shape (height + 2, width + 2), float64, with a border: upper bounds at pixels on
        no shortest path, inf at the start if there is no path, and -1 where the path
        may not go.
    """
    height, width = free.shape
    field: Lengths = np.empty((height + 2, width + 2))
    _clear(read_only(free), field)
    field[goal[1] + 1, goal[0] + 1] = 0.0
    known = np.empty(0) if guide is None else guide.lengths.ravel()
    shortest = 0.0 if guide is None else guide.length
    # Not initialised: memory that is never written costs nothing.
    buckets = np.empty((_BUCKETS, free.size // _PIXELS_PER_ENTRY + 64), np.int64)
    straight = _octile(goal[0] - start[0], goal[1] - start[1])
    state = np.zeros(_COUNTS + _BUCKETS, np.int64)
    state[_LEVEL] = int(_PER_PIXEL * max(shortest, straight))
    first = int(state[_LEVEL]) % _BUCKETS
    cell = (goal[1] + 1) * (width + 2) + goal[0] + 1
    buckets[first, 0] = cell << _BITS | _NO_DIRECTION
    state[_COUNTS + first] = 1
    ends = np.array([[start[0], start[1]], [goal[0], goal[1]]]) + 1
    while not _search(field.ravel(), width + 2, ends, known, shortest, buckets, state):
        buckets = np.pad(buckets, ((0, 0), (0, 3 * buckets.shape[1])))
    return field


@kernel
def _clear(free: BoolGrid, field: Lengths) -> None:
    """Sets all lengths to unknown and the border to impassable."""
    field[0], field[-1], field[:, 0], field[:, -1] = -1.0, -1.0, -1.0, -1.0
    for y in range(free.shape[0]):
        for x in range(free.shape[1]):
            field[y + 1, x + 1] = np.inf if free[y, x] else -1.0


@kernel
def _octile(dx: int, dy: int) -> float:
    """Length of the shortest path over (dx, dy) without obstacles, px."""
    dx, dy = abs(dx), abs(dy)
    return max(dx, dy) + (_SQRT2 - 1.0) * min(dx, dy)


@subkernel
def _heuristic(
    known: Lengths, shortest: float, ends: NDArray[np.int64], cell: int, x: int, y: int
) -> float:
    """Consistent lower bound of the length from a pixel to the start, px.

    From a pixel that the guide's search did not settle, the path to the start and the
    octile distance to the goal are together at least as long as the shortest path.
    """
    straight = _octile(x - ends[0, 0], y - ends[0, 1])
    if known.size == 0:
        return straight
    unsettled = shortest - _octile(x - ends[1, 0], y - ends[1, 1])
    return float(max(min(known[cell], unsettled), straight))


@subkernel
def _directions(field: Lengths, width: int, cell: int, direction: int) -> int:
    """Bits of the directions to search from a pixel, by how it was reached.

    Of several equally long paths to a pixel, only the one that starts with its diagonal
    steps must be found; the pixels on the others are found in the same manner. Source:
    Harabor and Grastien, Online Graph Pruning for Pathfinding on Grid Maps, AAAI 2011,
    adapted to steps that cut no corner.
    """
    found = _ONWARD[direction]
    if direction < 4:
        origin = cell - _DY[direction] * width - _DX[direction]
        side = width if direction < 2 else 1
        if field[origin + side] < 0.0:
            found |= _ASIDE[direction, 0]
        if field[origin - side] < 0.0:
            found |= _ASIDE[direction, 1]
    return int(found)


@kernel
def _search(
    field: Lengths,
    width: int,
    ends: NDArray[np.int64],
    known: Lengths,
    shortest: float,
    buckets: NDArray[np.int64],
    state: NDArray[np.int64],
) -> bool:
    """Processes the buckets up to the shortest path's length, or until all are empty.

    The estimated total lengths of the pixels in a bucket differ by at most 1/2 px; when
    it is empty, their lengths are final. `state[_LEVEL]` is the first bucket's number.

    Returns:
        False if a bucket is full: call again with larger buckets.
    """
    end, room = ends[0, 1] * width + ends[0, 0], buckets.shape[1]
    level, done, empty, fullest = state[_LEVEL], state[_DONE], 0, room
    while empty < _BUCKETS:
        if level > _PER_PIXEL * (field[end] + ROUNDING):
            return True
        bucket = level & (_BUCKETS - 1)
        empty = empty + 1 if state[_COUNTS + bucket] == 0 else 0
        while done < state[_COUNTS + bucket]:
            if fullest + 8 > room:
                fullest = 0
                for k in range(_BUCKETS):
                    fullest = max(fullest, state[_COUNTS + k])
                if fullest + 8 > room:
                    state[_LEVEL], state[_DONE] = level, done
                    return False
            entry = buckets[bucket, done]
            cell, direction = entry >> _BITS, entry & _DIRECTION
            done += 1
            y = cell // width
            x = cell - y * width
            length = field[cell]
            directions = _directions(field, width, cell, direction)
            for k in range(8):
                if directions >> k & 1 == 0:
                    continue
                i, j = _DX[k], _DY[k]
                to = cell + j * width + i
                through = length + (1.0 if k < 4 else _SQRT2)
                if not through < field[to] - 1e-12:
                    continue
                if k >= 4 and (field[cell + i] < 0.0 or field[to - i] < 0.0):
                    continue
                field[to] = through
                total = through + _heuristic(known, shortest, ends, to, x + i, y + j)
                # Rounding must not lead back to a bucket that is done.
                into = max(int(_PER_PIXEL * total), level) & (_BUCKETS - 1)
                count = state[_COUNTS + into]
                buckets[into, count] = to << _BITS | k
                state[_COUNTS + into] = count + 1
                fullest = max(fullest, count + 1)
        state[_COUNTS + bucket] = 0
        level, done = level + 1, 0
    return True
