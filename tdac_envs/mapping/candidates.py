"""Search and ranking of map readings with a planner's margin (Algorithm 1)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, partial
from operator import add
from typing import Literal

import numpy as np

from tdac_envs.core.errors import TaskError
from tdac_envs.grid.astar import Guide
from tdac_envs.grid.grid import clearance
from tdac_envs.grid.map_units import MapUnits
from tdac_envs.mapping.cleanup import cleanings
from tdac_envs.mapping.params import ScoreTerms
from tdac_envs.mapping.readings import plain_reading, readings
from tdac_envs.mapping.scene import MapProblem, MapReading
from tdac_envs.mapping.score import (
    GridMetrics,
    NavigationTask,
    explain,
    guide_of,
    score,
    terms_of,
)

Preset = Literal["default", "paper"]

INFLATIONS = (0, 1, 2, 3)
PAPER_CLEANUPS = (0, 4, 8, 12, 16)
MAX_DETOUR = 0.1
"""Largest share by which the planner's margin may lengthen the path."""
THREADS = 2
"""Readings evaluated in parallel; compiled code and OpenCV release the GIL."""


@dataclass(frozen=True, slots=True, eq=False)
class MapCandidate:
    """An evaluated reading of the map with a planner's margin.

    Attributes:
        reading: Which pixels are obstacles.
        inflation: Planner's margin around the body, px.
        reason: Returns why the task is infeasible; None if it is feasible. It is lazy,
            because the search for what would work is slow.
        terms: Terms of the score; None without a task or if it is infeasible.
    """

    reading: MapReading
    inflation: int = 0
    reason: Callable[[], str] | None = None
    terms: ScoreTerms | None = None

    @property
    def failure(self) -> str | None:
        """Why the task is infeasible; None if it is feasible."""
        return None if self.reason is None else self.reason()

    @property
    def score(self) -> float:
        """Score of Algorithm 1; -inf without terms."""
        return -np.inf if self.terms is None else score(self.terms)


def ranked(scene: MapProblem, preset: Preset) -> list[MapCandidate]:
    """All evaluated candidates, the chosen one first.

    Feasible candidates are sorted by descending score; infeasible ones follow in the
    order in which they were tried.

    Raises:
        TaskError: Start equals goal.
    """
    if scene.start is not None and scene.start == scene.goal:
        raise TaskError(
            f"start and goal are the same pixel {scene.units.point(*scene.start)}; "
            "choose two pixels"
        )
    search = _paper_grid if preset == "paper" else _staged_search
    tried = list(search(scene))
    # The failure of the plainest reading comes first: later readings only ignore more.
    return sorted(tried, key=lambda c: (c.reason is not None, -c.score))


def _staged_search(scene: MapProblem) -> Iterator[MapCandidate]:
    """Tries readings, each with all margins, up to the first feasible one."""
    for reading in readings(scene):
        candidates = _with_margins(scene, reading)
        yield candidates[0]
        for candidate in candidates[1:]:
            yield _without_detour(candidate, candidates[0], scene.units)
        if candidates[0].reason is None:
            return


def _without_detour(
    candidate: MapCandidate, plain: MapCandidate, units: MapUnits
) -> MapCandidate:
    """Makes a margin infeasible if it lengthens the path too much."""
    if candidate.terms is None or plain.terms is None:
        return candidate
    longer = candidate.terms.path_length / max(plain.terms.path_length, 1.0) - 1
    if longer <= MAX_DETOUR:
        return candidate
    margin = units.length(candidate.inflation)
    why = f"the margin of {margin} makes the path {longer:.0%} longer"
    return replace(candidate, reason=lambda: why, terms=None)


def _paper_grid(scene: MapProblem) -> list[MapCandidate]:
    """The full grid polarity x cleanup x inflation, without repeated computation."""
    given = scene.image.occupied
    bases = (
        [plain_reading(scene, polarity == "dark") for polarity in scene.polarities]
        if given is None
        else [MapReading(given, "given", scene.image.method)]
    )
    with ThreadPoolExecutor(THREADS) as pool:
        families = list(pool.map(partial(_family, scene), bases))
        return [c for family in families for c in _judged(scene, family, pool)]


@dataclass(frozen=True, slots=True, eq=False)
class _Family:
    """Readings of one polarity, and a guide for their paths; None if no path exists."""

    readings: list[MapReading]
    guide: Guide | None


def _family(scene: MapProblem, base: MapReading) -> _Family:
    """The reading at each strength of cleanup."""
    cleaned = cleanings(base.cells, PAPER_CLEANUPS)
    family = [
        replace(base, cells=cells, cleanup=strength)
        for cells, strength in zip(cleaned, PAPER_CLEANUPS, strict=True)
    ]
    if scene.trip is None:
        return _Family(family, None)
    clear = clearance(np.logical_and.reduce(cleaned))
    return _Family(family, guide_of(clear, scene.trip))


def _judged(
    scene: MapProblem, family: _Family, pool: ThreadPoolExecutor
) -> list[MapCandidate]:
    """The readings with each margin, up to the first infeasible one."""
    trip, guide = scene.trip, family.guide
    if trip is None:
        return [MapCandidate(reading) for reading in family.readings]
    if guide is None:
        return [_candidate(reading, trip) for reading in family.readings]
    # Readings that are equal after cleanup share their array.
    grids = {id(reading.cells): reading.cells for reading in family.readings}
    grounds = list(pool.map(GridMetrics.of, grids.values()))
    halves = pool.map(
        lambda margins: terms_of(grounds, trip, margins, guide),
        (INFLATIONS[:2], INFLATIONS[2:]),
    )
    terms = dict(zip(grids, map(add, *halves), strict=True))
    return [
        candidate
        for reading in family.readings
        for candidate in _candidates(reading, trip, terms[id(reading.cells)])
    ]


def _with_margins(scene: MapProblem, reading: MapReading) -> list[MapCandidate]:
    """The reading with each margin, up to the first infeasible one."""
    if scene.trip is None:
        return [MapCandidate(reading)]
    ground = GridMetrics.of(reading.cells)
    guide = guide_of(ground.clear, scene.trip)
    if guide is None:
        return [_candidate(reading, scene.trip)]
    (terms,) = terms_of([ground], scene.trip, INFLATIONS, guide)
    return _candidates(reading, scene.trip, terms)


def _candidates(
    reading: MapReading, trip: NavigationTask, terms: Sequence[ScoreTerms | None]
) -> list[MapCandidate]:
    candidates = []
    for inflation, each in zip(INFLATIONS, terms, strict=True):
        candidates.append(_candidate(reading, trip, inflation, each))
        if each is None:
            break
    return candidates


def _candidate(
    reading: MapReading,
    trip: NavigationTask,
    inflation: int = 0,
    terms: ScoreTerms | None = None,
) -> MapCandidate:
    why = cache(partial(explain, reading.cells, trip, inflation))
    return MapCandidate(reading, inflation, why if terms is None else None, terms)
