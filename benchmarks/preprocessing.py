"""Times preprocessing beside a straightforward version of the same algorithm.

    python -m benchmarks preprocessing

The input is a drawn floor plan of 64 rooms with specks, holes and letter-sized blots,
so that no two strengths of cleanup have the same result. The floor is one exact
distance transform of OpenCV; Algorithm 1 needs one per cleaned grid. The growth over
the map size is compared with n log n.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.timing import Bench, Call, Effort, compared, in_turn
from tdac_envs.mapping.preprocessing import preprocess

Picture = NDArray[np.uint8]
Point = tuple[int, int]
Drawn = tuple[Picture, Point, Point]

RADIUS = 4.0
ROOMS = 8
SIZES = {0.5: 0.15, 4.0: 1.2}
"""Time limit of `preset="paper"` in seconds, by megapixels."""
GROWTH = (0.1, 0.25, 1.0, 4.0, 16.0)
FLOOR, PLAIN = "one distance transform", "OpenCV + scikit-image, 40 candidates"
PAPER, DEFAULT = 'preset="paper"', "default preset"


def benches(effort: Effort) -> list[Bench]:
    """One bench for each size, and one for the growth."""
    sizes: Mapping[float, float | None] = {0.1: None} if effort.quick else SIZES
    rounds = effort.rounds_of(5)
    found = [_at_size(size, limit, rounds) for size, limit in sizes.items()]
    growth = GROWTH[:2] if effort.quick else GROWTH
    return [*found, _growth(growth, effort.rounds_of(3))]


def floor_plan(megapixels: float, seed: int = 0) -> Drawn:
    """A picture of connected rooms, with start and goal in opposite corners."""
    rng = np.random.default_rng(seed)
    side = round(math.sqrt(1e6 * megapixels))
    room, wall = side // ROOMS, max(side // 250, 3)
    grey = np.full((side, side), 240, np.uint8)
    for i in range(ROOMS + 1):
        at = min(max(i * room, wall), side - wall)
        cv2.line(grey, (at, 0), (at, side), 20, wall)
        cv2.line(grey, (0, at), (side, at), 20, wall)
    for i in range(ROOMS):
        for j in range(ROOMS):
            _door(grey, rng, i, j, room, wall)
    _dirt(grey, rng)
    first, last = room // 2, (ROOMS - 1) * room + room // 2
    for at in (first, last):
        cv2.circle(grey, (at, at), int(RADIUS) + 5, 240, -1)
    return np.repeat(grey[..., None], 3, axis=2), (first, first), (last, last)


def _door(
    grey: Picture, rng: np.random.Generator, i: int, j: int, room: int, wall: int
) -> None:
    """Opens a door to the right or below, so that all rooms are connected."""
    if i == j == ROOMS - 1:
        return
    right = j == ROOMS - 1 or (i < ROOMS - 1 and rng.random() < 0.5)
    x, y, gap = i * room + room // 2, j * room + room // 2, room // 4
    if right:
        grey[y - gap : y + gap, (i + 1) * room - wall : (i + 1) * room + wall + 1] = 240
    else:
        grey[(j + 1) * room - wall : (j + 1) * room + wall + 1, x - gap : x + gap] = 240


def _dirt(grey: Picture, rng: np.random.Generator) -> None:
    """Blots of 1 to 25 px, dark in the open and light in the walls."""
    side = grey.shape[0]
    corners = rng.integers(0, side - 5, (side * side // 2500, 2))
    for (x, y), (width, height) in zip(
        corners, rng.integers(1, 6, corners.shape), strict=True
    ):
        grey[y : y + height, x : x + width] = 20 if grey[y, x] > 128 else 240


def cases(drawn: Drawn) -> dict[str, Call]:
    """The calls that are timed on one picture."""
    from benchmarks.plain_grid import best_score

    picture, start, goal = drawn
    free = (picture[..., 0] > 128).astype(np.uint8)
    precise = cv2.DIST_MASK_PRECISE
    return {
        FLOOR: lambda: cv2.distanceTransform(free, cv2.DIST_L2, precise),
        PAPER: partial(preprocess, picture, start, goal, RADIUS, preset="paper"),
        DEFAULT: partial(preprocess, picture, start, goal, RADIUS),
        PLAIN: lambda: best_score(picture, start, goal, RADIUS),
    }


def _at_size(megapixels: float, limit: float | None, rounds: int) -> Bench:
    every = cases(floor_plan(megapixels))
    slow = {PLAIN: every.pop(PLAIN)}
    times = {**in_turn(every, rounds), **in_turn(slow, 1)}
    title = f"Preprocessing, {megapixels:g} MPix"
    limits = {PAPER: limit, DEFAULT: 3 * limit} if limit else {}
    return compared(title, times, FLOOR, PLAIN, limits)


def _growth(sizes: tuple[float, ...], rounds: int) -> Bench:
    """Times `preset="paper"` over map sizes; the notes are relative to n log n."""
    times: dict[str, list[float]] = {}
    notes: dict[str, str] = {}
    first = f"{sizes[0]:g} MPix"
    for size in sizes:
        picture, start, goal = floor_plan(size)
        call = partial(preprocess, picture, start, goal, RADIUS, preset="paper")
        name = f"{size:g} MPix"
        times |= in_turn({name: call}, rounds)
        grown = statistics.median(times[name]) / statistics.median(times[first])
        cost = size * math.log(1e6 * size) / (sizes[0] * math.log(1e6 * sizes[0]))
        notes[name] = f"{grown / cost:.2f} x n log n"
    return compared('Growth of preset="paper"', times, first, first, notes=notes)
