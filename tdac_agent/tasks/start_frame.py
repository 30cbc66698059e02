"""The frame of reference of a start pose, for texts about an episode."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from tdac_agent.tasks.units import METRES, Point, Units
from tdac_envs.drive.task import Pose


@dataclass(frozen=True, slots=True)
class StartFrame:
    """Coordinates from the start: x ahead along its heading.

    A robot without a map observes this frame (`frame: start` of a task set). y points
    to the right on maps, and to the left in worlds.

    Attributes:
        start: Start pose on the screen; see `Units`.
        name: Unit of the coordinates.
        per_pixel: Size of a screen length in this unit.
        decimals: Decimals of printed coordinates.
        up: Whether y points to the left, with counter-clockwise headings.
    """

    start: Pose
    name: str = "px"
    per_pixel: float = 1.0
    decimals: int = 1
    up: bool = False

    @classmethod
    def of(cls, start: Pose, units: Units) -> StartFrame:
        """The frame of a start pose in the units of its environment."""
        screen = Pose(*units.on_screen([start])[0].tolist())
        size = 1.0 / units.scale
        return cls(screen, units.place, size, units.decimals, units.up)

    def in_metres(self, resolution: float | None) -> StartFrame:
        """The same frame in metres, if a map has these metres per px: y to the left."""
        if resolution is None:
            return self
        digits = METRES.decimals
        return replace(self, name="m", per_pixel=resolution, decimals=digits, up=True)

    def coordinates(self, x: float, y: float) -> Point:
        """The coordinates of a place on the screen."""
        dx, dy = x - self.start.x, y - self.start.y
        cosine, sine = math.cos(self.start.heading), math.sin(self.start.heading)
        ahead, right = cosine * dx + sine * dy, cosine * dy - sine * dx
        return self.per_pixel * ahead, self.per_pixel * (-right if self.up else right)

    def pixels(self, place: Point) -> Point:
        """The place on the screen with these coordinates."""
        x, y = (side / self.per_pixel for side in place)
        y = -y if self.up else y
        cosine, sine = math.cos(self.start.heading), math.sin(self.start.heading)
        return (
            self.start.x + cosine * x - sine * y,
            self.start.y + sine * x + cosine * y,
        )

    def heading(self, in_pixels: float) -> float:
        """Converts a heading on the screen, rad."""
        turned = in_pixels - self.start.heading
        return -turned if self.up else turned

    def point(self, x: float, y: float) -> str:
        """Formats a place on the screen: `(12, -40)`."""
        first, second = self.coordinates(x, y)
        digits = self.decimals - 1
        return f"({first:z.{digits}f}, {second:z.{digits}f})"

    def length(self, length: float) -> str:
        """Formats a screen length with its unit: `12.5 px`."""
        return f"{self.per_pixel * length:.3g} {self.name}"
