"""Which drafts become worlds: a start, a goal and the conditions of a task on a draft.

Every condition compares integers, or numbers rounded to 2**-16, so that all machines
admit the same worlds.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import read_only
from tdac_envs.core.errors import TaskError
from tdac_envs.grid.grid import (
    BoolGrid,
    FloatGrid,
    OccupancyGrid,
    body_free,
    clearance,
)
from tdac_envs.grid.plan import distance_field
from tdac_envs.ladder.difficulty import Difficulty
from tdac_envs.ladder.generators.draft import WorldDraft
from tdac_envs.ladder.passages import bottleneck
from tdac_envs.ladder.random_stream import FRACTIONS, RandomStream, rounded
from tdac_envs.ladder.shortest import shortest_path
from tdac_envs.ladder.sight import share_in_sight
from tdac_envs.map2d.rays import leaps_of
from tdac_envs.map2d.straight import is_straight_path_free
from tdac_envs.map2d.terrain import Terrain

Pixel = tuple[int, int]
Found = TypeVar("Found")

_GOALS = 3
"""Goals that are tried on a draft."""
_MARGIN = 1.03
"""Factor by which a start must seem better than the conditions ask for."""
_ROUNDING = 1e-6


class Rejection(StrEnum):
    """Why a draft is not a world."""

    CROWDED = "no place has room for the goal"
    NEAR = "no start is far enough from the goal"
    NARROW = "the gap is too narrow"
    STRAIGHT = "a straight drive reaches the goal"
    SHORT = "the shortest path is too short"
    DIRECT = "the detour is too small"
    LONG = "the shortest path is too long"


class Conditions(NamedTuple):
    """What a task must fulfil.

    Attributes:
        radius: Radius of the body, px.
        step: Distance of one step at full speed, px.
        tolerance: Distance at which the goal is reached, px.
        min_gap: Least gap; see `Difficulty`.
        min_steps: Least OT.
        min_detour: Least detour.
    """

    radius: float
    step: float
    tolerance: float
    min_gap: float
    min_steps: float
    min_detour: float


@dataclass(frozen=True, slots=True, eq=False)
class Admitted:
    """A draft with a start and a goal that fulfil the conditions.

    Attributes:
        terrain: The map.
        start: Pixel (x, y).
        goal: Pixel (x, y).
        field: Shape (height, width), float32: length of the path on the grid from each
            pixel to the goal, px; inf if there is none.
        path: Shape (n, 2): points of the disc's shortest path, px.
        difficulty: Its figures.
    """

    terrain: Terrain
    start: Pixel
    goal: Pixel
    field: NDArray[np.float32]
    path: NDArray[np.float64]
    difficulty: Difficulty


def admit(
    draft: WorldDraft, random: RandomStream, conditions: Conditions
) -> Admitted | Rejection:
    """Draws a start and a goal on a draft, and tests them.

    Args:
        draft: The draft.
        random: Random numbers.
        conditions: What the task must fulfil.

    Returns:
        The first condition that fails, if one does; the cheap ones come first.
    """
    clear = clearance(draft.cells)
    goals = _drawn_goals(draft, clear, random, conditions)
    if not goals:
        return Rejection.CROWDED
    free = body_free(clear, conditions.radius)
    for goal in goals:
        field = distance_field(free, goal)
        start = _drawn_start(draft, field, goal, random, conditions)
        if start is not None:
            return _tested(draft, clear, start, goal, field, conditions)
    return Rejection.NEAR


def first_admitted(
    tries: int, name: str, attempt: Callable[[], Found | Rejection]
) -> tuple[Found, tuple[Rejection, ...]]:
    """What the first successful attempt returns, and why those before it failed.

    Args:
        tries: Largest number of attempts.
        name: Name of the generator, for the message.
        attempt: Draws and tests a draft.

    Raises:
        TaskError: All attempts fail.
    """
    rejected: list[Rejection] = []
    while len(rejected) < tries:
        found = attempt()
        if not isinstance(found, Rejection):
            return found, tuple(rejected)
        rejected.append(found)
    reasons = ", ".join(f"{n} × {why}" for why, n in Counter(rejected).most_common())
    raise TaskError(
        f"no feasible world from {tries} drafts of {name!r} ({reasons}); change the "
        "generator's sizes or the conditions"
    )


def _tested(
    draft: WorldDraft,
    clear: FloatGrid,
    start: Pixel,
    goal: Pixel,
    field: NDArray[np.float64],
    conditions: Conditions,
) -> Admitted | Rejection:
    """Tests a start and a goal; computes the figures on the way."""
    gap = _gap(draft, clear, start, goal, conditions)
    if gap < conditions.min_gap:
        return Rejection.NARROW
    padded = read_only(np.pad(clear, 1))
    if _straight_drive_arrives(padded, start, goal, conditions):
        return Rejection.STRAIGHT
    found = measured(draft.cells, padded, start, goal, field, gap, conditions)
    if found.difficulty.steps < conditions.min_steps:
        return Rejection.SHORT
    if found.difficulty.detour < conditions.min_detour:
        return Rejection.DIRECT
    return found


def _gap(
    draft: WorldDraft,
    clear: FloatGrid,
    start: Pixel,
    goal: Pixel,
    conditions: Conditions,
) -> float:
    """The gap, or 0 if it is too narrow."""
    cells = draft.cells
    if draft.touched is not None:
        cells, clear = draft.touched, clearance(draft.touched)
    least = (conditions.min_gap - 1.0 / FRACTIONS) * conditions.radius
    return rounded(bottleneck(cells, clear, start, goal, least) / conditions.radius)


def measured(
    cells: BoolGrid,
    padded: FloatGrid,
    start: Pixel,
    goal: Pixel,
    field: NDArray[np.float64],
    gap: float,
    conditions: Conditions,
) -> Admitted:
    """A feasible task with its figures, whatever they are.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        padded: Clearance, px, with a border of zeros.
        start: Pixel (x, y).
        goal: Pixel (x, y).
        field: Length of the path on the grid from each pixel to the goal, px.
        gap: See `Difficulty`.
        conditions: Radius, step and tolerance; the rest is not used.
    """
    bound = float(field[start[1], start[0]])
    path = shortest_path(cells, padded, start, goal, conditions.radius, bound)
    assert path is not None, "a path on the grid is a path of the disc"
    length = math.floor(path.length * FRACTIONS) / FRACTIONS
    steps = rounded((length - conditions.tolerance) / conditions.step)
    detour = rounded(length / math.dist(start, goal))
    leaps = leaps_of(cells)
    terrain = Terrain(OccupancyGrid(cells), padded[1:-1, 1:-1], padded, leaps)
    sight = rounded(share_in_sight(leaps, path.points, goal))
    density = rounded(np.count_nonzero(cells) / cells.size)
    figures = Difficulty(gap, length, steps, detour, sight, density)
    field32 = read_only(field, np.float32)
    return Admitted(terrain, start, goal, field32, path.points, figures)


def _drawn_goals(
    draft: WorldDraft, clear: FloatGrid, random: RandomStream, conditions: Conditions
) -> list[Pixel]:
    """Places that the disc cannot reach by less than the shortest path - tolerance.

    With this clearance, the disc can drive straight to the goal from wherever it fits
    within the tolerance. Nearer to walls, a goal may be reached through a gap or around
    a corner where the disc itself cannot pass.
    """
    radius, tolerance = conditions.radius, conditions.tolerance
    room = np.float32(math.sqrt(radius * radius + max(tolerance * tolerance, 0.5)))
    places = draft.places[clear[draft.places[:, 1], draft.places[:, 0]] >= room]
    return [(x, y) for x, y in random.shuffled(places.tolist())[:_GOALS]]


def _drawn_start(
    draft: WorldDraft,
    field: NDArray[np.float64],
    goal: Pixel,
    random: RandomStream,
    conditions: Conditions,
) -> Pixel | None:
    """A place from which the shortest path is probably long enough.

    Its length is estimated as that of the grid path, less the excess that a grid path
    has without obstacles.
    """
    places = draft.places
    away = np.abs(places - np.array(goal))
    straight = np.sqrt(np.square(away).sum(axis=1))
    on_grid = away.max(axis=1) + (math.sqrt(2.0) - 1.0) * away.min(axis=1)
    detours = field[places[:, 1], places[:, 0]] / np.maximum(on_grid, 1.0)
    least = conditions.min_steps * conditions.step + conditions.tolerance
    # Rounding errors must not decide.
    far = np.isfinite(detours) & (detours * straight >= _MARGIN * least + _ROUNDING)
    chosen = places[far & (detours >= _MARGIN * conditions.min_detour + _ROUNDING)]
    if len(chosen) == 0:
        return None
    x, y = chosen[random.integer(0, len(chosen) - 1)].tolist()
    return x, y


def _straight_drive_arrives(
    padded: FloatGrid, start: Pixel, goal: Pixel, conditions: Conditions
) -> bool:
    """Whether the disc gets within the tolerance on the straight line to the goal."""
    part = max(1.0 - conditions.tolerance / math.dist(start, goal), 0.0)
    end = [a + part * (b - a) for a, b in zip(start, goal, strict=True)]
    line = (*start, *end, conditions.radius)
    return bool(is_straight_path_free(padded, *map(float, line)))
