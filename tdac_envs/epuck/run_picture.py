"""Pictures of complete runs of an e-puck, x right, y up."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tdac_envs.drawing.backdrop import CLOSE_UP, CloseUpWindow
from tdac_envs.drawing.canvas import Canvas, Image
from tdac_envs.drawing.runs import Legend, draw_runs
from tdac_envs.drive.task import radii_text
from tdac_envs.epuck.ground import Bounds
from tdac_envs.epuck.picture import SMALLEST_BODY, draw_task
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.worlds.bodies import BODY_RADIUS
from tdac_envs.worlds.picture import SIDE, WorldCanvas, draw_things

Points = NDArray[np.float64]
# Width reserved for the scale bar at the right of the strip, frame px.
_SCALE = 170


def trajectory_picture(
    task: EPuckTask,
    trajectories: Sequence[ArrayLike],
    *,
    outcomes: Sequence[str] = (),
    labels: Sequence[str] = (),
) -> Image:
    """The world with one or more trajectories and a legend, uint8 RGB.

    Args:
        task: Task with world, start and goal.
        trajectories: Poses of each, shape (T + 1, 3): x, y (m), heading (rad).
        outcomes: Outcome of each trajectory; sets the mark at its end.
        labels: Name of each trajectory.
    """
    ends = [*outcomes, *[""] * (len(trajectories) - len(outcomes))]
    width = _columns(task.ground.bounds) - _SCALE
    near = task.goal_tolerance
    goal = f"goal within {1e3 * near:g} mm ({radii_text(near, BODY_RADIUS)})"
    legend = Legend.of(ends, labels, path=True, width=width, goal=goal)
    view = task_view(task, task.ground.bounds, strip=max(legend.height, 46))
    view.scale_bar()
    chart = WorldChart(view)
    runs = [chart.poses(np.asarray(run, np.float64)) for run in trajectories]
    body = max(BODY_RADIUS * view.scale, SMALLEST_BODY)
    draw_runs(view.canvas, runs, ends, body, labels)
    legend.write(view.canvas)
    return view.canvas.image


def _columns(bounds: Bounds) -> int:
    return int(WorldCanvas(bounds).canvas.image.shape[1])


def task_view(
    task: EPuckTask,
    bounds: Bounds,
    *,
    strip: int,
    side: int = SIDE,
    margin: float = 0.05,
) -> WorldCanvas:
    """A picture of a task's world with start, goal and shortest path."""
    ground = task.ground
    view = WorldCanvas(bounds, strip=strip, side=side, margin=margin)
    things = [thing for thing in ground.things if not thing.is_goal or thing.solid]
    draw_things(view, ground.world, things)
    draw_task(view, task)
    return view


@dataclass(frozen=True, slots=True, eq=False)
class WorldChart:
    """A view as a chart; see `tdac_envs.drawing.backdrop.Chart`."""

    view: WorldCanvas

    @property
    def canvas(self) -> Canvas:
        """The canvas of the view."""
        return self.view.canvas

    @property
    def scale(self) -> float:
        """Frame px per metre."""
        return self.view.scale

    def at(self, points: Points) -> Points:
        """Points in canvas coordinates, shape (n, 2)."""
        return self.view.at(points)

    def turned(self, heading: float) -> float:
        """The heading on the canvas, where y points down."""
        return -heading

    def poses(self, poses: Points) -> Points:
        """Poses in canvas coordinates, shape (n, 3)."""
        return np.column_stack([self.at(poses[:, :2]), -poses[:, 2]])


@dataclass(frozen=True, slots=True, eq=False)
class WorldBackground:
    """The backdrop of runs in a world; see `tdac_envs.drawing.backdrop.Backdrop`."""

    task: EPuckTask
    view: WorldCanvas

    @classmethod
    def of(cls, task: EPuckTask) -> WorldBackground:
        """The world with start, goal and shortest path."""
        return cls(task, task_view(task, task.ground.bounds, strip=0))

    @property
    def radius(self) -> float:
        """Body radius, m."""
        return BODY_RADIUS

    def whole(self) -> WorldChart:
        """A chart of the whole world."""
        view = copy.copy(self.view)
        view.canvas = self.view.canvas.copy()
        return WorldChart(view)

    def window(self, middle: Points, extent: float) -> CloseUpWindow:
        """A square around a point."""
        x, y = (middle - extent / 2.0).tolist()
        return CloseUpWindow(x, y, extent)

    def close_up(self, window: CloseUpWindow) -> WorldChart:
        """An enlarged part of the world."""
        x, y, side = window
        bounds = (x, y, x + side, y + side)
        view = task_view(self.task, bounds, strip=0, side=CLOSE_UP, margin=0.0)
        return WorldChart(view)
