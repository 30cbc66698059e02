"""Mazes with loops: corridors of unequal widths, some openings narrower than both."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from tdac_envs.ladder.generators.draft import (
    Band,
    GeneratorParameters,
    Share,
    WorldDraft,
    as_places,
    pixels,
    whole_pixels,
)
from tdac_envs.ladder.generators.lanes import Lane, lanes_from, spread
from tdac_envs.ladder.random_stream import RandomStream

Cell = tuple[int, int]
Wall = tuple[Cell, Cell]


class Mazes(GeneratorParameters):
    """Parameters of mazes."""

    name: Literal["mazes"] = "mazes"
    corridors: Band = Field((1.15, 1.7), description="Width, body diameters.")
    walls: Band = Field((0.15, 0.4), description="Thickness, body diameters.")
    loops: Share = Field(0.1, description="Share of the other walls that are opened.")
    winding: Share = Field(
        0.75, description="Chance that a corridor goes on instead of branching."
    )
    pinched: Share = Field(
        0.25, description="Share of the openings narrower than their corridor."
    )


def draw(random: RandomStream, params: Mazes, body: float) -> WorldDraft:
    """Draws a maze.

    Args:
        random: Random numbers.
        params: Size and shape.
        body: Diameter of the body, px.
    """
    columns = _lanes(random, params, params.width, body)
    rows = _lanes(random, params, params.height, body)
    cells = np.ones((params.height, params.width), np.bool_)
    for x0, x1 in columns:
        for y0, y1 in rows:
            cells[y0:y1, x0:x1] = False
    narrowest = whole_pixels(params.corridors[0], body)
    for one, other in openings(
        random, params.loops, params.winding, len(columns), len(rows)
    ):
        (i, j), (k, m) = min(one, other), max(one, other)
        if i == k:
            across = _opening(random, params.pinched, columns[i], narrowest)
            cells[rows[j][1] : rows[m][0], slice(*across)] = False
        else:
            across = _opening(random, params.pinched, rows[j], narrowest)
            cells[slice(*across), columns[i][1] : columns[k][0]] = False
    centres = [
        ((x0 + x1) // 2, (y0 + y1) // 2) for x0, x1 in columns for y0, y1 in rows
    ]
    return WorldDraft(cells, as_places(centres))


def _lanes(random: RandomStream, params: Mazes, extent: int, body: float) -> list[Lane]:
    """Begin and end of each corridor along one axis, px, as many as fit."""
    widest = random.uniform(*params.corridors)
    wall = pixels(random, params.walls, body)
    widths: list[int] = []
    left = extent - wall
    while True:
        width = pixels(random, (params.corridors[0], widest), body)
        if width + wall > left:
            break
        widths.append(width)
        left -= width + wall
    offset = random.integer(0, min(left, round(body / 2)))
    widths = spread(random, widths, left - offset)
    return lanes_from(wall + random.integer(0, offset), widths, wall)


def openings(
    random: RandomStream, loops: float, winding: float, columns: int, rows: int
) -> list[Wall]:
    """The walls to open: those of a spanning tree, and some more for loops.

    Args:
        random: Random numbers.
        loops: Share of the other walls that are opened.
        winding: Chance that a corridor goes on instead of branching.
        columns: Number of columns of cells.
        rows: Number of rows of cells.

    Returns:
        Pairs of neighbouring cells (column, row).
    """
    if columns * rows == 0:
        return []
    first = (random.integer(0, columns - 1), random.integer(0, rows - 1))
    seen, active, opened = {first}, [first], []
    while active:
        newest = random.chance(winding)
        at = len(active) - 1 if newest else random.integer(0, len(active) - 1)
        here = active[at]
        fresh = [cell for cell in _beside(here, columns, rows) if cell not in seen]
        if not fresh:
            active.pop(at)
            continue
        chosen = random.choice(fresh)
        seen.add(chosen)
        active.append(chosen)
        opened.append((here, chosen))
    known = {frozenset(wall) for wall in opened}
    for i in range(columns):
        for j in range(rows):
            for other in ((i + 1, j), (i, j + 1)):
                inside = other[0] < columns and other[1] < rows
                wall = frozenset(((i, j), other))
                if inside and wall not in known and random.chance(loops):
                    opened.append(((i, j), other))
    return opened


def _beside(cell: Cell, columns: int, rows: int) -> list[Cell]:
    i, j = cell
    around = [(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)]
    return [(k, m) for k, m in around if 0 <= k < columns and 0 <= m < rows]


def _opening(random: RandomStream, pinched: float, lane: Lane, narrowest: int) -> Lane:
    """Begin and end of an opening in the wall across a corridor."""
    begin, end = lane
    if not random.chance(pinched) or end - begin <= narrowest:
        return lane
    width = random.integer(narrowest, end - begin)
    begin += random.integer(0, end - begin - width)
    return begin, begin + width
