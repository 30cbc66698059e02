"""Backgrounds for pictures of runs: a whole map or world, and parts of it."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tdac_envs.drawing.canvas import Canvas

Points = NDArray[np.float64]

CLOSE_UP = 372
"""Width of a close-up, frame px."""


class CloseUpWindow(NamedTuple):
    """A square part of a map or world: smallest x and y, and side length, px or m."""

    x: float
    y: float
    side: float


class Chart(Protocol):
    """A canvas and the conversion of map or world points to its coordinates."""

    @property
    def canvas(self) -> Canvas:
        """The canvas to draw on."""

    @property
    def scale(self) -> float:
        """Frame px per unit of length."""

    def at(self, points: Points) -> Points:
        """Points, shape (n, 2), px or m, converted to canvas coordinates."""

    def turned(self, heading: float) -> float:
        """A heading converted to the canvas, where y points down; rad."""


class Backdrop(Protocol):
    """The background of all pictures of the runs of a task."""

    @property
    def radius(self) -> float:
        """Radius of the body, px or m."""

    def whole(self) -> Chart:
        """A chart of the whole map or world, with start, goal and shortest path."""

    def window(self, middle: Points, extent: float) -> CloseUpWindow:
        """A part around a point, at least `extent` wide."""

    def close_up(self, window: CloseUpWindow) -> Chart:
        """A chart of a part, `CLOSE_UP` px wide."""


def discs_on(chart: Chart, discs: Points) -> Points:
    """Discs of a map or world, shape (n, 3): x, y, radius, in canvas coordinates."""
    radii = discs[:, 2] * chart.scale / chart.canvas.scale
    return np.column_stack([chart.at(discs[:, :2]), radii])
