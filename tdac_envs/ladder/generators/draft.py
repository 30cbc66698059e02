"""What a generator draws: a floor with its obstacles, and where a task may begin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from tdac_envs.core.compiled import kernel
from tdac_envs.core.strict_model import StrictModel
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.ladder.random_stream import FRACTIONS, RandomStream

Places = NDArray[np.int64]

LARGEST_SIDE = 2048


def ordered(band: tuple[float, float]) -> tuple[float, float]:
    """The band; for models.

    Raises:
        ValueError: Its ends are in the wrong order.
    """
    if band[0] > band[1]:
        raise ValueError(f"expected the smaller number first, got {list(band)}")
    return band


Size = Annotated[float, Field(gt=0, le=100)]
Band = Annotated[tuple[Size, Size], AfterValidator(ordered)]
"""Smallest and largest value of a size, in body diameters."""
Share = Annotated[float, Field(ge=0, le=1)]


class GeneratorParameters(StrictModel):
    """Parameters that all generators have."""

    width: int = Field(220, ge=16, le=LARGEST_SIDE, description="Columns, px.")
    height: int = Field(220, ge=16, le=LARGEST_SIDE, description="Rows, px.")


@dataclass(frozen=True, slots=True, eq=False)
class WorldDraft:
    """A world that is not yet admitted.

    Attributes:
        cells: Shape (height, width), bool, True = occupied.
        places: Shape (n, 2), int64: pixels (x, y) for the start and the goal.
        touched: Shape (height, width), bool: also the pixels of which an obstacle
            occupies a part. The gap is measured on them; by default on `cells`.
    """

    cells: BoolGrid
    places: Places
    touched: BoolGrid | None = None

    def turned(self, quarters: int, mirrored: bool) -> WorldDraft:
        """This draft mirrored at the vertical axis, then turned by `quarters` * 90°."""
        cells, places = self.cells, self.places
        if mirrored:
            cells = cells[:, ::-1]
            places = np.column_stack([cells.shape[1] - 1 - places[:, 0], places[:, 1]])
        for _ in range(quarters % 4):
            # Turns anticlockwise on the screen, where y points down.
            places = np.column_stack([places[:, 1], cells.shape[1] - 1 - places[:, 0]])
            cells = np.rot90(cells)
        return WorldDraft(np.ascontiguousarray(cells), places)


def as_places(points: Sequence[tuple[int, int]]) -> Places:
    """Points (x, y) as an array of shape (n, 2), also if there are none."""
    return np.array(points, np.int64).reshape(-1, 2)


def free_places(random: RandomStream, cells: BoolGrid, count: int) -> Places:
    """Random free pixels (x, y); none if there are none.

    Args:
        random: Random numbers.
        cells: Shape (height, width), bool, True = occupied.
        count: Their number.
    """
    free = np.flatnonzero(~cells)
    count = count if len(free) else 0
    picked = free[
        np.array([random.integer(0, len(free) - 1) for _ in range(count)], int)
    ]
    rows, columns = np.divmod(picked.astype(np.int64), cells.shape[1])
    return np.column_stack([columns, rows])


def pixels(random: RandomStream, band: tuple[float, float], body: float) -> int:
    """A length drawn from a band of body diameters, px, rounded up.

    Args:
        random: Random numbers.
        band: Smallest and largest length, body diameters.
        body: Diameter of the body, px.
    """
    low, high = (whole_pixels(size, body) for size in band)
    return random.integer(low, high)


def whole_pixels(size: float, body: float) -> int:
    """A length of `size` body diameters in px, rounded up from a multiple of 2**-16."""
    return -(-round(size * body * FRACTIONS) // FRACTIONS)


def fill_disc(cells: BoolGrid, x: int, y: int, radius: int, value: bool = True) -> None:
    """Sets the pixels whose centre is in a disc; all numbers in sixteenths of a px."""
    _fill_disc(cells, x, y, radius, value)


@kernel
def _fill_disc(cells: BoolGrid, x: int, y: int, radius: int, value: bool) -> None:
    height, width = cells.shape
    for j in range(max((y - radius) >> 4, 0), min(((y + radius) >> 4) + 2, height)):
        for i in range(max((x - radius) >> 4, 0), min(((x + radius) >> 4) + 2, width)):
            if (16 * i - x) ** 2 + (16 * j - y) ** 2 <= radius * radius:
                cells[j, i] = value


def frame(cells: BoolGrid, thickness: int) -> None:
    """Draws a wall along the border of the map."""
    cells[:thickness] = cells[-thickness:] = True
    cells[:, :thickness] = cells[:, -thickness:] = True
