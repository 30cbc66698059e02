"""Moves start and goal to the nearest places where the body fits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.grid.grid import BoolGrid, body_free, clearance
from tdac_envs.grid.map_units import PIXELS, MapUnits

Point = tuple[float, float]
Pixel = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Snapped:
    """The result of `snap`.

    Attributes:
        start: The start, px; None if it was not given.
        goal: The goal, px; None if it was not given.
        notes: A sentence for each point that was moved.
    """

    start: Point | None
    goal: Point | None
    notes: tuple[str, ...]


def snap(
    cells: BoolGrid,
    start: Point | None,
    goal: Point | None,
    radius: float,
    units: MapUnits = PIXELS,
) -> Snapped:
    """Moves a start or goal where the body does not fit to the nearest free pixel.

    A point where the body fits stays. Any other point moves only to a place that is
    connected with the other point, never into a closed pocket, unless no such place
    exists.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        start: (x, y), px, or None.
        goal: (x, y), px, or None.
        radius: Body radius, px.
        units: Units of the notes.
    """
    free = body_free(clearance(cells), radius)
    given = {"start": start, "goal": goal}
    ends = {name: point for name, point in given.items() if point is not None}
    found = {**given, **_places(free, ends)}
    moved = [name for name in ends if found[name] != ends[name]]
    notes = [
        f"{name} moved from {units.point(*ends[name])} to "
        f"{units.point(*_given(found[name]))}{_remark(cells, ends[name], found[name])}"
        for name in moved
    ]
    return Snapped(found["start"], found["goal"], tuple(notes))


def fits(free: BoolGrid, point: Point) -> bool:
    """Whether a point, px, is on a free pixel of the map."""
    x, y = math.floor(point[0] + 0.5), math.floor(point[1] + 0.5)
    height, width = free.shape
    return 0 <= x < width and 0 <= y < height and bool(free[y, x])


def _places(free: BoolGrid, ends: dict[str, Point]) -> dict[str, Point]:
    """The places of the points, in one connected piece if there is such a piece."""
    stay = {name: point for name, point in ends.items() if fits(free, point)}
    rows, columns = np.nonzero(free)
    if len(stay) == len(ends) or rows.size == 0:
        return ends
    found = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)[1]
    labels = np.asarray(found, np.int32)
    pieces = labels[rows, columns]
    nearest = {
        name: _nearest_by_piece(pieces, rows, columns, point)
        for name, point in ends.items()
        if name not in stay
    }
    homes = {
        int(labels[math.floor(y + 0.5), math.floor(x + 0.5)]) for x, y in stay.values()
    }
    piece = _cheapest(nearest, homes)
    return {**stay, **{name: _pixel(near, piece) for name, near in nearest.items()}}


_Nearest = tuple[NDArray[np.float64], NDArray[np.int64]]
"""By piece: distance of its nearest pixel, px, and that pixel, shape (n, 2)."""


def _nearest_by_piece(
    pieces: NDArray[np.int32],
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    point: Point,
) -> _Nearest:
    """The pixel of each connected piece nearest to a point; piece 0 is empty."""
    away = np.hypot(columns - point[0], rows - point[1])
    order = np.lexsort((away, pieces))
    numbers, first = np.unique(pieces[order], return_index=True)
    gaps = np.full(int(numbers.max()) + 1, np.inf)
    pixels = np.zeros((gaps.size, 2), np.int64)
    chosen = order[first]
    gaps[numbers] = away[chosen]
    pixels[numbers] = np.column_stack([columns[chosen], rows[chosen]])
    return gaps, pixels


def _cheapest(nearest: dict[str, _Nearest], homes: set[int]) -> int | None:
    """The piece with the shortest total move of the points; None if there is none."""
    total = np.sum([gaps for gaps, _ in nearest.values()], axis=0)
    if len(nearest) > 1:
        first, second = (pixels for _, pixels in nearest.values())
        total[(first == second).all(axis=1)] = np.inf
    if homes:
        elsewhere = np.ones(total.size, np.bool_)
        elsewhere[list(homes)] = False
        total[elsewhere] = np.inf
    best = int(np.argmin(total))
    return best if np.isfinite(total[best]) else None


def _pixel(near: _Nearest, piece: int | None) -> Pixel:
    gaps, pixels = near
    x, y = pixels[int(np.argmin(gaps)) if piece is None else piece].tolist()
    return x, y


def _given(point: Point | None) -> Point:
    assert point is not None
    return point


def _remark(cells: BoolGrid, point: Point, moved: Point | None) -> str:
    if not _is_across_wall(cells, point, _given(moved)):
        return ""
    return ", across a wall: check the preview"


def _is_across_wall(cells: BoolGrid, point: Point, moved: Point) -> bool:
    """Whether an obstacle lies between a point and the place to which it moved.

    For a point in an obstacle, the nearest free pixel takes its place.
    """
    begin = point
    if not fits(~cells, point):
        rows, columns = np.nonzero(~cells)
        best = int(np.argmin((columns - point[0]) ** 2 + (rows - point[1]) ** 2))
        begin = float(columns[best]), float(rows[best])
    count = 2 + int(2 * math.dist(begin, moved))
    xs = np.floor(np.linspace(begin[0], moved[0], count) + 0.5).astype(int)
    ys = np.floor(np.linspace(begin[1], moved[1], count) + 0.5).astype(int)
    return bool(cells[ys, xs].any())
