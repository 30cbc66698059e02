"""Pictures of complete runs on a map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tdac_envs.drawing.backdrop import CLOSE_UP, CloseUpWindow, Points
from tdac_envs.drawing.canvas import Canvas, Image
from tdac_envs.drawing.marks import draw_movers, draw_task
from tdac_envs.drawing.runs import SMALLEST_BODY, Legend, draw_runs
from tdac_envs.drive.task import radii_text
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.map2d.task import Map2DTask


@dataclass(frozen=True, slots=True, eq=False)
class MapChart:
    """A canvas in map coordinates; see `tdac_envs.drawing.backdrop.Chart`."""

    canvas: Canvas

    @property
    def scale(self) -> float:
        """Frame px per map px."""
        return self.canvas.scale

    def at(self, points: Points) -> Points:
        """The points, unchanged."""
        return points

    def turned(self, heading: float) -> float:
        """The heading, unchanged."""
        return heading


@dataclass(frozen=True, slots=True, eq=False)
class Background:
    """The backdrop of runs on a map; see `tdac_envs.drawing.backdrop.Backdrop`."""

    task: Map2DTask
    canvas: Canvas
    path: Points

    @classmethod
    def of(cls, task: Map2DTask) -> Background:
        """The map with start, goal and shortest path."""
        background = cls(
            task,
            Canvas(task.terrain.grid.cells, strip=0),
            task.shortest_path(task.start),
        )
        background.draw_task(background.canvas, background.path)
        return background

    def draw_task(self, canvas: Canvas, path: Points) -> None:
        """Draws start, goal and a given part of the shortest path."""
        task = self.task
        draw_task(canvas, task.start, task.goal, task.goal_tolerance, path)

    @property
    def radius(self) -> float:
        """Body radius, px."""
        return self.task.robot.radius

    def whole(self) -> MapChart:
        """A chart of the whole map."""
        return MapChart(self.canvas.copy())

    def window(self, middle: Points, extent: float) -> CloseUpWindow:
        """A square around a point, aligned to whole pixels."""
        side = max(math.ceil(extent), 8)
        x, y = (np.floor(middle - side / 2.0 + 0.5) - 0.5).tolist()
        return CloseUpWindow(x, y, side)

    def close_up(self, window: CloseUpWindow) -> MapChart:
        """An enlarged part of the map."""
        x, y, side = (math.ceil(value) for value in window)
        cells = _part(self.task.terrain.grid.cells, x, y, side)
        scale = CLOSE_UP / side
        canvas = Canvas(cells, 0, scale=scale, origin=(x, y), narrowest=CLOSE_UP)
        self.draw_task(canvas, self.path)
        return MapChart(canvas)


def _part(cells: BoolGrid, x: int, y: int, side: int) -> BoolGrid:
    """A square part of a map; occupied outside the map."""
    height, width = cells.shape
    part = np.ones((side, side), np.bool_)
    x0, y0, x1, y1 = max(x, 0), max(y, 0), min(x + side, width), min(y + side, height)
    if x0 < x1 and y0 < y1:
        part[y0 - y : y1 - y, x0 - x : x1 - x] = cells[y0:y1, x0:x1]
    return part


def trajectory_picture(
    cells: BoolGrid,
    trajectories: Sequence[ArrayLike],
    start: Sequence[float],
    goal: Sequence[float],
    *,
    goal_tolerance: float,
    radius: float,
    path: ArrayLike = (),
    outcomes: Sequence[str] = (),
    labels: Sequence[str] = (),
    movers: Sequence[Points] = (),
    units: MapUnits = PIXELS,
) -> Image:
    """The map with one or more trajectories and a legend, uint8 RGB.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        trajectories: Poses of each, shape (T + 1, 3): x, y (px), heading (rad).
        start: Nominal start, (x, y) or a pose.
        goal: Point (x, y), px.
        goal_tolerance: Radius of the goal, px.
        radius: Body radius, px.
        path: Reference path, shape (n, 2), px.
        outcomes: "reached", "collision" or "out of time" for each trajectory; sets
            the mark at its end.
        labels: Name of each trajectory.
        movers: Movers in the last steps of the first trajectory, each of shape (m, 3):
            x, y, radius, px. Those of the others are not drawn.
        units: Units of the legend.
    """
    runs = [np.asarray(run, np.float64).reshape(-1, 3) for run in trajectories]
    ends = [*outcomes, *[""] * (len(runs) - len(outcomes))]
    legend = Legend.of(
        ends,
        labels,
        path=len(np.asarray(path)) > 1,
        movers=len(movers) > 0,
        width=Canvas.frame_width(cells),
        goal=f"goal within {units.length(goal_tolerance)} "
        f"({radii_text(goal_tolerance, radius)})",
    )
    canvas = Canvas(cells, strip=legend.height)
    draw_task(canvas, start, goal, goal_tolerance, path)
    draw_movers(canvas, movers)
    draw_runs(canvas, runs, ends, max(radius * canvas.scale, SMALLEST_BODY), labels)
    legend.write(canvas)
    return canvas.image
