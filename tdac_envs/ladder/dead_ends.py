"""How far a robot without a map is lured into dead ends."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, read_only, subkernel
from tdac_envs.grid.grid import BoolGrid, body_free, clearance
from tdac_envs.grid.plan import Path, plan_path
from tdac_envs.ladder.worlds import LadderWorld
from tdac_envs.map2d.rays import LeapGrid, cast_ray, directions_of

Pixel = tuple[int, int]


class DeadEnds(NamedTuple):
    """What an optimistic robot without a map loses.

    Attributes:
        depth: Largest increase of the length of the shortest path to the goal above its
            least value so far, divided by L.
        excess: Length of its whole path beyond the shortest path, divided by L.
    """

    depth: float
    excess: float


class RangeSensor(NamedTuple):
    """Range rays.

    Attributes:
        angles: Their angles from the heading, rad.
        range_max: Their range, px.
    """

    angles: NDArray[np.float64]
    range_max: float


def dead_ends(world: LadderWorld, radius: float, sensor: RangeSensor) -> DeadEnds:
    """Drives a disc that assumes unseen space to be free, and replans.

    The drive is one of pixels: at each pixel the sensor looks ahead, and if the known
    obstacles block the shortest path on the grid, there is a new path. A disc
    that would touch an unseen obstacle stops and knows it from then on.

    Args:
        world: The world.
        radius: Radius of the disc, px.
        sensor: Its sensor.
    """
    rays = read_only(directions_of(sensor.angles))
    known = np.zeros_like(world.cells)
    fits = body_free(world.terrain.clear, radius)
    goal = (round(world.goal[0]), round(world.goal[1]))
    here = (round(world.start.x), round(world.start.y))
    shortest = lowest = float(world.field[here[1], here[0]])
    heading, driven, depth = world.start.heading, 0.0, 0.0
    path: Path = np.empty((0, 2))
    while here != goal:
        x, y = float(here[0]), float(here[1])
        reach = float(sensor.range_max)
        news = _look(world.terrain.leaps, known, x, y, float(heading), rays, reach)
        if news > 0 or len(path) == 0:
            free = body_free(clearance(known), radius)
            if not _is_free(path, free):
                path = plan_path(free, here, goal)[1:]
                heading = _heading(here, path[0])
                continue
        i, j = int(path[0, 0]), int(path[0, 1])
        if not fits[j, i]:
            _touch(known, world.cells, (i, j), radius)
            path = path[:0]
            continue
        driven += math.dist(here, (i, j))
        here, path = (i, j), path[1:]
        heading = _heading(here, path[0]) if len(path) else heading
        lowest = min(lowest, float(world.field[j, i]))
        depth = max(depth, float(world.field[j, i]) - lowest)
    # The field is rounded to float32.
    return DeadEnds(depth / shortest, max(driven / shortest - 1.0, 0.0))


def _heading(here: Pixel, to: NDArray[np.float64]) -> float:
    return math.atan2(to[1] - here[1], to[0] - here[0])


def _is_free(path: Path, free: BoolGrid) -> bool:
    pixels = path.astype(np.int64)
    return len(path) > 0 and bool(free[pixels[:, 1], pixels[:, 0]].all())


def _touch(known: BoolGrid, cells: BoolGrid, pixel: Pixel, radius: float) -> None:
    """Makes the obstacles known that a disc at a pixel touches."""
    reach = math.ceil(radius) + 1
    rows = slice(max(pixel[1] - reach, 0), pixel[1] + reach + 1)
    columns = slice(max(pixel[0] - reach, 0), pixel[0] + reach + 1)
    known[rows, columns] |= cells[rows, columns]


@kernel
def _look(
    leaps: LeapGrid,
    known: BoolGrid,
    x: float,
    y: float,
    heading: float,
    rays: NDArray[np.float64],
    range_max: float,
) -> int:
    """Makes the pixels known that the rays hit; returns how many were unknown."""
    news = 0
    for k in range(rays.shape[1]):
        angle = heading + math.atan2(rays[1, k], rays[0, k])
        length = cast_ray(leaps, x, y, angle, range_max)
        if length < range_max and _mark(leaps, known, x, y, angle, length):
            news += 1
    return news


@subkernel
def _mark(
    leaps: LeapGrid, known: BoolGrid, x: float, y: float, angle: float, length: float
) -> bool:
    """Makes the pixel known at which a ray ends; whether it was an unknown obstacle."""
    beyond = length + 1e-6
    i = math.floor(x + beyond * math.cos(angle) + 0.5)
    j = math.floor(y + beyond * math.sin(angle) + 0.5)
    if not (0 <= i < known.shape[1] and 0 <= j < known.shape[0]):
        return False
    if known[j, i] or leaps[0, j + 1, i + 1] > 0:
        return False
    known[j, i] = True
    return True
