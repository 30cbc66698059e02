"""A* on a grid: 8-connected, octile cost, no corner cutting.

It leaves exact lengths on every shortest path, not just on one, so that a descent takes
the path that it would take on a whole `plan.distance_field`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import constant, kernel, subkernel
from tdac_envs.grid.grid import BoolGrid

Point = tuple[int, int]
Lengths = NDArray[np.float64]

_DX = np.array([1, -1, 0, 0, 1, 1, -1, -1])
_DY = np.array([0, 0, 1, -1, 1, -1, 1, -1])
_SQRT2 = 2.0**0.5
_BITS, _WAY = 4, 15
"""Of an entry in a bucket, the direction in which its pixel was reached."""
_ALL_WAYS = 8
"""Stands for no direction: nothing led here."""
_ONWARD = np.array([1 << k for k in range(4)] + [0x15, 0x29, 0x46, 0x8A] + [0xFF])
"""Bits of the directions in which to go on, by that from which a pixel was reached."""
_ASIDE = np.array([[0x14, 0x28], [0x44, 0x88], [0x11, 0x42], [0x21, 0x82]])
"""Further ones after a straight step, for a wall on either side of where it began."""
_PER_PIXEL = 2
"""Buckets for each px of a way's length: within half a px few ways cross."""
_BUCKETS = 8
"""A power of two above `2 sqrt(2) _PER_PIXEL`, the most that one step adds."""
_PIXELS_PER_ENTRY = 4
"""Of the map, for each entry of a bucket at first."""
ROUNDING = 1e-6
"""More than the rounding of a sum of steps; other lengths differ by above 1e-5 px."""
_LEVEL, _DONE, _COUNTS = 0, 1, 2


@dataclass(frozen=True, slots=True, eq=False)
class Guide:
    """A search from the start, which tells later ones in less space how far it is.

    Attributes:
        lengths: Shape (height + 2, width + 2), float64, from `lengths_between`.
        length: Length of the shortest path, px.
    """

    lengths: Lengths
    length: float


def lengths_between(
    free: BoolGrid, start: Point, goal: Point, guide: Guide | None = None
) -> Lengths:
    """Lengths to the goal from the pixels on the shortest paths from the start.

    Args:
        free: Shape (height, width), bool, True where the path may go.
        start: Pixel (x, y), which is free.
        goal: Pixel (x, y), which is free.
        guide: Of the search from this goal to this start in `free` or in more.

    Returns:
        Shape (height + 2, width + 2), float64, with a border: no less than the true
        length elsewhere, inf at the start where there is no path, and -1 where no
        path may go.
    """
    height, width = free.shape
    field: Lengths = np.empty((height + 2, width + 2))
    _clear(constant(free), field)
    field[goal[1] + 1, goal[0] + 1] = 0.0
    known = np.empty(0) if guide is None else guide.lengths.ravel()
    most = 0.0 if guide is None else guide.length
    # Memory that is never written costs nothing.
    buckets = np.empty((_BUCKETS, free.size // _PIXELS_PER_ENTRY + 64), np.int64)
    straight = _octile(goal[0] - start[0], goal[1] - start[1])
    state = np.zeros(_COUNTS + _BUCKETS, np.int64)
    state[_LEVEL] = int(_PER_PIXEL * max(most, straight))
    first = int(state[_LEVEL]) % _BUCKETS
    cell = (goal[1] + 1) * (width + 2) + goal[0] + 1
    buckets[first, 0] = cell << _BITS | _ALL_WAYS
    state[_COUNTS + first] = 1
    ends = np.array([[start[0], start[1]], [goal[0], goal[1]]]) + 1
    while not _search(field.ravel(), width + 2, ends, known, most, buckets, state):
        buckets = np.pad(buckets, ((0, 0), (0, 3 * buckets.shape[1])))
    return field


@kernel
def _clear(free: BoolGrid, field: Lengths) -> None:
    """No length is known yet; there is a border that no path crosses."""
    field[0], field[-1], field[:, 0], field[:, -1] = -1.0, -1.0, -1.0, -1.0
    for y in range(free.shape[0]):
        for x in range(free.shape[1]):
            field[y + 1, x + 1] = np.inf if free[y, x] else -1.0


@kernel
def _octile(dx: int, dy: int) -> float:
    """Length of the shortest path over (dx, dy) where nothing is in the way."""
    dx, dy = abs(dx), abs(dy)
    return max(dx, dy) + (_SQRT2 - 1.0) * min(dx, dy)


@subkernel
def _rest(
    known: Lengths, most: float, ends: NDArray[np.int64], cell: int, x: int, y: int
) -> float:
    """At most the length from a pixel to the start; falls no faster than a path grows.

    What a guide's search did not settle is at least as far from its start as the rest
    of its shortest path would be.
    """
    straight = _octile(x - ends[0, 0], y - ends[0, 1])
    if known.size == 0:
        return straight
    beyond = most - _octile(x - ends[1, 0], y - ends[1, 1])
    return float(max(min(known[cell], beyond), straight))


@subkernel
def _ways(field: Lengths, width: int, cell: int, way: int) -> int:
    """Bits of the directions in which to go on from a pixel that was found by a step.

    Where several ways to a pixel are equally long, it is enough to find the one that is
    diagonal first; the others lead over pixels that are found so as well. Source:
    Harabor and Grastien, Online Graph Pruning for Pathfinding on Grid Maps, AAAI 2011,
    here for steps that cut no corner.
    """
    ways = _ONWARD[way]
    if way < 4:
        came = cell - _DY[way] * width - _DX[way]
        side = width if way < 2 else 1
        if field[came + side] < 0.0:
            ways |= _ASIDE[way, 0]
        if field[came - side] < 0.0:
            ways |= _ASIDE[way, 1]
    return int(ways)


@kernel
def _search(
    field: Lengths,
    width: int,
    ends: NDArray[np.int64],
    known: Lengths,
    most: float,
    buckets: NDArray[np.int64],
    state: NDArray[np.int64],
) -> bool:
    """Works the buckets off up to the length of the shortest path, or until all are.

    A bucket holds the pixels whose length with the rest lies within 1/2 px; once it is
    empty, their lengths are final. The first one is at the state's level.

    Returns:
        False where a bucket has no room; to be called again with more.
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
            cell, way = buckets[bucket, done] >> _BITS, buckets[bucket, done] & _WAY
            done += 1
            y = cell // width
            x = cell - y * width
            length = field[cell]
            ways = _ways(field, width, cell, way)
            for k in range(8):
                if ways >> k & 1 == 0:
                    continue
                i, j = _DX[k], _DY[k]
                to = cell + j * width + i
                through = length + (1.0 if k < 4 else _SQRT2)
                if not through < field[to] - 1e-12:
                    continue
                if k >= 4 and (field[cell + i] < 0.0 or field[to - i] < 0.0):
                    continue
                field[to] = through
                whole = through + _rest(known, most, ends, to, x + i, y + j)
                # Rounding must not reach back into a bucket that is done.
                into = max(int(_PER_PIXEL * whole), level) & (_BUCKETS - 1)
                count = state[_COUNTS + into]
                buckets[into, count] = to << _BITS | k
                state[_COUNTS + into] = count + 1
                fullest = max(fullest, count + 1)
        state[_COUNTS + bucket] = 0
        level, done = level + 1, 0
    return True
