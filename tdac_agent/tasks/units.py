"""How lengths and places of an environment are told, and put on the screen.

Motion is looked at on the screen: x to the right, y down, headings clockwise, so that
right is positive, in lengths of which the robot drives about four in a step.
"""

from __future__ import annotations

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
        place: Of coordinates in the environment.
        length: Of lengths on the screen, and in words.
        scale: Lengths in one unit of a coordinate.
        up: Whether y points up, and headings are counter-clockwise.
        decimals: Of coordinates in words.
        digits: Of figures that are kept.
    """

    place: Place
    length: str
    scale: float
    up: bool
    decimals: int
    digits: int

    def on_screen(self, points: ArrayLike) -> Points:
        """Places, shape (n, 2), or poses, shape (n, 3), of the environment."""
        rows = np.array(points, np.float64)
        rows[:, :2] *= self.scale
        if self.up:
            rows[:, 1:] *= -1.0
        return rows

    def place_of(self, x: float, y: float) -> tuple[float, float]:
        """A place on the screen in the environment."""
        return x / self.scale, (-y if self.up else y) / self.scale

    def kept(self, length: float) -> float:
        """A length in the environment's unit, rounded."""
        return round(length / self.scale, self.digits)

    def kept_place(self, x: float, y: float) -> tuple[float, float]:
        """A place in the environment, rounded."""
        x, y = self.place_of(x, y)
        return round(x, self.digits), round(y, self.digits)

    def told(self, length: float) -> str:
        """A length in the environment's unit, in words."""
        return f"{length * self.scale:.0f} {self.length}"

    def told_place(self, x: float, y: float) -> str:
        """A place in the environment, in words."""
        d = self.decimals - 1
        return f"({x:z.{d}f}, {y:z.{d}f})"

    def heading_of(self, heading: float) -> float:
        """A heading on the screen in the environment."""
        return -heading if self.up else heading

    def point(self, x: float, y: float) -> str:
        """A place on the screen in words."""
        x, y = self.place_of(x, y)
        return f"({x:z.{self.decimals}f}, {y:z.{self.decimals}f})"

    def pose(self, x: float, y: float, heading: float) -> str:
        """A pose on the screen in words."""
        x, y = self.place_of(x, y)
        place = f"{x:z.{self.decimals}f} {y:z.{self.decimals}f}"
        return f"{place} {self.heading_of(heading):z.2f}"

    def box(self, low: Points, high: Points, less: int = 0) -> str:
        """A box on the screen in words: `x 3.0 to 4.5, y 0.2 to 1.0`.

        Args:
            low: Its least x and y.
            high: Its greatest.
            less: Decimals to leave out.
        """
        corners = [self.place_of(*low), self.place_of(*high)]
        (x0, x1), (y0, y1) = (sorted(values) for values in zip(*corners, strict=True))
        d = self.decimals - less
        return f"x {x0:.{d}f} to {x1:.{d}f}, y {y0:.{d}f} to {y1:.{d}f}"


PIXELS = Units("px", "px", 1.0, up=False, decimals=1, digits=2)
METRES = Units("m", "mm", 1000.0, up=True, decimals=3, digits=4)
UNITS: dict[str, Units] = {units.place: units for units in (PIXELS, METRES)}
"""By the unit of places, which reports name."""
