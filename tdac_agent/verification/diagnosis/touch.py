"""The wall nearest to the body: its side of the body and its nearest corner."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tdac_agent.tasks.units import PIXELS, Point, Units

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
    """The wall nearest to the body, in units of the screen.

    Attributes:
        wall: Its nearest point (x, y).
        bearing: Angle from the heading to that point, rad, right positive.
        gap: Gap between body and wall.
        border: Whether it is the border of the map.
        corner: Nearest outer corner of the wall within a body radius of that point.
        thing: Its name.
    """

    wall: Point
    bearing: float
    gap: float
    border: bool
    corner: Point | None
    thing: str = "wall"


def side_of(bearing: float) -> str:
    """Name of the side of the robot at a bearing (rad, right positive)."""
    return _SIDES[round(bearing / (math.pi / 4.0)) % 8]


def where_on_the_wall(touch: Touch, towards: float, units: Units = PIXELS) -> str:
    """Describes a touched point by the nearest corner.

    Args:
        touch: The touched wall.
        towards: Direction of the motion, rad.
        units: Units of its positions.

    Returns:
        Text such as `3.1 px past the corner at (319.5, 87.5)`; empty without a corner.
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
    return f"{units.far(distance)} {side} {place}"
