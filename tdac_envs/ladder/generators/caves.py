"""Caves: a cellular automaton that counts neighbours, smoothed to round walls."""

from __future__ import annotations

from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from tdac_envs.grid.grid import BoolGrid
from tdac_envs.ladder.generators.draft import (
    Band,
    GeneratorParameters,
    WorldDraft,
    frame,
    free_places,
    whole_pixels,
)
from tdac_envs.ladder.random_stream import RandomStream

_PLACES = 48
_ROUNDS = 3
_MAJORITY = 5
"""Occupied cells among a cell and its eight neighbours that make it rock."""


class Caves(GeneratorParameters):
    """Parameters of caves."""

    name: Literal["caves"] = "caves"
    grain: Band = Field((0.32, 0.5), description="Side of a cell, body diameters.")
    rock: float = Field(0.45, ge=0.3, le=0.6, description="Share of rock at first.")


def draw(random: RandomStream, params: Caves, body: float) -> WorldDraft:
    """Draws a cave; pockets without a connection to the largest one are filled.

    Args:
        random: Random numbers.
        params: Size and shape.
        body: Diameter of the body, px.
    """
    low, high = (max(whole_pixels(grain, body), 2) for grain in params.grain)
    side = random.integer(low, high)
    rows, columns = -(-params.height // side) + 1, -(-params.width // side) + 1
    rock = random.chances(params.rock, (rows, columns))
    for _ in range(_ROUNDS):
        rock = _counts(rock, 1) >= _MAJORITY
    left, top = random.integer(0, side - 1), random.integer(0, side - 1)
    cells = rock.repeat(side, axis=0).repeat(side, axis=1)
    cells = cells[top : top + params.height, left : left + params.width]
    reach = side // 2 + 2
    cells = 2 * _counts(cells, reach) > (2 * reach + 1) ** 2
    frame(cells, 3)
    cells = _without_pockets(cells)
    return WorldDraft(cells, free_places(random, cells, _PLACES))


def _counts(cells: BoolGrid, reach: int) -> NDArray[np.int32]:
    """Occupied cells in the square around each cell; there is only rock outside.

    Args:
        cells: Shape (height, width), bool.
        reach: The square has a side of 2 * reach + 1.
    """
    side = 2 * reach + 1
    free = (~np.ascontiguousarray(cells)).view(np.uint8)
    # Outside, `boxFilter` adds zeros: nothing is free there.
    near = cv2.boxFilter(
        free, cv2.CV_32S, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT
    )
    return np.asarray(side * side - near)


def _without_pockets(cells: BoolGrid) -> BoolGrid:
    """Fills all free regions but the largest; of equal ones the first stays."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        (~cells).view(np.uint8), connectivity=4
    )
    if count < 3:
        return cells
    areas = stats[:, cv2.CC_STAT_AREA]
    is_largest = areas == areas[1:].max()
    is_largest[0] = False
    first = int(np.argmax(is_largest[labels]))
    return np.asarray(labels != labels.ravel()[first])
