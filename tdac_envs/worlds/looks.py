"""Colours of surfaces, as cameras see them."""

from __future__ import annotations

from dataclasses import dataclass

Colour = tuple[float, float, float]
"""Red, green and blue in [0, 1]."""


@dataclass(frozen=True, slots=True)
class Look:
    """The look of a surface.

    Attributes:
        colour: Its colour.
        other: Colour of every second square; None if the surface has only one colour.
        square: Length and width of a square, m.
        is_clear: Whether the surface is invisible.
    """

    colour: Colour
    other: Colour | None = None
    square: tuple[float, float] = (0.25, 0.25)
    is_clear: bool = False


WHITE = Look((1.0, 1.0, 1.0))
"""The look of a Shape without an appearance."""
GREY = Look((0.72, 0.72, 0.70))
"""A surface of unknown colour."""
ALUMINIUM = Look((0.80, 0.81, 0.83))
LIGHT_WOOD: Colour = (0.80, 0.71, 0.57)
DARK_WOOD: Colour = (0.52, 0.40, 0.28)

# Approximate mean colours, because the textures are not available.
_KINDS = {
    "CardboardBox": Look((0.72, 0.57, 0.40)),
    "CircleArena": ALUMINIUM,
    "E-puck": Look((0.26, 0.52, 0.27)),
    "OilBarrel": Look((0.16, 0.34, 0.58)),
    "PlasticCrate": Look((0.9, 0.2, 0.2)),
    "RectangleArena": ALUMINIUM,
    "Rock": Look((0.50, 0.48, 0.45)),
    "TrafficCone": Look((0.93, 0.40, 0.10)),
    "Wall": Look((0.85, 0.82, 0.76)),
    "WoodenBox": Look((0.40, 0.28, 0.17)),
    "WoodenPallet": Look((0.66, 0.52, 0.36)),
}


def look_of_kind(kind: str) -> Look:
    """The usual look of a node or PROTO type."""
    return _KINDS.get(kind, GREY)


def chequered(length: float, width: float) -> Look:
    """Chequered parquetry: two by two squares in each tile.

    Args:
        length: Length of a tile, m.
        width: Width of a tile, m.
    """
    return Look(LIGHT_WOOD, DARK_WOOD, (length / 2.0, width / 2.0))
