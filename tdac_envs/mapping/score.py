"""Feasibility and score of a grid for a body (Algorithm 1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tdac_envs.core.errors import offer
from tdac_envs.grid.astar import Guide
from tdac_envs.grid.grid import BoolGrid, FloatGrid, body_free, clearance
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.grid.pieces import (
    REACHABLE,
    End,
    connected_with,
    end_outside,
    nearest_free,
    pieces_of,
)
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
    beyond = end_outside(cells, trip.start, trip.goal)
    clear = clearance(cells)
    free = body_free(clear, trip.radius + inflation)
    if beyond is not None:
        return _beyond_wall(cells, free, beyond, trip, inflation)
    start, goal, units = trip.start, trip.goal, trip.units
    names: tuple[End, End] = ("start", "goal")
    for name, (x, y) in zip(names, (start, goal), strict=True):
        if free[y, x]:
            continue
        what = (
            "lies in an obstacle"
            if cells[y, x]
            else f"is {units.length(clear[y, x], 1)} from an obstacle, too near"
        )
        problem = f"{name} {units.point(x, y)} {what}"
        advice = _advice(free, name, trip, inflation, problem)
        return f"{advice}{_narrower(clear, trip)}"
    widest = widest_radius(clear, start, goal)
    advice = (
        "no robot gets through: a wall blocks the way"
        if widest < 0.5
        else f"the largest radius that gets through is {units.at_most(widest)}"
    )
    return (
        f"start {units.point(*start)} and goal {units.point(*goal)} are not connected "
        f"for {_robot(trip, inflation)}; {advice}"
    )


def _beyond_wall(
    cells: BoolGrid, free: BoolGrid, name: End, trip: NavigationTask, inflation: int
) -> str:
    """Why there is no path: a closed wall around the other end."""
    point, other = trip.units.point, "goal" if name == "start" else "start"
    at, there = _at_and_there(trip, name)
    within = free & connected_with(~cells, there)
    problem = (
        f"{name} {point(*at)} lies outside of the closed wall around {other} "
        f"{point(*there)}"
    )
    return _advice(within, name, trip, inflation, problem)


def _at_and_there(trip: NavigationTask, name: End) -> tuple[Point, Point]:
    """The pixels of an end and of the other end."""
    ends = trip.start, trip.goal
    return ends if name == "start" else ends[::-1]


def _robot(trip: NavigationTask, inflation: int) -> str:
    margin = f" and a margin of {trip.units.length(inflation)}" if inflation else ""
    return f"a robot of {trip.units.length(trip.radius)} radius{margin}"


def _narrower(clear: FloatGrid, trip: NavigationTask) -> str:
    """The radius that would work with this start and goal; empty if none would."""
    widest = widest_radius(clear, trip.start, trip.goal)
    if widest < 0.5:
        return ""
    radius = trip.units.at_most(widest)
    return f"; from this start to this goal a radius of {radius} gets through"


def _advice(
    free: BoolGrid, name: End, trip: NavigationTask, inflation: int, problem: str
) -> str:
    """Offers the free place nearest to an end, then says what is wrong with the end.

    If the other end is free, the place is connected with it.
    """
    at, there = _at_and_there(trip, name)
    robot, reach = _robot(trip, inflation), ""
    if free[there[::-1]]:
        free, reach = connected_with(free, there), f" {REACHABLE[name]}"
    nearest = nearest_free(free, *at)
    if nearest is None:
        return f"{problem}; {robot} fits nowhere on this map"
    which = f"the nearest free {trip.units.place} for {robot}{reach}"
    return offer(name, trip.units.point(*nearest), which, problem)


def connected(free: BoolGrid, start: Point, goal: Point) -> bool:
    """Whether two free pixels are connected without cutting a corner."""
    labels = pieces_of(free)
    at_start, at_goal = labels[start[::-1]], labels[goal[::-1]]
    return bool(at_start == at_goal and at_start > 0)


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
