"""Footprints: discs and convex polygons in the ground plane, metres.

Numbers are rounded to 1e-9 m, and each shape has one canonical form: two shapes of
the same type are equal exactly when they cover the same area.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tdac_envs.core.errors import WorldError

DIGITS = 9
THINNEST = 1e-4
"""Minimum thickness, used for shapes that are flat in the file, m."""
Points = NDArray[np.float64]
Point = tuple[float, float]


def metres(name: str, value: float) -> float:
    """The value, rounded to 1e-9.

    Raises:
        WorldError: The value is not finite.
    """
    number = float(value)
    if not math.isfinite(number):
        raise WorldError(f"expected {name} to be a finite number, got {value!r}")
    return round(number, DIGITS) + 0.0  # no negative zero


def wrap_angle(angle: float) -> float:
    """The angle wrapped to (-pi, pi], rad, rounded to 1e-9."""
    turn = metres("an angle", math.remainder(angle, 2.0 * math.pi))
    return math.pi if abs(turn) > math.pi else turn


@dataclass(frozen=True, slots=True)
class Disc:
    """A disc.

    Attributes:
        x: x of the centre, m.
        y: y of the centre, m.
        radius: Radius, m, above 0.
    """

    x: float
    y: float
    radius: float

    def __post_init__(self) -> None:
        keep_digits(self, "x", "y", "radius")
        _above_zero(radius=self.radius)

    def contains(self, x: float, y: float) -> bool:
        """Whether the point lies in the disc, rim included."""
        return math.hypot(x - self.x, y - self.y) <= self.radius

    @property
    def area(self) -> float:
        """Area, m²."""
        return math.pi * self.radius**2

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """(left, low, right, high), m."""
        x, y, r = self.x, self.y, self.radius
        return x - r, y - r, x + r, y + r


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A rectangle.

    Attributes:
        x: x of the centre, m.
        y: y of the centre, m.
        yaw: Direction of the longer side, rad: [-pi/2, pi/2), a square [-pi/4, pi/4).
        length: Longer side, m, along `yaw`; the sides are swapped if necessary.
        width: Shorter side, m, above 0.
    """

    x: float
    y: float
    yaw: float
    length: float
    width: float

    def __post_init__(self) -> None:
        keep_digits(self, "x", "y", "length", "width")
        _above_zero(length=self.length, width=self.width)
        length, width, yaw = self.length, self.width, self.yaw
        if length < width:
            object.__setattr__(self, "length", width)
            object.__setattr__(self, "width", length)
            yaw += math.pi / 2
        turn = math.pi / 2 if length == width else math.pi
        yaw, half = metres("yaw", math.remainder(yaw, turn)), metres("yaw", turn / 2)
        object.__setattr__(self, "yaw", -half if yaw >= half else yaw)

    @property
    def turn(self) -> Points:
        """Rotation matrix from the rectangle's axes to x and y, shape (2, 2)."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return np.array([[cos, -sin], [sin, cos]])

    @property
    def vertices(self) -> Points:
        """Corners, shape (4, 2), counter-clockwise, m."""
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        half = np.array([self.length, self.width]) / 2
        return np.asarray(corners * half @ self.turn.T + (self.x, self.y))

    def contains(self, x: float, y: float) -> bool:
        """Whether the point lies in the shape, edges included."""
        own = (x - self.x, y - self.y) @ self.turn
        return bool(abs(own[0]) <= self.length / 2 and abs(own[1]) <= self.width / 2)

    @property
    def area(self) -> float:
        """Area, m²."""
        return self.length * self.width

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """(left, low, right, high), m."""
        return _bounds(self.vertices)


@dataclass(frozen=True, slots=True)
class Polygon:
    """A convex polygon; `Polygon.around` builds one from any points.

    Attributes:
        points: Vertices, counter-clockwise from the leftmost (the lowest in a tie).
    """

    points: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        kept = _kept(self.points)
        if len(kept) < 3 or _hull(kept) != kept:
            raise WorldError(
                "expected a convex polygon, counter-clockwise from the leftmost point: "
                f"got {len(kept)} vertices, {kept[:4]} …"
            )
        object.__setattr__(self, "points", kept)

    @classmethod
    def around(cls, points: ArrayLike) -> Polygon:
        """The convex hull of points, shape (n, 2).

        Raises:
            WorldError: The points lie on one line.
        """
        return cls(_hull(_kept(points)))

    @property
    def vertices(self) -> Points:
        """Vertices, shape (n, 2), counter-clockwise, m."""
        return np.array(self.points)

    def contains(self, x: float, y: float) -> bool:
        """Whether the point lies in the shape, edges included."""
        at = self.vertices
        edge = np.roll(at, -1, axis=0) - at
        side = edge[:, 0] * (y - at[:, 1]) - edge[:, 1] * (x - at[:, 0])
        return bool((side >= 0.0).all())

    @property
    def area(self) -> float:
        """Area, m²."""
        (x, y), (u, v) = self.vertices.T, np.roll(self.vertices, -1, axis=0).T
        return float((x * v - u * y).sum() / 2)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """(left, low, right, high), m."""
        return _bounds(self.vertices)


Footprint = Disc | Rectangle | Polygon


def ring(
    x: float, y: float, inner: float, outer: float, facets: int
) -> list[Polygon | Rectangle]:
    """A ring as convex pieces, like Webots' pipes.

    The inner facets touch the inner circle. The outer corners lie on the outer circle,
    or farther out where a thin wall with few facets would lose its thickness.

    Args:
        x: x of the centre, m.
        y: y of the centre, m.
        inner: Radius of the free disc inside, m.
        outer: Outer radius, m.
        facets: Number of pieces, at least 3.
    """
    half = math.pi / facets
    near = inner / math.cos(half)
    far = max(outer, near + (outer - inner))
    turns = half * (2.0 * np.arange(facets + 1) - 1.0)
    unit = np.column_stack([np.cos(turns), np.sin(turns)])
    middle = np.array([x, y])
    return [
        Polygon.around(np.vstack([near * edge, far * edge]) + middle)
        for edge in (unit[k : k + 2] for k in range(facets))
    ]


def frame(floor: Rectangle, thickness: float) -> list[Polygon | Rectangle]:
    """Four walls around a rectangle; the two long ones cover the corners."""
    middle, turn = np.array([floor.x, floor.y]), floor.turn
    out = (floor.length / 2 + thickness / 2, 0.0)
    up = (0.0, floor.width / 2 + thickness / 2)
    whole = floor.length + 2 * thickness
    walls: list[Polygon | Rectangle] = []
    for side in (1.0, -1.0):
        x, y = middle + side * (turn @ out)
        walls.append(Rectangle(x, y, floor.yaw, thickness, floor.width))
        x, y = middle + side * (turn @ up)
        walls.append(Rectangle(x, y, floor.yaw, whole, thickness))
    return walls


def _kept(points: ArrayLike) -> tuple[Point, ...]:
    """The points, rounded to 1e-9 and checked as in `metres`."""
    at = np.asarray(points, np.float64).reshape(-1, 2)
    if not np.isfinite(at).all():
        raise WorldError("expected the coordinates of a polygon to be finite")
    return tuple((x, y) for x, y in (np.round(at, DIGITS) + 0.0).tolist())


def _hull(points: Iterable[Point]) -> tuple[Point, ...]:
    """Convex hull, counter-clockwise from the leftmost point (Andrew 1979)."""
    ordered = sorted(set(points))
    lower, upper = _chain(ordered), _chain(ordered[::-1])
    return tuple(lower[:-1] + upper[:-1])


def _chain(ordered: list[Point]) -> list[Point]:
    chain: list[Point] = []
    for x, y in ordered:
        while len(chain) >= 2:
            (ax, ay), (bx, by) = chain[-2:]
            if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0:
                break
            chain.pop()
        chain.append((x, y))
    return chain


def _bounds(vertices: Points) -> tuple[float, float, float, float]:
    left, low = vertices.min(axis=0).tolist()
    right, high = vertices.max(axis=0).tolist()
    return left, low, right, high


def keep_digits(shape: object, *names: str) -> None:
    """Rounds attributes of a frozen dataclass as `metres` does."""
    for name in names:
        object.__setattr__(shape, name, metres(name, getattr(shape, name)))


def _above_zero(**lengths: float) -> None:
    for name, length in lengths.items():
        if length <= 0.0:
            raise WorldError(f"expected {name} above 0, got {length:g} m")
