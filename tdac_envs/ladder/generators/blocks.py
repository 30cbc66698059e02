"""Blocks that stand on a floor: their parts in a world, and their pixels.

Two rasters enclose a world: one has the pixels that lie wholly in a block, the other
all that a block touches. So what is impossible on the first is impossible in the world,
and what is possible on the second is possible in the world.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdac_envs.grid.grid import BoolGrid
from tdac_envs.ladder.random_stream import rounded
from tdac_envs.worlds.footprint import Disc, Rectangle

PIXEL = 5
"""Side of a pixel of the rasters, mm."""
_HALF = PIXEL / 2
_SLACK = 0.01
"""Allowance for the rounding of sine and cosine, mm."""

Offsets = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Box:
    """A box.

    Attributes:
        x: x of the centre, half mm.
        y: y of the centre, half mm.
        length: Side along its direction, mm.
        width: The other side, mm.
        degrees: Direction, whole degrees, anticlockwise.
    """

    x: int
    y: int
    length: int
    width: int
    degrees: int = 0

    @property
    def shape(self) -> Rectangle:
        """Its footprint, m."""
        sides = self.length / 1000, self.width / 1000
        return Rectangle(
            self.x / 2000, self.y / 2000, math.radians(self.degrees), *sides
        )

    @property
    def reach(self) -> tuple[float, float]:
        """Half the sides of an upright rectangle around it, mm."""
        if self.degrees:
            half = math.hypot(self.length, self.width) / 2
            return half, half
        return self.length / 2, self.width / 2

    def covered(self, dx: Offsets, dy: Offsets, touched: bool) -> BoolGrid:
        """Which pixels lie in it, or touch it; `dx`, `dy`: from its centre, mm."""
        turn = math.radians(self.degrees)
        cosine, sine = rounded(math.cos(turn)), rounded(math.sin(turn))
        along, across = abs(cosine * dx + sine * dy), abs(cosine * dy - sine * dx)
        reach = _HALF * (abs(cosine) + abs(sine))
        if self.degrees:
            reach += _SLACK
        if touched:
            # A pixel that only shares an edge does not touch it.
            inside = along < self.length / 2 + reach, across < self.width / 2 + reach
        else:
            inside = along + reach <= self.length / 2, across + reach <= self.width / 2
        return np.asarray(inside[0] & inside[1])


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A cylinder.

    Attributes:
        x: x of the centre, half mm.
        y: y of the centre, half mm.
        radius: Radius, mm.
    """

    x: int
    y: int
    radius: int

    @property
    def shape(self) -> Disc:
        """Its footprint, m."""
        return Disc(self.x / 2000, self.y / 2000, self.radius / 1000)

    @property
    def reach(self) -> tuple[float, float]:
        """Half the sides of an upright rectangle around it, mm."""
        return self.radius, self.radius

    def covered(self, dx: Offsets, dy: Offsets, touched: bool) -> BoolGrid:
        """Which pixels lie in it, or touch it; `dx`, `dy`: from its centre, mm."""
        off = -_HALF if touched else _HALF
        x, y = np.maximum(abs(dx) + off, 0.0), np.maximum(abs(dy) + off, 0.0)
        return np.asarray(x * x + y * y <= self.radius * self.radius)


Block = Box | Cylinder


def raster(
    columns: int, rows: int, blocks: tuple[Block, ...], touched: bool
) -> BoolGrid:
    """The pixels of a floor and of the wall around it, which is one pixel thick.

    Args:
        columns: Width of the floor, pixels; the origin of the blocks is its centre.
        rows: Depth of the floor, pixels.
        blocks: What stands on the floor.
        touched: Whether a block occupies all pixels that it touches, or only those
            that lie in it.

    Returns:
        Shape (rows + 2, columns + 2), bool, True = occupied; y grows with the row.
    """
    cells = np.zeros((rows + 2, columns + 2), np.bool_)
    cells[[0, -1]] = cells[:, [0, -1]] = True
    xs, ys = centres(columns), centres(rows)
    for block in blocks:
        x, y = block.x / 2, block.y / 2
        beside, along = (
            _window(axis, middle, reach)
            for axis, middle, reach in zip((xs, ys), (x, y), block.reach, strict=True)
        )
        dx, dy = xs[None, beside] - x, ys[along, None] - y
        cells[along, beside] |= block.covered(dx, dy, touched)
    return cells


def _window(axis: Offsets, middle: float, reach: float) -> slice:
    """The pixels whose centre is at most a pixel beyond a block on either side."""
    low, high = middle - reach - PIXEL, middle + reach + PIXEL
    return slice(*np.searchsorted(axis, (low, high)).tolist())


def centres(count: int) -> NDArray[np.float64]:
    """Centres of the pixels along a side of `count` pixels and its walls, mm."""
    return _HALF * np.arange(-1 - count, count + 2, 2, dtype=np.float64)
