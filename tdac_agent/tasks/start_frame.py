"""The frame of reference of a start pose, for texts about a map in pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from tdac_envs.drive.task import Pose

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class StartFrame:
    """Pixels from the start: x ahead along its heading, y to the right.

    A robot without a map observes this frame (`frame: start` of a task set).

    Attributes:
        start: Start pose on the map, px and rad.
    """

    start: Pose
    name: ClassVar[str] = "px"
    per_pixel: ClassVar[float] = 1.0
    decimals: ClassVar[int] = 1

    def coordinates(self, x: float, y: float) -> Point:
        """The coordinates of a place of the map."""
        dx, dy = x - self.start.x, y - self.start.y
        cosine, sine = math.cos(self.start.heading), math.sin(self.start.heading)
        return cosine * dx + sine * dy, cosine * dy - sine * dx

    def pixels(self, place: Point) -> Point:
        """The place of the map with these coordinates."""
        x, y = place
        cosine, sine = math.cos(self.start.heading), math.sin(self.start.heading)
        return (
            self.start.x + cosine * x - sine * y,
            self.start.y + sine * x + cosine * y,
        )

    def heading(self, in_pixels: float) -> float:
        """Converts a heading of the map, rad."""
        return in_pixels - self.start.heading

    def point(self, x: float, y: float) -> str:
        """Formats a place of the map: `(12, -40)`."""
        first, second = self.coordinates(x, y)
        return f"({first:z.0f}, {second:z.0f})"

    def length(self, length: float) -> str:
        """Formats a length with its unit: `12.5 px`."""
        return f"{length:.3g} px"
