"""What a picture of a run is drawn upon: a task as a whole, and parts of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tdac_envs.drawing.canvas import Canvas
from tdac_envs.drawing.marks import draw_task
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.map2d.task import Map2DTask

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


@dataclass(frozen=True, slots=True, eq=False)
class MapChart:
    """A canvas whose coordinates are those of the map."""

    canvas: Canvas

    @property
    def scale(self) -> float:
        """Frame px in a map px."""
        return self.canvas.scale

    def at(self, points: Points) -> Points:
        """The same places."""
        return points

    def turned(self, heading: float) -> float:
        """The same heading."""
        return heading


@dataclass(frozen=True, slots=True, eq=False)
class Background:
    """The backdrop of runs on a map."""

    task: Map2DTask
    canvas: Canvas
    path: Points

    @classmethod
    def of(cls, task: Map2DTask) -> Background:
        """The map with start, goal and shortest path."""
        background = cls(
            task,
            Canvas(task.terrain.grid.cells, strip=0),
            task.path_from(task.start),
        )
        background.draw_task(background.canvas, background.path)
        return background

    def draw_task(self, canvas: Canvas, path: Points) -> None:
        """Draws start, goal and a part of the shortest path."""
        task = self.task
        draw_task(canvas, task.start, task.goal, task.goal_tolerance, path)

    @property
    def radius(self) -> float:
        """Of the body, px."""
        return self.task.robot.radius

    def whole(self) -> MapChart:
        """The map."""
        return MapChart(self.canvas.copy())

    def window(self, middle: Points, extent: float) -> Window:
        """Whole pixels."""
        side = max(math.ceil(extent), 8)
        x, y = (np.floor(middle - side / 2.0 + 0.5) - 0.5).tolist()
        return Window(x, y, side)

    def close_up(self, window: Window) -> MapChart:
        """A part of the map, enlarged."""
        x, y, side = (math.ceil(value) for value in window)
        cells = _part(self.task.terrain.grid.cells, x, y, side)
        scale = CLOSE_UP / side
        canvas = Canvas(cells, 0, scale=scale, origin=(x, y), narrowest=CLOSE_UP)
        self.draw_task(canvas, _inside(self.path, x, y, side))
        return MapChart(canvas)


def _inside(path: Points, x: int, y: int, side: int) -> Points:
    """The part of a path from its first to its last point in a window."""
    inside = ((path >= (x, y)) & (path < (x + side, y + side))).all(axis=1)
    found = np.flatnonzero(inside)
    return path[max(found[0] - 1, 0) : found[-1] + 2] if found.size else path[:0]


def _part(cells: BoolGrid, x: int, y: int, side: int) -> BoolGrid:
    """A square part of a map, occupied where it reaches beyond it."""
    height, width = cells.shape
    part = np.ones((side, side), np.bool_)
    x0, y0, x1, y1 = max(x, 0), max(y, 0), min(x + side, width), min(y + side, height)
    if x0 < x1 and y0 < y1:
        part[y0 - y : y1 - y, x0 - x : x1 - x] = cells[y0:y1, x0:x1]
    return part
