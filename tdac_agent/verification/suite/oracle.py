"""Exact answers, for comparison with a controller's own functions."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tdac_envs.grid.grid import BoolGrid
from tdac_envs.grid.plan import path_length, plan_path

Point = tuple[int, int]

# Number of walks, number of starts to try, and number of legs of a walk.
WALKS, MOST_STARTS, LEGS = 3, 200, 5

# Seeds of random grids on which wrong heuristics give paths longer than 1.15 times the
# shortest: a diagonal step counted as two, or 2 to 20 times the distance.
DEAR_DIAGONALS = (2119, 2260)
DETOURS = (561, 702, 877, 1184, 1310, *DEAR_DIAGONALS)


@dataclass(frozen=True, slots=True)
class PlanCase:
    """A planning question with its answer.

    Attributes:
        name: Name for messages.
        occ: Shape (height, width), bool `[y, x]`, True = occupied.
        start: Pixel (x, y).
        goal: Pixel (x, y).
        length: Octile length of the shortest path, px; inf if there is no path.
    """

    name: str
    occ: BoolGrid
    start: Point
    goal: Point
    length: float


class Oracle:
    """Shortest paths, reachability and nearest free pixels, by exact search."""

    def shortest_length(self, occ: BoolGrid, start: Point, goal: Point) -> float:
        """Returns the octile length of the shortest 8-connected path, px.

        The path cuts no corners; inf if an end is occupied or there is no path.

        Args:
            occ: Shape (height, width), bool `[y, x]`, True = occupied.
            start: Pixel (x, y).
            goal: Pixel (x, y).
        """
        path = plan_path(~occ, start, goal)
        return path_length(path) if len(path) else math.inf

    def path_error(self, occ: BoolGrid, path: list[Point], cell: int = 1) -> str | None:
        """Returns the first error in a path of pixels, or None.

        Args:
            occ: Shape (height, width), bool `[y, x]`, True = occupied.
            path: Pixels (x, y).
            cell: Length of a straight step, px.
        """
        height, width = occ.shape
        for x, y in path:
            if not (0 <= x < width and 0 <= y < height):
                return f"({x}, {y}) lies outside the map of {width} x {height} px"
            if occ[y, x]:
                return f"({x}, {y}) is occupied"
        for (x0, y0), (x1, y1) in pairwise(path):
            dx, dy = x1 - x0, y1 - y0
            if max(abs(dx), abs(dy)) != cell or abs(dx) not in (0, abs(dy), cell):
                return f"({x0}, {y0}) -> ({x1}, {y1}) is not a step to a neighbour"
            if dx and dy and (occ[y0, x1] or occ[y1, x0]):
                return f"({x0}, {y0}) -> ({x1}, {y1}) cuts an occupied corner"
        return None

    def path_length(self, path: list[Point]) -> float:
        """Returns the Euclidean length of a polyline, px."""
        return sum(math.dist(a, b) for a, b in pairwise(path))

    def nearest_free_distance(self, occ: BoolGrid, x: int, y: int) -> float:
        """Returns the Euclidean distance from (x, y) to the nearest free pixel, px."""
        rows, columns = np.nonzero(~occ)
        if rows.size == 0:
            return math.inf
        return float(np.sqrt(((columns - x) ** 2 + (rows - y) ** 2).min()))

    def grid(
        self, seed: int, width: int = 40, height: int = 30, density: float = 0.25
    ) -> BoolGrid:
        """Returns a seeded random grid."""
        random = np.random.default_rng(seed)
        return np.asarray(random.random((height, width)) < density)

    def walks(
        self, occ: BoolGrid, cell: int, random: np.random.Generator
    ) -> Iterator[tuple[Point, Point]]:
        """Yields random pairs of nearby free pixels that steps of `cell` px connect.

        Args:
            occ: Shape (height, width), bool `[y, x]`, True = occupied.
            cell: Length of a straight step, px.
            random: Random number generator.
        """
        height, width = occ.shape
        count = 0
        for _ in range(MOST_STARTS):
            start = int(random.integers(width)), int(random.integers(height))
            goal = self._walk(occ, start, cell, random)
            if goal != start:
                count += 1
                yield start, goal
            if count == WALKS:
                return

    def _walk(
        self, occ: BoolGrid, start: Point, cell: int, random: np.random.Generator
    ) -> Point:
        """Returns the end of a random walk; the start if no step is possible."""
        here = start
        for dx, dy, steps in random.integers((-1, -1, 1), (2, 2, 7), (LEGS, 3)):
            for _ in range(steps):
                step = [
                    (here[0] + k * int(dx), here[1] + k * int(dy))
                    for k in range(cell + 1)
                ]
                if self.path_error(occ, step) is not None:
                    break
                here = step[-1]
        return here

    def plan_cases(self) -> list[PlanCase]:
        """Returns fixed grids with traps, and seeded random grids."""
        cases = [self._case(*question) for question in _fixed_grids()]
        for seed in range(12):
            occ = self.grid(seed, 44, 31, 0.1 + 0.03 * seed)
            cases.append(self._random_case(seed, occ, free_ends=bool(seed % 4)))
        detours = (self._random_case(s, self.grid(s, 30, 22, 0.3)) for s in DETOURS)
        return [*cases, *detours]

    def _random_case(
        self, seed: int, occ: BoolGrid, *, free_ends: bool = True
    ) -> PlanCase:
        height, width = occ.shape
        random = np.random.default_rng(1000 + seed)
        start, goal = (
            (int(random.integers(width)), int(random.integers(height)))
            for _ in range(2)
        )
        if free_ends:
            occ[start[1], start[0]] = occ[goal[1], goal[0]] = False
        return self._case(f"random grid {seed}", occ, start, goal)

    def _case(self, name: str, occ: BoolGrid, start: Point, goal: Point) -> PlanCase:
        return PlanCase(name, occ, start, goal, self.shortest_length(occ, start, goal))


def _fixed_grids() -> list[tuple[str, BoolGrid, Point, Point]]:
    def empty() -> NDArray[np.bool_]:
        return np.zeros((30, 50), np.bool_)

    trap = empty()
    trap[5:25, 30] = trap[5, 10:31] = trap[24, 10:31] = True
    wall = empty()
    wall[:, 25] = True
    gap = wall.copy()
    gap[17, 25] = False
    diagonal = empty()
    for k in range(30):
        diagonal[k, 10 + k] = True
    speck = empty()
    speck[10, 12] = True
    return [
        ("open grid", empty(), (2, 3), (47, 26)),
        ("start is the goal", empty(), (7, 8), (7, 8)),
        ("trap", trap, (20, 15), (45, 15)),
        ("closed wall", wall, (3, 3), (46, 3)),
        ("one-pixel gap", gap, (3, 3), (46, 3)),
        ("diagonal wall, no corner cutting", diagonal, (5, 25), (45, 4)),
        ("occupied start", wall, (25, 3), (3, 3)),
        ("occupied goal", wall, (3, 3), (25, 3)),
        ("start in a lone obstacle", speck, (12, 10), (40, 20)),
        ("goal in a lone obstacle", speck, (40, 20), (12, 10)),
    ]
