"""Straight motion of a disc on a grid."""

from __future__ import annotations

import math

from tdac_envs.core.compiled import kernel, read_only
from tdac_envs.grid.grid import FloatGrid
from tdac_envs.map2d.contact import first_contact

# Lower bound of the length of a piece, px. Pieces are short because the contact test
# checks all squares in the bounding box of a piece.
_SHORTEST_PIECE = 4.0

Point = tuple[float, float]


def is_line_free(clear: FloatGrid, begin: Point, end: Point, radius: float) -> bool:
    """Whether a disc touches nothing between two points; see `is_straight_path_free`.

    Args:
        clear: `Terrain.padded_clear`, px.
        begin: Point (x, y), px.
        end: Point (x, y), px.
        radius: Radius of the disc, px.
    """
    numbers = map(float, (*begin, *end, radius))
    return bool(is_straight_path_free(read_only(clear), *numbers))


@kernel
def is_straight_path_free(
    clear: FloatGrid, x: float, y: float, to_x: float, to_y: float, radius: float
) -> bool:
    """Whether a disc touches nothing on the straight line between two points.

    Args:
        clear: Padded clearance, px.
        x: Column of the first point, px.
        y: Row of the first point, px.
        to_x: Column of the second point, px.
        to_y: Row of the second point, px.
        radius: Radius of the disc, px.
    """
    length = math.hypot(to_x - x, to_y - y)
    heading = math.atan2(to_y - y, to_x - x)
    pieces = max(math.ceil(length / max(radius, _SHORTEST_PIECE)), 1)
    for k in range(pieces):
        at_x = x + (to_x - x) * k / pieces
        at_y = y + (to_y - y) * k / pieces
        touch = first_contact(clear, at_x, at_y, heading, length / pieces, 0.0, radius)
        if touch <= 1.0:
            return False
    return True
