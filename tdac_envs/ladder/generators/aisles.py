"""Aisles: a warehouse of shelves, some of which reach a wall, and parked pallets."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from tdac_envs.grid.grid import BoolGrid
from tdac_envs.ladder.generators.draft import (
    Band,
    GeneratorParameters,
    Share,
    WorldDraft,
    as_places,
    frame,
    pixels,
    whole_pixels,
)
from tdac_envs.ladder.generators.lanes import Lane, lanes_from, spread
from tdac_envs.ladder.random_stream import RandomStream


class Aisles(GeneratorParameters):
    """Parameters of aisles."""

    name: Literal["aisles"] = "aisles"
    aisles: Band = Field((1.15, 1.6), description="Width, body diameters.")
    shelves: Band = Field((0.5, 1.1), description="Depth, body diameters.")
    blocks: Band = Field((1.8, 4.0), description="Length of shelves, body diameters.")
    closed: Share = Field(
        0.45, description="Chance that a gap between two shelves is closed."
    )
    pallets: Share = Field(
        0.12, description="Chance that a pallet stands in an aisle beside a shelf."
    )


def draw(random: RandomStream, params: Aisles, body: float) -> WorldDraft:
    """Draws a warehouse whose shelves stand in columns.

    Args:
        random: Random numbers.
        params: Size and shape.
        body: Diameter of the body, px.
    """
    cells = np.zeros((params.height, params.width), np.bool_)
    wall = random.integer(2, 4)
    frame(cells, wall)
    columns = _lanes(random, params.aisles, params.shelves, body, wall, params.width)
    rows = _lanes(random, params.aisles, params.blocks, body, wall, params.height)
    for x0, x1 in columns[1::2]:
        for y0, y1 in rows[1::2]:
            _shelf(cells, x0, x1, y0, y1)
        for y0, y1 in rows[::2]:
            if random.chance(params.closed):
                _shelf(cells, x0, x1, y0, y1)
    places = [
        ((x0 + x1 - 1) // 2, (y0 + y1 - 1) // 2)
        for i, (x0, x1) in enumerate(columns)
        for j, (y0, y1) in enumerate(rows)
        if i % 2 == 0
    ]
    for x0, x1 in columns[::2]:
        for y0, y1 in rows[1::2]:
            if random.chance(params.pallets):
                _pallet(random, cells, (x0, x1), (y0, y1), body)
    clear = [(x, y) for x, y in places if not cells[y, x]]
    return WorldDraft(cells, as_places(clear))


def _lanes(
    random: RandomStream,
    aisles: tuple[float, float],
    shelves: tuple[float, float],
    body: float,
    wall: int,
    extent: int,
) -> list[Lane]:
    """Begin and end of aisle, shelf, aisle, …, aisle from wall to wall, px."""
    widths = [pixels(random, aisles, body)]
    left = extent - 2 * wall - widths[0]
    least = whole_pixels(shelves[0], body), whole_pixels(aisles[0], body)
    while left >= sum(least):
        drawn = pixels(random, shelves, body), pixels(random, aisles, body)
        chosen = drawn if sum(drawn) <= left else least
        widths += chosen
        left -= sum(chosen)
    return lanes_from(wall, spread(random, widths, left))


def _shelf(cells: BoolGrid, x0: int, x1: int, y0: int, y1: int) -> None:
    cells[y0:y1, x0:x1] = True


def _pallet(
    random: RandomStream, cells: BoolGrid, lane: Lane, along: Lane, body: float
) -> None:
    """Parks a square pallet at one side of an aisle, or one that fills its width."""
    side = whole_pixels(random.uniform(0.4, 0.9), body)
    begin = random.integer(along[0], max(along[1] - side, along[0]))
    width = lane[1] - lane[0]
    across = width if random.chance(0.5) else min(side, width)
    x0 = lane[0] if random.chance(0.5) else lane[1] - across
    cells[begin : begin + side, x0 : x0 + across] = True
