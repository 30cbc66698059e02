"""Conversion between pixels and metres by the rules of ROS `map.yaml`."""

from __future__ import annotations

import math
from typing import Protocol

from tdac_envs.core.errors import MapError

Point = tuple[float, float]


class Framed(Protocol):
    """A map with a frame: an `OccupancyGrid`, a `MapImage` or `MapParams`."""

    @property
    def height(self) -> int:
        """Number of rows, px."""

    @property
    def resolution(self) -> float | None:
        """Metres per pixel; None if the map has no scale."""

    @property
    def origin(self) -> tuple[float, float, float]:
        """Pose (x, y, yaw) of the lower-left pixel, m and rad."""


def to_pixels(grid: Framed, x_m: float, y_m: float) -> Point:
    """Pixel coordinates of a point in the map frame.

    The outer corner of the lower-left pixel is at `origin[:2]`. Right and up in the
    image are the x and y axes of the map frame rotated by the yaw of `origin`.

    Args:
        grid: The map.
        x_m: x in the map frame, m.
        y_m: y in the map frame, m.

    Raises:
        MapError: The map has no resolution.
    """
    resolution, (x0, y0, yaw) = resolution_of(grid), grid.origin
    dx, dy = x_m - x0, y_m - y0
    right = math.cos(yaw) * dx + math.sin(yaw) * dy
    up = math.cos(yaw) * dy - math.sin(yaw) * dx
    return right / resolution - 0.5, grid.height - 0.5 - up / resolution


def to_metres(grid: Framed, x: float, y: float) -> Point:
    """Map-frame coordinates in metres of a point in pixels; inverse of `to_pixels`.

    Raises:
        MapError: The map has no resolution.
    """
    resolution, (x0, y0, yaw) = resolution_of(grid), grid.origin
    right, up = (x + 0.5) * resolution, (grid.height - 0.5 - y) * resolution
    return (
        x0 + math.cos(yaw) * right - math.sin(yaw) * up,
        y0 + math.sin(yaw) * right + math.cos(yaw) * up,
    )


def resolution_of(grid: Framed) -> float:
    """Metres per pixel; divide a length in metres by it to get pixels.

    Raises:
        MapError: The map has no resolution.
    """
    if grid.resolution is None:
        raise MapError(
            "this map has no resolution, so lengths in metres cannot be converted; "
            "give pixels, a ROS map.yaml, or the resolution"
        )
    return grid.resolution
