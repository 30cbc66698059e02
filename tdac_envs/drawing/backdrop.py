"""Backgrounds for pictures of runs: a whole map or world, and parts of it."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tdac_envs.drawing.canvas import Canvas

Points = NDArray[np.float64]

CLOSE_UP = 372
"""Width of a close-up, frame px."""


class Window(NamedTuple):
    """A square part of a map or world: least x and y, and side, in units of places."""

    x: float
    y: float
    side: float


class Chart(Protocol):
    """A canvas and the conversion of places to its coordinates."""

    @property
    def canvas(self) -> Canvas:
        """The canvas to draw on."""

    @property
    def scale(self) -> float:
        """Frame px per unit of length."""

    def at(self, points: Points) -> Points:
        """Places, shape (n, 2), converted to canvas coordinates."""

    def turned(self, heading: float) -> float:
        """A heading converted to the canvas, where y points down; rad."""


class Backdrop(Protocol):
    """The background of all pictures of the runs of a task."""

    @property
    def radius(self) -> float:
        """Radius of the body, in units of places."""

    def whole(self) -> Chart:
        """A chart of the whole map or world, with start, goal and shortest path."""

    def window(self, middle: Points, extent: float) -> Window:
        """A part around a place, at least `extent` wide."""

    def close_up(self, window: Window) -> Chart:
        """A chart of a part, `CLOSE_UP` px wide."""
