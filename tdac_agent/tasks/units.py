"""Units of an environment: formatting, and conversion to screen coordinates.

Diagnoses use screen coordinates: x points right, y points down, headings are clockwise
(so right is positive), and the robot drives about four units of length in a step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tdac_envs.grid.map_units import MapFrame, MapUnits

Point = tuple[float, float]
Points = NDArray[np.float64]
Place = Literal["px", "m"]


class ShownUnits(Protocol):
    """Units and a frame for printed places on a map; arguments are in pixels."""

    @property
    def name(self) -> str:
        """Unit of length."""

    @property
    def per_pixel(self) -> float:
        """Size of a pixel in this unit."""

    @property
    def decimals(self) -> int:
        """Decimals of printed coordinates."""

    def coordinates(self, x: float, y: float) -> tuple[float, float]:
        """Coordinates of a place."""

    def heading(self, in_pixels: float) -> float:
        """A heading in the frame, rad."""

    def point(self, x: float, y: float) -> str:
        """Formats a place."""

    def length(self, length: float) -> str:
        """Formats a length with its unit."""


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
        shown: Units or frame of printed places and lengths on a map, where coordinates
            and the screen are in pixels; None for the units above.
    """

    place: Place
    length: str
    scale: float
    up: bool
    decimals: int
    digits: int
    shown: ShownUnits | None = None

    def in_metres(self, shown: ShownUnits) -> Units:
        """These units, but printed in metres of a map's frame."""
        return replace(self, length=shown.name, shown=shown)

    def from_start(self, frame: ShownUnits) -> Units:
        """These units, but printed in the frame of a start pose and its unit."""
        return replace(self, length=frame.name, shown=frame)

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

    def amount(self, length: float, decimals: int = 1) -> str:
        """Formats a screen length without its unit: `12.3`, `0.615`.

        Args:
            length: The length.
            decimals: Decimals of a length in px or mm; in metres, as precise.
        """
        if self.shown is not None:
            length *= self.shown.per_pixel
            decimals = max(self._decimals - max(1 - decimals, 0), 0)
        return f"{length:.{decimals}f}"

    def far(self, length: float, decimals: int = 1) -> str:
        """Formats a screen length as `amount` does, with its unit: `12.3 px`."""
        return f"{self.amount(length, decimals)} {self.length}"

    def length_text(self, length: float) -> str:
        """Formats a length of the environment: `12 px`, `250 mm`, `0.61 m`."""
        return self.far(length * self.scale, 0)

    def figure(self, length: float) -> str:
        """Formats a length of the environment with at least three digits: `12.5 px`."""
        if self.shown is not None:
            return self.shown.length(length * self.scale)
        shown = length * self.scale
        return f"{shown:.3g} {self.length}" if shown < 100 else self.length_text(length)

    def place_text(self, x: float, y: float) -> str:
        """Formats a place of the environment: `(12, 34)`, `(0.12, -0.34)`."""
        if self.shown is not None:
            return self.shown.point(x, y)
        d = self.decimals - 1
        return f"({x:z.{d}f}, {y:z.{d}f})"

    def heading_of(self, heading: float) -> float:
        """Converts a heading on the screen to that of the printed frame."""
        if self.shown is not None:
            return math.remainder(self.shown.heading(heading), math.tau)
        return -heading if self.up else heading

    def degrees(self, heading: float) -> str:
        """Formats a heading on the screen, rad, in degrees of the environment."""
        return f"{math.degrees(self.heading_of(heading)):z.0f}"

    def point(self, x: float, y: float) -> str:
        """Formats a place on the screen in the coordinates of the printed frame."""
        return f"({self._coordinates(x, y, ', ')})"

    def pose(self, x: float, y: float, heading: float) -> str:
        """Formats a pose on the screen: `12.0 34.5 -90`, the heading in degrees."""
        return f"{self._coordinates(x, y, ' ')} {self.degrees(heading)}"

    def box(self, low: Points, high: Points, less: int = 0) -> str:
        """Formats a box on the screen: `x 3.0 to 4.5, y 0.2 to 1.0`.

        Args:
            low: Smallest x and y.
            high: Largest x and y.
            less: Number of decimals to omit.
        """
        (left, top), (right, bottom) = low.tolist(), high.tolist()
        corners = [(left, top), (right, top), (left, bottom), (right, bottom)]
        xs, ys = zip(*(self._place(*corner) for corner in corners), strict=True)
        d = self._decimals - less
        x, y = (f"{min(v):.{d}f} to {max(v):.{d}f}" for v in (xs, ys))
        return f"x {x}, y {y}"

    @property
    def printed_place(self) -> str:
        """Unit of printed places."""
        return self.place if self.shown is None else self.shown.name

    @property
    def _decimals(self) -> int:
        return self.decimals if self.shown is None else self.shown.decimals

    def _place(self, x: float, y: float) -> tuple[float, float]:
        """A place on the screen in the coordinates of the printed frame."""
        if self.shown is not None:
            return self.shown.coordinates(x, y)
        return self.place_of(x, y)

    def _coordinates(self, x: float, y: float, joint: str) -> str:
        return joint.join(f"{value:z.{self._decimals}f}" for value in self._place(x, y))


PIXELS = Units("px", "px", 1.0, up=False, decimals=1, digits=2)
METRES = Units("m", "mm", 1000.0, up=True, decimals=3, digits=4)
UNITS: dict[str, Units] = {units.place: units for units in (PIXELS, METRES)}
"""Units by `place`, which reports state."""

Frame = tuple[int, float, float, float, float]
"""Height of a map, px; metres per px; origin (x, y, yaw) of its lower left pixel."""


def frame_of(units: Units) -> Frame | None:
    """The frame of a map in whose metres units are printed; None for other units."""
    shown = units.shown
    if not isinstance(shown, MapUnits) or shown.frame is None:
        return None
    return shown.frame.height, shown.frame.resolution, *shown.frame.origin


def units_in(place: Place, frame: Frame | None) -> Units:
    """The units of a report: those of an environment, printed in metres of a frame."""
    if frame is None:
        return UNITS[place]
    height, resolution, *origin = frame
    return UNITS[place].in_metres(
        MapUnits(MapFrame(height, resolution, (origin[0], origin[1], origin[2])))
    )
