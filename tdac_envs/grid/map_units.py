"""Units in which a user types and reads places and lengths on a map."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from tdac_envs.grid.metric import Framed, Point, resolution_of, to_metres, to_pixels

_DIGITS = 9
"""Decimals in px and rad, so that metres that were written give the same again."""


@dataclass(frozen=True, slots=True)
class MapFrame:
    """The frame of a ROS map; see `metric.to_pixels`.

    Attributes:
        height: Number of rows of the map, px.
        resolution: Metres per pixel.
        origin: Pose (x, y, yaw) of the lower-left pixel, m and rad.
    """

    height: int
    resolution: float
    origin: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class MapUnits:
    """Pixels, or metres in the map's frame.

    Computations use pixels; these units are only for input and output.

    Attributes:
        frame: Frame of the map, for metres; None for pixels.
        typed: Places that the user typed in metres: each in px, and as typed.
    """

    frame: MapFrame | None = None
    typed: tuple[tuple[Point, Point], ...] = ()

    @classmethod
    def metres(cls, framed: Framed) -> MapUnits:
        """Metres in the frame of a map.

        Raises:
            MapError: The map has no resolution.
        """
        resolution = resolution_of(framed)
        return cls(MapFrame(framed.height, resolution, framed.origin))

    def with_typed(self, *places: Point | None) -> MapUnits:
        """The same units, which quote these places as the user typed them.

        A place is otherwise quoted at the centre of the pixel that contains it.
        """
        if self.frame is None:
            return self
        known = [place for place in places if place is not None]
        return replace(self, typed=tuple((self.pixels(p), p) for p in known))

    @property
    def name(self) -> str:
        """`px` or `m`."""
        return "px" if self.frame is None else "m"

    @property
    def place(self) -> str:
        """The word for a point of the map: `pixel` or `place`."""
        return "pixel" if self.frame is None else "place"

    @property
    def per_pixel(self) -> float:
        """Size of a pixel in these units."""
        return 1.0 if self.frame is None else self.frame.resolution

    @property
    def decimals(self) -> int:
        """Number of decimals that gives a place to a tenth of a pixel or better."""
        if self.frame is None:
            return 0
        return max(0, math.ceil(1 - math.log10(self.per_pixel)))

    def pixels(self, point: Point) -> Point:
        """The pixel coordinates of a place in these units."""
        if self.frame is None:
            return point
        x, y = to_pixels(self.frame, *point)
        return round(x, _DIGITS), round(y, _DIGITS)

    def length_in_pixels(self, length: float) -> float:
        """A length in these units, converted to px."""
        return length if self.frame is None else round(length / self.per_pixel, _DIGITS)

    def written_length(self, length: float) -> float:
        """A length in px, converted for a file; reading it gives the same."""
        return length if self.frame is None else round(length * self.per_pixel, 12)

    def written_place(self, x: float, y: float) -> Point:
        """A place in px, converted for a file; see `written_length`."""
        if self.frame is None:
            return float(x), float(y)
        u, v = self.coordinates(x, y)
        return round(u, 12), round(v, 12)

    def heading_in_pixels(self, heading: float) -> float:
        """Converts a heading from the x axis towards the y axis, rad, to the picture.

        In the picture, y points down. In a map's frame, y points up, and the frame may
        be rotated.
        """
        if self.frame is None:
            return heading
        return round(self.frame.origin[2] - heading, _DIGITS)

    def heading(self, in_pixels: float) -> float:
        """Converts a heading of the picture, rad; the inverse of the above."""
        return self.heading_in_pixels(in_pixels)

    def coordinates(self, x: float, y: float) -> Point:
        """The coordinates of a pixel in these units."""
        return (x, y) if self.frame is None else to_metres(self.frame, x, y)

    def point(self, x: float, y: float) -> str:
        """Formats a place in px: `(12, 40)`, `(1.225, -3.05)`."""
        if self.frame is None:
            return f"({x:g}, {y:g})"
        for place, typed in self.typed:
            if (x, y) in (place, _pixel(place)):
                return f"({typed[0]:.10g}, {typed[1]:.10g})"
        first, second = (self.rounded(value) for value in self.coordinates(x, y))
        return f"({first}, {second})"

    def length(self, length: float, decimals: int | None = None) -> str:
        """Formats a length in px: `12 px`, `0.6 m`.

        Args:
            length: The length, px.
            decimals: Decimals of a length that is shown in px; None for as needed.
        """
        return f"{self.number(length, decimals)} {self.name}"

    def number(self, length: float, decimals: int | None = None) -> str:
        """Formats a length in px as `length` does, without the unit."""
        if self.frame is None:
            return f"{length:g}" if decimals is None else f"{length:.{decimals}f}"
        fewer = 0 if decimals is None else max(0, 1 - decimals)
        return self.rounded(length * self.per_pixel, self.decimals - fewer)

    def at_most(self, length: float) -> str:
        """Formats a length in px, rounded down, so that a body of this radius fits."""
        scale = 10 if self.frame is None else 10**self.decimals
        floor = math.floor(length * self.per_pixel * scale + 1e-9) / scale
        if self.frame is None:
            return f"{floor:.1f} px"
        return f"{self.rounded(floor)} m"

    def rounded(self, value: float, decimals: int | None = None) -> str:
        """A number in these units, rounded to `decimals`, without trailing zeros."""
        places = self.decimals if decimals is None else max(decimals, 0)
        text = f"{value:z.{places}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text


def _pixel(place: Point) -> Point:
    """The centre of the pixel that contains a place."""
    return math.floor(place[0] + 0.5), math.floor(place[1] + 0.5)


PIXELS = MapUnits()
