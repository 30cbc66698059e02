"""What a picture of a run is drawn upon: a task as a whole, and parts of it."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tdac_envs.drawing.canvas import Canvas

Points = NDArray[np.float64]

CLOSE_UP = 372
"""Width of an enlarged part, px."""


class Window(NamedTuple):
    """A square part of a picture: its least x and y, and its side, as places are."""

    x: float
    y: float
    side: float


class Chart(Protocol):
    """A canvas, and where on it a place is."""

    @property
    def canvas(self) -> Canvas:
        """To draw on."""

    @property
    def scale(self) -> float:
        """Frame px in a unit of length."""

    def at(self, points: Points) -> Points:
        """Places, shape (n, 2), in coordinates of the canvas."""

    def turned(self, heading: float) -> float:
        """A heading on the canvas, where y points down."""


class Backdrop(Protocol):
    """What the pictures of all runs of a task have in common."""

    @property
    def radius(self) -> float:
        """Of the body."""

    def whole(self) -> Chart:
        """All of it, with start, goal and shortest path, to draw on."""

    def window(self, middle: Points, extent: float) -> Window:
        """A part of it around a place, which is at least so wide."""

    def close_up(self, window: Window) -> Chart:
        """That part, `CLOSE_UP` px wide."""
