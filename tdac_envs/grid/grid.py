"""Occupancy grid: which pixels are obstacles, and how far away they are."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, read_only, subkernel
from tdac_envs.core.errors import MapError
from tdac_envs.core.hashing import sha256_of

BoolGrid = NDArray[np.bool_]
FloatGrid = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """A map of square pixels, each free or occupied.

    Pixel (i, j) is the square [i - 1/2, i + 1/2) x [j - 1/2, j + 1/2), x to the
    right and y down. Everything outside the map is occupied.

    Attributes:
        cells: Shape (height, width), bool, indexed `[y, x]`; True = occupied.
            Stored read-only.
        resolution: Metres per pixel; None if the map has no scale.
        origin: Pose (x, y, yaw) of the lower-left pixel, m and rad, as in ROS
            `map.yaml`.
    """

    cells: BoolGrid
    resolution: float | None = None
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    _hash: str | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        cells = np.array(self.cells, dtype=np.bool_, order="C")
        if cells.ndim != 2 or 0 in cells.shape:
            raise MapError(f"expected a 2-D grid of cells, got shape {cells.shape}")
        if self.resolution is not None and not self.resolution > 0:
            raise MapError(f"expected a resolution above 0, got {self.resolution}")
        cells.flags.writeable = False
        object.__setattr__(self, "cells", cells)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, OccupancyGrid) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def __reduce__(self) -> tuple[Any, ...]:
        # An array that NumPy unpickles would be writable.
        return OccupancyGrid, (self.cells, self.resolution, self.origin)

    def _key(self) -> tuple[Any, ...]:
        return self.sha256(), self.resolution, self.origin

    @property
    def width(self) -> int:
        """Number of columns, px."""
        return int(self.cells.shape[1])

    @property
    def height(self) -> int:
        """Number of rows, px."""
        return int(self.cells.shape[0])

    def is_occupied(self, x: float, y: float) -> bool:
        """Whether the point (x, y), in pixels, is in an obstacle or outside the map."""
        i, j = int(np.floor(x + 0.5)), int(np.floor(y + 0.5))
        if not (0 <= i < self.width and 0 <= j < self.height):
            return True
        return bool(self.cells[j, i])

    def sha256(self) -> str:
        """Hash of the shape and the cells."""
        if self._hash is None:
            head = f"{self.width}x{self.height}:".encode()
            found = sha256_of(head, np.packbits(self.cells).tobytes())
            object.__setattr__(self, "_hash", found)
            return found
        return self._hash


def clearance(cells: BoolGrid) -> FloatGrid:
    """Exact distance from each pixel centre to the nearest occupied square, in px.

    The border of the map counts as occupied.

    Args:
        cells: Shape (height, width), bool, True = occupied.

    Returns:
        Shape (height, width), float32; 0 inside obstacles.
    """
    height, width = cells.shape
    clear = np.empty((height, width), np.float32)
    rows = np.empty((height, width), np.int32)
    site, scratch = np.empty(width + 2, np.int64), np.empty((2, width + 3))
    _clearance(read_only(cells), rows, site, scratch, clear)
    return clear


@kernel
def _clearance(
    cells: BoolGrid,
    up: NDArray[np.int32],
    site: NDArray[np.int64],
    scratch: NDArray[np.float64],
    clear: FloatGrid,
) -> None:
    """Distance transform after Felzenszwalb and Huttenlocher (2012), for squares.

    Horizontally, a square in another column x' is as far from x as its centre line is
    from x - 1/2 or x + 1/2, whichever is nearer. So the lower envelope of the columns'
    parabolas is read at half pixels, where it is never too low; in column x itself the
    distance is vertical.
    """
    height, width = cells.shape
    _rows_to_obstacle(cells, up)
    square, begin = scratch[0], scratch[1]
    for y in range(height):
        last = -1
        for x in range(-1, width + 1):
            rows = up[y, x] if 0 <= x < width else 0
            value = (rows - 0.5) ** 2 if rows else 0.0
            cross = -math.inf
            while last >= 0:
                span = x - site[last]
                cross = 0.5 * (x + site[last] + (value - square[last]) / span)
                if cross > begin[last]:
                    break
                last, cross = last - 1, -math.inf
            last += 1
            site[last], square[last], begin[last] = x, value, cross
        begin[last + 1] = math.inf
        part, before = 0, 0.0
        for x in range(width + 1):
            while begin[part + 1] < x - 0.5:
                part += 1
            after = (x - 0.5 - site[part]) ** 2 + square[part]
            if x > 0:
                rows = up[y, x - 1]
                here = (rows - 0.5) ** 2 if rows else 0.0
                clear[y, x - 1] = math.sqrt(min(here, before, after))
            before = after


@subkernel
def _rows_to_obstacle(cells: BoolGrid, rows: NDArray[np.int32]) -> None:
    """Number of rows from each pixel to the nearest occupied one in its column."""
    height, width = cells.shape
    for x in range(width):
        rows[0, x] = 0 if cells[0, x] else 1
    for y in range(1, height):
        for x in range(width):
            rows[y, x] = 0 if cells[y, x] else rows[y - 1, x] + 1
    for x in range(width):
        rows[height - 1, x] = min(rows[height - 1, x], 1)
    for y in range(height - 2, -1, -1):
        for x in range(width):
            rows[y, x] = min(rows[y, x], rows[y + 1, x] + 1)


def clearance_at(cells: BoolGrid, x: float, y: float, limit: float) -> float:
    """Exact distance from any point to the nearest occupied square, up to `limit`.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        x: Column, px.
        y: Row, px.
        limit: Largest distance of interest, px.
    """
    height, width = cells.shape
    reach = int(np.ceil(limit)) + 1
    i, j = int(np.floor(x + 0.5)), int(np.floor(y + 0.5))
    edge = min(x + 0.5, y + 0.5, width - 0.5 - x, height - 0.5 - y)
    x0, x1 = max(i - reach, 0), min(i + reach + 1, width)
    y0, y1 = max(j - reach, 0), min(j + reach + 1, height)
    rows, columns = np.nonzero(cells[y0:y1, x0:x1])
    best: float = max(min(edge, limit), 0.0)
    if rows.size:
        dx = np.maximum(np.abs(columns + x0 - x) - 0.5, 0.0)
        dy = np.maximum(np.abs(rows + y0 - y) - 0.5, 0.0)
        best = min(best, float(np.hypot(dx, dy).min()))
    return best


def inflate(cells: BoolGrid, radius: float) -> BoolGrid:
    """Cells within `radius` px (centre to centre, inclusive) of an occupied cell."""
    if radius <= 0 or not cells.any():
        return cells.copy()
    free = (~cells).astype(np.uint8)
    distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(distance <= radius)


def body_free(clear: FloatGrid, radius: float) -> BoolGrid:
    """Pixels where a disc of `radius` px fits, also while it steps between neighbours.

    If the clearance is at least `sqrt(radius**2 + 1/2)` at both ends of a step to one
    of the eight neighbours, it is at least `radius` along the whole step.

    Args:
        clear: Shape (height, width), float32, from `clearance`.
        radius: Body radius, px.
    """
    return np.asarray(clear >= np.float32(np.sqrt(radius * radius + 0.5)))
