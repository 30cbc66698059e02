"""Moves start and goal to the nearest places where the body fits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdac_envs.grid.grid import BoolGrid, body_free, clearance, clearance_at
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.grid.pieces import (
    REACHABLE,
    End,
    Pixel,
    connected_with,
    nearest_free,
    pieces_of,
)

Point = tuple[float, float]


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
    given: dict[End, Point | None] = {"start": start, "goal": goal}
    ends = {name: point for name, point in given.items() if point is not None}
    stay = {name: at for name, at in ends.items() if body_fits(cells, at, radius)}
    if len(stay) == len(ends):
        return Snapped(start, goal, ())
    free = body_free(clearance(cells), radius)
    moved = _places(free, stay, ends)
    found: dict[End, Point | None] = {**given, **moved}
    is_joined = len(ends) == 2 and _is_joined(free, found)
    notes = [
        f"{name} moved from {units.point(*ends[name])} to {units.point(*place)}"
        + (_reach(name, len(moved), units) if is_joined else "")
        + _why(cells, ends[name], place, radius, units)
        + _remark(cells, ends[name], place)
        for name, place in moved.items()
    ]
    return Snapped(found["start"], found["goal"], tuple(notes))


def _why(
    cells: BoolGrid, point: Point, moved: Pixel, radius: float, units: MapUnits
) -> str:
    """Why an end that moved far could not stay; empty if it moved by a body radius."""
    if math.dist(point, moved) <= radius:
        return ""
    x, y = _pixel_of(point)
    height, width = cells.shape
    if not (0 <= x < width and 0 <= y < height):
        reason = "lies outside the map"
    elif cells[y, x]:
        reason = "lies in an obstacle"
    else:
        room = units.length(clearance_at(cells, x, y, radius + 1.0), 1)
        reason = f"is {room} from an obstacle, for a body of {units.length(radius)}"
        reason += " radius"
    return f"; {units.point(*point)} {reason}"


def _reach(name: End, moved: int, units: MapUnits) -> str:
    """Describes the new place of an end that is connected with the other end."""
    # Of two that move, each may have a nearer place, but not both.
    which = "the nearest" if moved == 1 else "a"
    return f", {which} free {units.place} {REACHABLE[name]}"


def body_fits(cells: BoolGrid, point: Point, radius: float) -> bool:
    """Whether the pixel of a point is free for the body, as `body_free` says.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        point: (x, y), px.
        radius: Body radius, px.
    """
    x, y = _pixel_of(point)
    height, width = cells.shape
    if not (0 <= x < width and 0 <= y < height):
        return False
    room = np.full((1, 1), clearance_at(cells, x, y, radius + 1.0), np.float32)
    return bool(body_free(room, radius)[0, 0])


def _pixel_of(point: Point) -> Pixel:
    return math.floor(point[0] + 0.5), math.floor(point[1] + 0.5)


def _places(
    free: BoolGrid, stay: dict[End, Point], ends: dict[End, Point]
) -> dict[End, Pixel]:
    """New places of the points that move, connected with the others if possible.

    Args:
        free: Shape (height, width), bool, the pixels where the body fits.
        stay: The points where it fits, px.
        ends: All points, px.

    Returns:
        Pixel (x, y) by name; empty if the body fits nowhere.
    """
    moving = {name: point for name, point in ends.items() if name not in stay}
    for point in stay.values():
        free = connected_with(free, _pixel_of(point))
    if len(moving) > 1:
        both = _nearest_pair(pieces_of(free), moving)
        if both is not None:
            return both
    nearest = {name: nearest_free(free, *point) for name, point in moving.items()}
    return {name: place for name, place in nearest.items() if place is not None}


def _nearest_pair(
    labels: NDArray[np.int32], ends: dict[End, Point]
) -> dict[End, Pixel] | None:
    """Two pixels of one piece with the shortest total move; None if there are none."""
    first, second = (_nearest_by_piece(labels, point) for point in ends.values())
    total = first[0] + second[0]
    total[(first[1] == second[1]).all(axis=1)] = np.inf
    best = int(np.argmin(total))
    if not np.isfinite(total[best]):
        return None
    pair = [tuple(pixels[best].tolist()) for _, pixels in (first, second)]
    return dict(zip(ends, pair, strict=True))


_Nearest = tuple[NDArray[np.float64], NDArray[np.int64]]
"""By piece: distance of its nearest pixel, px, and that pixel, shape (n, 2)."""


def _nearest_by_piece(labels: NDArray[np.int32], point: Point) -> _Nearest:
    """The pixel of each connected piece nearest to a point; piece 0 has none."""
    height, width = labels.shape
    across = (np.arange(width) - point[0]) ** 2
    squares = (across + ((np.arange(height) - point[1]) ** 2)[:, None]).ravel()
    pieces = labels.ravel()
    least = np.full(int(pieces.max()) + 1, np.inf)
    np.minimum.at(least, pieces, squares)
    least[0] = np.inf
    nearest = np.flatnonzero(squares == least[pieces])
    numbers, first = np.unique(pieces[nearest], return_index=True)
    pixels = np.zeros((least.size, 2), np.int64)
    pixels[numbers] = np.column_stack(np.divmod(nearest[first], width))[:, ::-1]
    return np.sqrt(least), pixels


def _is_joined(free: BoolGrid, found: dict[End, Point | None]) -> bool:
    """Whether start and goal are on free pixels that are connected."""
    labels = pieces_of(free)
    pixels = [_pixel_of(point) for point in found.values() if point is not None]
    numbers = {int(labels[pixel[::-1]]) for pixel in pixels}
    return len(numbers) == 1 and 0 not in numbers


def _remark(cells: BoolGrid, point: Point, moved: Pixel) -> str:
    """A warning if an obstacle lies between a point and the place to which it moved.

    For a point in an obstacle, the nearest free pixel takes its place.
    """
    begin: Point | None = point
    x, y = _pixel_of(point)
    height, width = cells.shape
    if not (0 <= x < width and 0 <= y < height) or cells[y, x]:
        begin = nearest_free(~cells, *point)
    assert begin is not None  # the body fits on `moved`
    count = 2 + int(2 * math.dist(begin, moved))
    xs = np.floor(np.linspace(begin[0], moved[0], count) + 0.5).astype(int)
    ys = np.floor(np.linspace(begin[1], moved[1], count) + 0.5).astype(int)
    return "; across a wall: check the preview" if cells[ys, xs].any() else ""
