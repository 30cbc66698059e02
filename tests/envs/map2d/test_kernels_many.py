"""A million rays and a million steps of the body against brute force."""

import math

import numba
import numpy as np
import pytest

from tdac_envs.core.compiled import read_only
from tdac_envs.drive.stepping import move
from tdac_envs.grid.grid import clearance
from tdac_envs.map2d.contact import first_contact
from tdac_envs.map2d.rays import cast_ray, leaps_of

MAPS = 20
EACH = 50_000
RANGE = 220.0


def some_map(seed):
    """A map of up to 160 px with walls of one pixel, specks, blocks and slants."""
    random = np.random.default_rng(seed)
    height, width = (int(v) for v in random.integers(60, 160, 2))
    cells = random.random((height, width)) < (0.0, 0.002, 0.02)[seed % 3]
    for _ in range(6):
        x, y = int(random.integers(width)), int(random.integers(height))
        w, h = (int(v) for v in random.integers(1, 40, 2))
        cells[y : y + h, x] = True
        cells[y, x : x + w] = True
        cells[y : y + h // 4, x : x + w // 4] = True
    for k in range(min(height, width) // 2):
        cells[k, (k * (1 + seed % 2)) % width] = True
    return cells, random


def squares(cells):
    """Centres of the occupied squares that have a free side, with a rim around."""
    rim = np.pad(cells, 2, constant_values=True)
    inner = np.zeros_like(rim)
    beside = rim[:-2, 1:-1] & rim[2:, 1:-1] & rim[1:-1, :-2] & rim[1:-1, 2:]
    inner[1:-1, 1:-1] = beside
    rows, columns = np.nonzero(rim & ~inner)
    return np.stack([columns - 2.0, rows - 2.0], axis=1)


@numba.njit
def slab(centres, x, y, angle, range_max):
    """Where the ray enters the nearest square: each of them is tried."""
    dx, dy = math.cos(angle), math.sin(angle)
    best = range_max
    for k in range(len(centres)):
        a, b = (centres[k, 0] - 0.5 - x) / dx, (centres[k, 0] + 0.5 - x) / dx
        c, d = (centres[k, 1] - 0.5 - y) / dy, (centres[k, 1] + 0.5 - y) / dy
        enter = max(min(a, b), min(c, d), 0.0)
        if enter <= min(max(a, b), max(c, d)) and enter < best:
            best = enter
    return best


@numba.njit
def gap_to(rim, x, y):
    """Distance from a point to the nearest square up to 4 px away: all are tried.

    `rim` is the map with 12 occupied pixels around.
    """
    best = 16.0
    column, row = math.floor(x + 0.5), math.floor(y + 0.5)
    for j in range(row - 5, row + 6):
        for i in range(column - 5, column + 6):
            if rim[j + 12, i + 12]:
                dx, dy = max(abs(i - x) - 0.5, 0.0), max(abs(j - y) - 0.5, 0.0)
                best = min(best, dx * dx + dy * dy)
    return math.sqrt(best)


@numba.njit
def worst_ray(leaps, centres, points, angles, range_max):
    worst, hits = 0.0, 0
    for k in range(len(angles)):
        x, y = points[k]
        expected = slab(centres, x, y, angles[k], range_max)
        measured = cast_ray(leaps, x, y, angles[k], range_max)
        worst = max(worst, abs(expected - measured))
        hits += expected < range_max
    return worst, hits


@numba.njit
def wrong_contacts(clear, rim, points, angles, arcs, radius):
    """Steps that should have touched and did not, or the other way round."""
    wrong, touches, passes = 0, 0, 0
    for k in range(len(angles)):
        x, y = points[k]
        forward, turn = arcs[k]
        if gap_to(rim, x, y) <= radius + 1e-6:
            continue
        touch = first_contact(clear, x, y, angles[k], forward, turn, radius)
        least, free = math.inf, math.inf
        for part in range(33):
            share = part / 32
            px, py, _ = move(x, y, angles[k], share * forward, share * turn)
            gap = gap_to(rim, px, py) - radius
            least = min(least, gap)
            if share < touch - 1e-9:
                free = min(free, gap)
        # A sampled overlap is a contact; before the contact there is none; and at it
        # the body touches.
        if least < -1e-6 and touch > 1.0:
            wrong += 1
        if free < -1e-6:
            wrong += 1
        if touch <= 1.0:
            touches += 1
            px, py, _ = move(x, y, angles[k], touch * forward, touch * turn)
            wrong += abs(gap_to(rim, px, py) - radius) > 1e-6
        else:
            passes += 1
    return wrong, touches, passes


def free_points(cells, random, count):
    """Points in free pixels."""
    rows, columns = np.nonzero(~cells)
    chosen = random.integers(0, len(rows), count)
    points = np.stack([columns[chosen], rows[chosen]], axis=1).astype(float)
    return points + random.uniform(-0.49999, 0.49999, (count, 2))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(MAPS))
def test_rays_are_those_of_brute_force(seed):
    """50,000 rays on each of 20 maps: the same to 1e-4 px, thin walls included."""
    cells, random = some_map(seed)
    points = free_points(cells, random, EACH)
    angles = random.uniform(-math.pi, math.pi, EACH)
    worst, hits = worst_ray(
        read_only(leaps_of(cells)), squares(cells), points, angles, RANGE
    )
    assert hits > EACH // 2
    assert worst < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(MAPS))
def test_contacts_are_those_of_the_disc_itself(seed):
    """50,000 steps on each of 20 maps touch when the disc does, and only then."""
    cells, random = some_map(seed)
    clear, radius = (
        read_only(np.pad(clearance(cells), 1)),
        float(random.uniform(0.3, 3.0)),
    )
    rim = np.pad(cells, 12, constant_values=True)
    points = free_points(cells, random, EACH)
    angles = random.uniform(-math.pi, math.pi, EACH)
    arcs = random.uniform((-4, -1), (4, 1), (EACH, 2))
    wrong, touches, passes = wrong_contacts(clear, rim, points, angles, arcs, radius)
    assert wrong == 0
    assert min(touches, passes) > 1000
