"""Figure of the preprocessing stages: from an image to free space for the robot."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from tdac_agent.plots.style import (
    COLOURS,
    FAILED,
    TEXT,
    apply_style,
    mark_task,
    new_plot,
    title,
)
from tdac_envs.grid.grid import BoolGrid, OccupancyGrid, body_free, clearance
from tdac_envs.mapping.image import luminance
from tdac_envs.mapping.map_folder import planned_path
from tdac_envs.mapping.params import MapParams
from tdac_envs.mapping.preprocessing import Source, as_image

SIDE = 3.7
"""Width of a panel, inches."""
FREE, WALL, CLOSED = "#FAF9F5", "#384151", "#6E9FC4"
SMALL = {"size": 10.5, "pad": 6.0, "rise": 5.0, "small": 8.0}
"""Of the titles of panels."""
_SHADES = {"dark": "dark is occupied", "light": "light is occupied"}


def plot_preprocessing(image: Source, grid: OccupancyGrid, params: MapParams) -> Figure:
    """Plots the image, its threshold, the occupancy grid, and space for the robot.

    Args:
        image: Image given to `tdac_envs.preprocess`.
        grid: Occupancy grid that it returned.
        params: Parameters that it chose.
    """
    source = as_image(image)
    shape = grid.height / grid.width
    figure = new_plot(2 * SIDE + 0.4, 2 * SIDE * min(1.4, shape) + 1.2)
    first, second, third, last = figure.subplots(2, 2).flat
    first.imshow(source.colour, interpolation="antialiased")
    title(
        first,
        "1  the image\n",
        f"{source.name}, {grid.width} × {grid.height} px",
        **SMALL,
    )
    _plot_threshold(apply_style(second), luminance(source.colour), params)
    _plot_grid(third, grid.cells, luminance(source.colour), params)
    _plot_room(last, grid, params)
    for axes in (first, third, last):
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines[:].set_color("#BBBBBB")
    return figure


def _plot_threshold(axes: Axes, grey: np.ndarray, params: MapParams) -> None:
    counts = np.bincount(grey.ravel(), minlength=256)
    axes.bar(np.arange(256), np.maximum(counts, 0.5), width=1.0, color="#7A8494")
    axes.set_yscale("log")
    axes.set_ylim(0.8, 3 * counts.max())
    axes.set_xlim(-2, 257)
    axes.set_xlabel("luminance", color=TEXT)
    axes.set_ylabel("pixels", color=TEXT)
    if params.threshold is not None:
        axes.axvline(params.threshold, color=FAILED, linewidth=1.5)
    shade = _SHADES.get(params.polarity, params.method)
    cut = "" if params.threshold is None else f"cut at {params.threshold:g}; "
    title(axes, "2  the threshold\n", f"{cut}{shade}", **SMALL)


def _plot_grid(
    axes: Axes, cells: BoolGrid, grey: np.ndarray, params: MapParams
) -> None:
    """Draws the grid; cells that differ from the plain threshold are coloured."""
    shown, subtitle = cells.astype(int), params.method
    if params.threshold is not None:
        light = grey > params.threshold
        plain = light if params.polarity == "light" else ~light
        shown = shown + 2 * (plain & ~cells) + 2 * (cells & ~plain)
        freed, filled = int((plain & ~cells).sum()), int((cells & ~plain).sum())
        if freed or filled:
            subtitle = f"{freed:,} px freed (orange), {filled:,} closed (blue)"
    colours = ListedColormap([FREE, WALL, COLOURS[4], CLOSED])
    axes.imshow(shown, cmap=colours, vmin=0, vmax=3, interpolation="nearest")
    title(axes, "3  the occupancy grid\n", subtitle, **SMALL)


def _plot_room(axes: Axes, grid: OccupancyGrid, params: MapParams) -> None:
    """Draws where the body's centre may be, its clearance, and the grid path."""
    clear = clearance(grid.cells)
    room = body_free(clear, params.robot.radius + params.inflation)
    axes.imshow(grid.cells, cmap=ListedColormap([FREE, WALL]), interpolation="nearest")
    axes.imshow(
        np.ma.masked_array(clear, ~room),
        cmap="YlGnBu",
        vmin=-0.3 * float(clear.max()),  # stands out from the pale background
        interpolation="nearest",
    )
    mark_task(axes, params.start, params.goal, planned_path(grid, params))
    margin = f" + {params.inflation:g} px" if params.inflation else ""
    subtitle = f"for a disc of {params.robot.radius:g} px{margin}"
    if params.score_terms is not None:
        subtitle += f"; grid path {params.score_terms.path_length:.0f} px"
    title(axes, "4  space for the robot\n", subtitle, **SMALL)
