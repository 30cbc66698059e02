"""Units of an environment: formatting, and conversion to screen coordinates.

Diagnoses use screen coordinates: x points right, y points down, headings are clockwise
(so right is positive), and the robot drives about four units of length in a step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Points = NDArray[np.float64]
Place = Literal["px", "m"]


@dataclass(frozen=True, slots=True)
class Units:
    """The units of an environment.

    Attributes:
        place: Unit of the environment's coordinates.
        length: Unit of screen lengths and of printed lengths.
        scale: Screen lengths per unit of a coordinate.
        up: Whether the environment's y points up, with counter-clockwise headings.
        decimals: Decimals of printed coordinates.
        digits: Decimals of stored values.
    """

    place: Place
    length: str
    scale: float
    up: bool
    decimals: int
    digits: int

    def on_screen(self, points: ArrayLike) -> Points:
        """Converts places, shape (n, 2), or poses, shape (n, 3), to the screen."""
        rows = np.array(points, np.float64)
        rows[:, :2] *= self.scale
        if self.up:
            rows[:, 1:] *= -1.0
        return rows

    def place_of(self, x: float, y: float) -> tuple[float, float]:
        """Converts a place on the screen to the environment."""
        return x / self.scale, (-y if self.up else y) / self.scale

    def kept(self, length: float) -> float:
        """Converts a screen length to the environment, rounded to `digits`."""
        return round(length / self.scale, self.digits)

    def kept_place(self, x: float, y: float) -> tuple[float, float]:
        """Converts a place on the screen to the environment, rounded to `digits`."""
        x, y = self.place_of(x, y)
        return round(x, self.digits), round(y, self.digits)

    def told(self, length: float) -> str:
        """Formats a length of the environment: `12 px`, `250 mm`."""
        return f"{length * self.scale:.0f} {self.length}"

    def figure(self, length: float) -> str:
        """Formats a length of the environment with at least three digits: `12.5 px`."""
        shown = length * self.scale
        return f"{shown:.3g} {self.length}" if shown < 100 else self.told(length)

    def told_place(self, x: float, y: float) -> str:
        """Formats a place of the environment: `(12, 34)`, `(0.12, -0.34)`."""
        d = self.decimals - 1
        return f"({x:z.{d}f}, {y:z.{d}f})"

    def heading_of(self, heading: float) -> float:
        """Converts a heading on the screen to the environment."""
        return -heading if self.up else heading

    def degrees(self, heading: float) -> str:
        """Formats a heading on the screen, rad, in degrees of the environment."""
        return f"{math.degrees(self.heading_of(heading)):z.0f}"

    def point(self, x: float, y: float) -> str:
        """Formats a place on the screen in the environment's coordinates."""
        x, y = self.place_of(x, y)
        return f"({x:z.{self.decimals}f}, {y:z.{self.decimals}f})"

    def pose(self, x: float, y: float, heading: float) -> str:
        """Formats a pose on the screen: `12.0 34.5 -90`, the heading in degrees."""
        x, y = self.place_of(x, y)
        place = f"{x:z.{self.decimals}f} {y:z.{self.decimals}f}"
        return f"{place} {self.degrees(heading)}"

    def box(self, low: Points, high: Points, less: int = 0) -> str:
        """Formats a box on the screen: `x 3.0 to 4.5, y 0.2 to 1.0`.

        Args:
            low: Smallest x and y.
            high: Largest x and y.
            less: Number of decimals to omit.
        """
        corners = [self.place_of(*low), self.place_of(*high)]
        (x0, x1), (y0, y1) = (sorted(values) for values in zip(*corners, strict=True))
        d = self.decimals - less
        return f"x {x0:.{d}f} to {x1:.{d}f}, y {y0:.{d}f} to {y1:.{d}f}"


PIXELS = Units("px", "px", 1.0, up=False, decimals=1, digits=2)
METRES = Units("m", "mm", 1000.0, up=True, decimals=3, digits=4)
UNITS: dict[str, Units] = {units.place: units for units in (PIXELS, METRES)}
"""Units by `place`, which reports state."""
