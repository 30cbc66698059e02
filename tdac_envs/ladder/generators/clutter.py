"""Clutter of circles: single ones and chains, with room to pass between them."""

from __future__ import annotations

from math import isqrt
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from tdac_envs.core.compiled import kernel
from tdac_envs.ladder.generators.draft import (
    Band,
    GeneratorParameters,
    Share,
    WorldDraft,
    fill_disc,
    frame,
    free_places,
)
from tdac_envs.ladder.random_stream import RandomStream

Circle = tuple[int, int, int]
"""Centre and radius, sixteenths of a px."""
Circles = NDArray[np.int64]
"""Circles, shape (n, 3)."""

_PLACES = 48
_FAILURES = 25
"""The floor is full if so many circles in a row do not fit."""
_BORDER = 2


class Clutter(GeneratorParameters):
    """Parameters of clutter."""

    name: Literal["clutter"] = "clutter"
    radii: Band = Field((0.3, 0.8), description="Radius of a circle, body diameters.")
    gaps: Band = Field((1.12, 1.4), description="Least gap to pass, body diameters.")
    chain: Annotated[int, Field(ge=1, le=100)] = Field(
        10, description="Largest number of circles that overlap in a row."
    )
    density: Share = Field(0.34, description="Share of the floor that is occupied.")


def draw(random: RandomStream, params: Clutter, body: float) -> WorldDraft:
    """Draws circles until the floor is as full as wanted, or hardly any more fit.

    Args:
        random: Random numbers.
        params: Size and shape.
        body: Diameter of the body, px.
    """
    cells = np.zeros((params.height, params.width), np.bool_)
    frame(cells, _BORDER)
    gap = _sixteenths(random.uniform(*params.gaps) * body)
    circles, count = np.empty((params.chain, 3), np.int64), 0
    wanted = round(random.uniform(0.8 * params.density, params.density) * cells.size)
    failures, occupied = 0, np.count_nonzero(cells)
    while failures < _FAILURES and occupied < wanted:
        if count + params.chain > len(circles):
            circles = np.concatenate([circles, np.empty_like(circles)])
        chain = _chain(random, params, body, circles, count, gap)
        if not chain:
            failures += 1
            continue
        failures = 0
        for circle in chain:
            fill_disc(cells, *circle)
        circles[count : count + len(chain)] = chain
        count += len(chain)
        occupied = np.count_nonzero(cells)
    return WorldDraft(cells, free_places(random, cells, _PLACES))


def _sixteenths(length: float) -> int:
    return round(16 * length)


def _chain(
    random: RandomStream,
    params: Clutter,
    body: float,
    circles: Circles,
    count: int,
    gap: int,
) -> list[Circle]:
    """A row of overlapping circles, up to the first that does not fit."""
    chain: list[Circle] = []
    x = random.integer(0, 16 * params.width)
    y = random.integer(0, 16 * params.height)
    # Directions without trigonometry: points of a square, scaled to the distance.
    ahead_x, ahead_y = random.integer(-64, 64), random.integer(-64, 64)
    for _ in range(random.integer(1, params.chain)):
        radius = _sixteenths(random.uniform(*params.radii) * body)
        if chain:
            ahead_x += random.integer(-48, 48)
            ahead_y += random.integer(-48, 48)
            length = max(isqrt(ahead_x * ahead_x + ahead_y * ahead_y), 1)
            far = 3 * (chain[-1][2] + radius) // 4
            x, y = x + far * ahead_x // length, y + far * ahead_y // length
        if not _fits(x, y, radius, circles, count, gap, params.width, params.height):
            break
        chain.append((x, y, radius))
    return chain


@kernel
def _fits(
    x: int,
    y: int,
    radius: int,
    circles: Circles,
    count: int,
    gap: int,
    width: int,
    height: int,
) -> bool:
    """Whether a circle leaves the gap to all that it does not touch.

    Args:
        x: Column of its centre, sixteenths of a px, like all lengths but the last two.
        y: Row of its centre.
        radius: Its radius.
        circles: Shape (n, 3): other circles; the first `count` are tested.
        count: Their number.
        gap: Least gap.
        width: Columns of the map, px.
        height: Rows of the map, px.
    """
    border = 16 * _BORDER
    for side, extent in ((x, 16 * width), (y, 16 * height)):
        if (
            0 < side - radius - border < gap
            or 0 < extent - side - radius - border < gap
        ):
            return False
    for k in range(count):
        touching = radius + circles[k, 2]
        apart = (x - circles[k, 0]) ** 2 + (y - circles[k, 1]) ** 2
        if touching * touching < apart < (touching + gap) ** 2:
            return False
    return True
