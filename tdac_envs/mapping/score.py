"""Feasibility and score of a grid for a body (Algorithm 1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.grid.astar import Guide
from tdac_envs.grid.grid import BoolGrid, FloatGrid, body_free, clearance
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.grid.plan import Path, guide_between, path_length, plan_paths
from tdac_envs.mapping.params import ScoreTerms

Point = tuple[int, int]

_WEIGHTS = (2.5, -0.02, -1.2)


def sharpness(cells: BoolGrid) -> float:
    """Changes between free and occupied among neighbouring pixels, per pixel.

    The boundary term of Algorithm 1 (the paper favours "boundary smoothness" but
    does not define it): 0 for an empty map, 2 for a chessboard.
    """
    flips = np.count_nonzero(cells[1:] != cells[:-1])
    flips += np.count_nonzero(cells[:, 1:] != cells[:, :-1])
    return flips / cells.size


def score(terms: ScoreTerms) -> float:
    """`2.5 min_clearance - 0.02 path_length - 1.2 sharpness`."""
    values = (terms.min_clearance, terms.path_length, terms.sharpness)
    return sum(w * v for w, v in zip(_WEIGHTS, values, strict=True))


@dataclass(frozen=True, slots=True)
class NavigationTask:
    """A navigation task: start and goal pixels (x, y), and the body's radius, px.

    `units` are those of messages.
    """

    start: Point
    goal: Point
    radius: float
    units: MapUnits = PIXELS


@dataclass(frozen=True, slots=True, eq=False)
class GridMetrics:
    """The properties of a grid that its score depends on.

    Attributes:
        clear: `clearance` of its cells.
        sharpness: `sharpness` of its cells.
    """

    clear: FloatGrid
    sharpness: float

    @classmethod
    def of(cls, cells: BoolGrid) -> GridMetrics:
        """The properties of cells, shape (height, width), bool, True = occupied."""
        return cls(clearance(cells), sharpness(cells))


def terms_of(
    grounds: Sequence[GridMetrics],
    trip: NavigationTask,
    margins: Sequence[int],
    guide: Guide,
) -> list[list[ScoreTerms | None]]:
    """Score terms of each grid with each margin of the planner.

    Args:
        grounds: Grids of the same size; fastest with the fewest obstacles last.
        trip: Start, goal and body.
        margins: Margins around the body in ascending order, px.
        guide: From `guide_of`, for a grid whose obstacles are in all grids.

    Returns:
        For each grid a list as long as `margins`; None where there is no path.
    """
    paths: list[Path] = [np.empty((0, 2))] * len(grounds)
    found: list[list[ScoreTerms | None]] = [[] for _ in grounds]
    for margin in margins:
        spaces = {
            number: body_free(ground.clear, trip.radius + margin)
            for number, ground in enumerate(grounds)
            # Without a path for a smaller margin, there is none for this one.
            if margin == margins[0] or len(paths[number])
        }
        spaces = {n: s for n, s in spaces.items() if not _stays_free(paths[n], s)}
        planned = plan_paths(list(spaces.values()), trip.start, trip.goal, guide)
        for number, path in zip(spaces, planned, strict=True):
            paths[number] = path
        for terms, ground, path in zip(found, grounds, paths, strict=True):
            terms.append(_terms(ground, path))
    return found


def _terms(ground: GridMetrics, path: Path) -> ScoreTerms | None:
    if len(path) == 0:
        return None
    columns, rows = path.astype(np.intp).T
    return ScoreTerms(
        min_clearance=float(ground.clear[rows, columns].min()),
        path_length=path_length(path),
        sharpness=ground.sharpness,
    )


def guide_of(clear: FloatGrid, trip: NavigationTask) -> Guide | None:
    """A guide that speeds up `terms_of` for a grid, or for one with more obstacles.

    Args:
        clear: Clearance of the grid.
        trip: Start, goal and body.

    Returns:
        None if there is no path.
    """
    return guide_between(body_free(clear, trip.radius), trip.start, trip.goal)


def _stays_free(path: Path, free: BoolGrid) -> bool:
    """Whether a path is still possible with fewer free pixels.

    If so, it is still the shortest path, and the one that `plan_path` finds.
    """
    columns, rows = path.astype(np.intp).T
    over = free[rows, columns].all() and free[rows[1:], columns[:-1]].all()
    return bool(len(path) and over and free[rows[:-1], columns[1:]].all())


def explain(cells: BoolGrid, trip: NavigationTask, inflation: int = 0) -> str:
    """Why there is no path from start to goal with a margin, and what would work.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        trip: Start, goal and body.
        inflation: Margin that the planner keeps around the body, px.
    """
    clear = clearance(cells)
    free = body_free(clear, trip.radius + inflation)
    start, goal, units = trip.start, trip.goal, trip.units
    for name, (x, y), other in (("start", start, goal), ("goal", goal, start)):
        if free[y, x]:
            continue
        what = (
            "lies in an obstacle"
            if cells[y, x]
            else f"is {units.length(clear[y, x], 1)} from an obstacle, too near"
        )
        near = _nearest_text(_connected_to(free, other), x, y, trip)
        return f"{name} {units.point(x, y)} {what}; {near}{_narrower(clear, trip)}"
    widest = widest_radius(clear, start, goal)
    advice = (
        "no robot gets through: a wall blocks the way"
        if widest < 0.5
        else f"the largest radius that gets through is {units.at_most(widest)}"
    )
    return (
        f"start {units.point(*start)} and goal {units.point(*goal)} are not connected "
        f"for a robot of {units.length(trip.radius)} radius; {advice}"
    )


def _connected_to(free: BoolGrid, point: Point) -> BoolGrid:
    """The free pixels connected with a point; all if the point is not free."""
    labels = pieces_of(free)
    label = labels[point[::-1]]
    joined: BoolGrid = labels == label
    return joined if label else free


def _narrower(clear: FloatGrid, trip: NavigationTask) -> str:
    """The radius that would work with this start and goal; empty if none would."""
    widest = widest_radius(clear, trip.start, trip.goal)
    if widest < 0.5:
        return ""
    radius = trip.units.at_most(widest)
    return f"; from this start to this goal a radius of {radius} gets through"


def _nearest_text(free: BoolGrid, x: int, y: int, trip: NavigationTask) -> str:
    nearest, radius = nearest_free(free, x, y), trip.units.length(trip.radius)
    if nearest is None:
        return f"a robot of {radius} radius fits nowhere on this map"
    place = "pixel" if trip.units == PIXELS else "place"
    return (
        f"the nearest free {place} for a robot of {radius} radius is "
        f"{trip.units.point(*nearest)}"
    )


def nearest_free(free: BoolGrid, x: int, y: int) -> Point | None:
    """The free pixel nearest to (x, y), or None where there is none."""
    rows, columns = np.nonzero(free)
    if rows.size == 0:
        return None
    best = int(np.argmin((columns - x) ** 2 + (rows - y) ** 2))
    return int(columns[best]), int(rows[best])


def connected(free: BoolGrid, start: Point, goal: Point) -> bool:
    """Whether two free pixels are connected without cutting a corner.

    A diagonal step requires both pixels beside it, so 4-connectivity decides.
    """
    labels = pieces_of(free)
    at_start, at_goal = labels[start[::-1]], labels[goal[::-1]]
    return bool(at_start == at_goal and at_start > 0)


def pieces_of(free: BoolGrid) -> NDArray[np.int32]:
    """Number of the connected piece of each free pixel, from 1; 0 for the others."""
    labels = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)[1]
    return labels.astype(np.int32, copy=False)


def widest_radius(clear: FloatGrid, start: Point, goal: Point) -> float:
    """Largest body radius that gets from start to goal, to 0.1 px; -1 for none."""
    if not connected(body_free(clear, 0.0), start, goal):
        return -1.0
    low, high = 0.0, float(min(clear[start[::-1]], clear[goal[::-1]]))
    while high - low > 0.1:
        middle = (low + high) / 2
        if connected(body_free(clear, middle), start, goal):
            low = middle
        else:
            high = middle
    return float(np.floor(low * 10) / 10)
