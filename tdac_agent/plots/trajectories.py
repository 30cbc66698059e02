"""Trajectories drawn over a map or world."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.errors import RunError
from tdac_agent.plots.style import (
    COLOURS,
    FAILED,
    LINES,
    TEXT,
    TRAIL,
    apply_style,
    colours_of,
    new_plot,
    title,
)
from tdac_agent.tasks.task import Task
from tdac_envs.drawing.backdrop import Chart
from tdac_envs.drawing.runs import NOMINAL

WIDTH = 7.0
"""Width of the map, inches; reduced if the map is higher than 0.8 of its width."""


def plot_trajectories(
    task: Task,
    ways: Mapping[str, Trajectory | ArrayLike],
    outcomes: Mapping[str, str] | None = None,
    *,
    heading: str | None = None,
    provenance: str = "",
) -> Figure:
    """Draws trajectories over a map or world with start, goal and shortest path.

    Args:
        task: Task whose map or world is drawn.
        ways: Trajectories by name in the legend, each as recorded by the judge, or as
            poses of shape (T + 1, 3) or positions of shape (T + 1, 2), px or m. One
            that is called `nominal` is strong, and the others are thin.
        outcomes: Outcome of each trajectory, as in a report: `reached`, `collision` ….
        heading: Title; the task's name by default.
        provenance: Line below the title.

    Raises:
        RunError: An array has another shape.
    """
    chart = task.pictures().backdrop().whole()
    picture = chart.canvas.image[: chart.canvas.strip_top]
    left, right, low, high = extent = _extent(chart)
    shape = abs((high - low) / (right - left))
    width = WIDTH * min(1.0, 0.8 / shape)
    figure = new_plot(width + 0.6, width * shape + 1.0 + 0.2 * -(-len(ways) // 3))
    axes = apply_style(figure.add_subplot())
    axes.grid(visible=False)
    axes.imshow(picture, extent=extent, interpolation="antialiased")
    colours = colours_of(ways) | {NOMINAL: TRAIL}
    strong = NOMINAL in ways and len(ways) > 1
    for number, (name, way) in enumerate(ways.items()):
        outcome = (outcomes or {}).get(name, "")
        line = LINES[number // len(COLOURS) % len(LINES)]
        label = f"{name}: {outcome}" if outcome else name
        width = 1.8
        if strong:
            width = 3.0 if name == NOMINAL else 1.0
        _draw(axes, _places(way), colours[name], line, label, outcome, width)
    unit = task.setting.units.place
    axes.set_xlabel(f"x, {unit}", color=TEXT)
    axes.set_ylabel(f"y, {unit}", color=TEXT)
    title(axes, task.name if heading is None else heading, provenance)
    if ways:
        figure.legend(
            loc="outside lower center", ncols=min(3, len(ways)), frameon=False
        )
    return figure


def _extent(chart: Chart) -> tuple[float, float, float, float]:
    """Left, right, bottom and top edge of the picture, in the environment's unit."""
    (x0, y0), (x1, y1) = chart.canvas.to_frame(chart.at(np.array([[0, 0], [1, 1]])))
    columns, rows = chart.canvas.image.shape[1], chart.canvas.strip_top
    left, right = ((edge - x0) / (x1 - x0) for edge in (-0.5, columns - 0.5))
    high, low = ((edge - y0) / (y1 - y0) for edge in (-0.5, rows - 0.5))
    return left, right, low, high


def _places(way: Trajectory | ArrayLike) -> NDArray[np.float64]:
    poses = way.poses if isinstance(way, Trajectory) else np.asarray(way, np.float64)
    if poses.ndim != 2 or poses.shape[1] not in (2, 3):
        raise RunError(f"expected poses of shape (T + 1, 3), got {poses.shape}")
    return np.asarray(poses[:, :2])


def _draw(
    axes: Axes,
    places: NDArray[np.float64],
    colour: str,
    line: str,
    label: str,
    outcome: str,
    width: float,
) -> None:
    x, y = places.T
    # The strong one lies above the thin ones.
    over = 2.0 + 0.1 * width
    axes.plot(x, y, color="w", linewidth=1.8 + width, alpha=0.5, zorder=over)
    axes.plot(
        x, y, line, color=colour, linewidth=width, alpha=0.8, label=label,
        zorder=over + 0.01,
    )  # fmt: skip
    marks = {"reached": ("o", colour), "collision": ("X", FAILED)}
    mark, fill = marks.get(outcome, ("s", colour))
    end: dict[str, Any] = {
        "color": fill,
        "markeredgecolor": "w",
        "markersize": 8,
        "zorder": 4,
    }
    axes.plot(x[-1:], y[-1:], mark, **end)
