"""Floors for the e-puck: plates on the borders of cells, turned boxes and cylinders."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from tdac_envs.core.strict_model import StrictModel
from tdac_envs.ladder.generators.blocks import PIXEL, Block, Box, Cylinder
from tdac_envs.ladder.generators.draft import Places, Share, as_places, ordered
from tdac_envs.ladder.generators.lanes import Lane, lanes_from
from tdac_envs.ladder.generators.mazes import openings
from tdac_envs.ladder.random_stream import RandomStream

Metres = Annotated[float, Field(ge=0.01, le=5.0)]
MetreBand = Annotated[tuple[Metres, Metres], AfterValidator(ordered)]
"""Smallest and largest value of a length, m."""


class Plates(StrictModel):
    """Parameters of plates; lengths are multiples of 5 mm."""

    name: Literal["plates"] = "plates"
    sides: MetreBand = Field((1.2, 2.0), description="Sides of the floor, m.")
    passages: MetreBand = Field((0.22, 0.3), description="Width of a passage, m.")
    thickness: MetreBand = Field((0.01, 0.02), description="Of a plate, m.")
    loops: Share = Field(0.15, description="Share of the other walls that are opened.")
    winding: Share = Field(
        0.75, description="Chance that a passage goes on instead of branching."
    )
    things: Share = Field(
        0.3, description="Share of the cells with a turned box or a cylinder."
    )


@dataclass(frozen=True, slots=True)
class PlatesDraft:
    """A floor that is not yet admitted.

    Attributes:
        columns: Width of the floor, pixels of `blocks.PIXEL`.
        rows: Depth of the floor, pixels.
        plates: Thin walls.
        things: Boxes and cylinders in the cells.
        places: Shape (n, 2), int64: pixels (x, y) for the start and the goal; the wall
            around the floor is one pixel thick.
    """

    columns: int
    rows: int
    plates: tuple[Box, ...]
    things: tuple[Block, ...]
    places: Places


_BOX, _RADIUS = (25, 70), (12, 35)
"""Sides of a box and radius of a cylinder, mm."""
_ROOM = 50
"""Least distance from the centre of a thing to the border of its cell, mm."""


def draw(random: RandomStream, params: Plates) -> PlatesDraft:
    """Draws a floor.

    Args:
        random: Random numbers.
        params: Size and shape.
    """
    thick = _pixels(random, params.thickness)
    width, depth = _pixels(random, params.sides), _pixels(random, params.sides)
    columns = _lanes(random, params, width, thick)
    rows = _lanes(random, params, depth, thick)
    opened = openings(random, params.loops, params.winding, len(columns), len(rows))
    joined = {(min(wall), max(wall)) for wall in opened}
    plates = [
        _plate(columns[i], (rows[j][1], rows[j][1] + thick), width, depth, thick)
        for i in range(len(columns))
        for j in range(len(rows) - 1)
        if ((i, j), (i, j + 1)) not in joined
    ]
    plates += [
        _plate(rows[j], (columns[i][1], columns[i][1] + thick), depth, width, thick, 1)
        for i in range(len(columns) - 1)
        for j in range(len(rows))
        if ((i, j), (i + 1, j)) not in joined
    ]
    things = [
        _thing(random, x, y, width, depth)
        for x in columns
        for y in rows
        if random.chance(params.things)
    ]
    places = [((a + b) // 2 + 1, (c + d) // 2 + 1) for a, b in columns for c, d in rows]
    return PlatesDraft(width, depth, tuple(plates), tuple(things), as_places(places))


def _pixels(random: RandomStream, band: tuple[float, float]) -> int:
    """A length drawn from a band, pixels."""
    return random.integer(*_whole(band))


def _whole(band: tuple[float, float]) -> tuple[int, int]:
    """A band of metres in whole pixels; never empty."""
    low, high = (round(1000 * side) // PIXEL for side in band)
    return low, high


def _lanes(random: RandomStream, params: Plates, extent: int, thick: int) -> list[Lane]:
    """Begin and end of each passage along one axis, pixels; none if none can be."""
    low, high = _whole(params.passages)
    counts = [
        n
        for n in range(1, extent // low + 1)
        if n * low <= extent - (n - 1) * thick <= n * high
    ]
    if not counts:
        return []
    count = random.choice(counts)
    each, more = divmod(extent - (count - 1) * thick, count)
    widths = random.shuffled([each + 1] * more + [each] * (count - more))
    for k in range(count - 1):
        one, other = widths[k], widths[k + 1]
        least = -min(one - low, high - other)
        change = random.integer(least, min(high - one, other - low))
        widths[k], widths[k + 1] = one + change, other - change
    return lanes_from(0, widths, thick)


def _plate(
    along: Lane, across: Lane, length: int, depth: int, thick: int, axis: int = 0
) -> Box:
    """The plate beside a cell; it reaches across the corners of the cell.

    Args:
        along: Begin and end of the cell, pixels.
        across: Begin and end of the plate's thickness, pixels.
        length: Side of the floor along the plate, pixels.
        depth: The other side, pixels.
        thick: Thickness of the plates, pixels.
        axis: 0 for a plate along x, 1 for one along y.
    """
    begin, end = max(along[0] - thick, 0), min(along[1] + thick, length)
    middle = (begin + end - length) * PIXEL, (sum(across) - depth) * PIXEL
    sides = (end - begin) * PIXEL, thick * PIXEL
    if axis:
        return Box(middle[1], middle[0], sides[1], sides[0])
    return Box(*middle, *sides)


def _thing(random: RandomStream, x: Lane, y: Lane, width: int, depth: int) -> Block:
    """A turned box or a cylinder in a cell."""
    at = _within(random, x, width), _within(random, y, depth)
    if random.chance(0.5):
        return Cylinder(*at, random.integer(*_RADIUS))
    sides = random.integer(*_BOX), random.integer(*_BOX)
    return Box(*at, *sides, random.integer(0, 179))


def _within(random: RandomStream, lane: Lane, extent: int) -> int:
    """A coordinate in a cell, from the centre of the floor, half mm."""
    begin, end = (2 * edge * PIXEL - extent * PIXEL for edge in lane)
    room = min(2 * _ROOM, (end - begin) // 2)
    return random.integer(begin + room, end - room)
