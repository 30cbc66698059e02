"""Which wall is nearest to the body, on which side of it, and how near to a corner."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tdac_agent.tasks.units import PIXELS, Units

Point = tuple[float, float]

_SIDES = (
    "front",
    "front right",
    "right",
    "rear right",
    "rear",
    "rear left",
    "left",
    "front left",
)


@dataclass(frozen=True, slots=True)
class Touch:
    """The wall that is nearest to the body.

    Attributes:
        wall: Its nearest point (x, y), px.
        bearing: Of that point, seen from the heading, rad, right positive.
        gap: Between body and wall, px.
        border: Whether it is the border of the map.
        corner: The nearest outer corner of the wall within a radius of that point.
        thing: What it is.
    """

    wall: Point
    bearing: float
    gap: float
    border: bool
    corner: Point | None
    thing: str = "wall"


def side_of(bearing: float) -> str:
    """Side of the robot, as a person sees it, at a bearing (rad, right positive)."""
    return _SIDES[round(bearing / (math.pi / 4.0)) % 8]


def where_on_the_wall(touch: Touch, towards: float, units: Units = PIXELS) -> str:
    """How a touched point lies to the nearest corner.

    Args:
        touch: What was touched.
        towards: Direction of the motion, rad.
        units: Of the places.

    Returns:
        `3.1 px past the corner at (319.5, 87.5)`; empty with no corner near.
    """
    if touch.corner is None:
        return ""
    off_x, off_y = touch.wall[0] - touch.corner[0], touch.wall[1] - touch.corner[1]
    distance = math.hypot(off_x, off_y)
    along = off_x * math.cos(towards) + off_y * math.sin(towards)
    place = f"the corner at {units.point(*touch.corner)}"
    if distance < 1.0:
        return f"at {place}"
    word = "past" if along > 0.5 * distance else "before"
    side = word if abs(along) > 0.5 * distance else "beside"
    return f"{distance:.1f} {units.length} {side} {place}"
