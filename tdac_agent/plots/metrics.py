"""The paper's two figures: success rates as bars, CS(k) as curves."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdac_agent.metrics import Rate, RunFrames, cumulative_success, success_rate
from tdac_agent.plots.style import (
    COLOURS,
    LINES,
    MARKERS,
    TEXT,
    apply_style,
    colours_of,
    legend,
    new_figure,
    new_plot,
    spread,
    title,
)

BEHIND = "#D5D5D5"


def plot_success_rates(
    groups: dict[str, RunFrames],
    *,
    by: str = "learner",
    heading: str = "Success rate SR",
    provenance: str = "",
) -> Figure:
    """Plots SR with its interval, as a bar per learner and group.

    Args:
        groups: Runs by the name of their group; groups are shown side by side.
        by: Column of the runs that defines a bar.
        heading: Title.
        provenance: Line below the title: source and number of the runs.
    """
    names = list(
        dict.fromkeys(n for frames in groups.values() for n in frames.runs[by])
    )
    figure, axes = new_figure(max(5.0, 1.1 + 0.95 * len(names)), 3.6)
    colours = colours_of(groups)
    width = 0.8 / max(1, len(groups))
    for number, name in enumerate(names):
        rates = {
            group: success_rate(frames.only(**{by: name}))
            for group, frames in groups.items()
            if (frames.runs[by] == name).any()
        }
        offsets = spread(len(rates), len(rates) * width)
        for (group, rate), offset in zip(rates.items(), offsets, strict=True):
            if not math.isnan(rate.value):
                _bar(axes, number + offset, rate, 0.92 * width, colours[group])
    axes.set_xticks(range(len(names)), names)
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.set_ylim(0, 1.12)
    axes.set_yticks(np.arange(0, 1.01, 0.25))
    title(axes, heading, provenance)
    if len(groups) > 1:
        for group, colour in colours.items():
            axes.bar(0, 0, color=colour, label=group)
        legend(axes, len(groups))
    return figure


def _bar(axes: Axes, place: float, rate: Rate, width: float, colour: str) -> None:
    axes.bar(place, rate.value, width, color=colour)
    top = rate.value
    if not math.isnan(rate.low):
        ends = [[rate.value - rate.low], [rate.high - rate.value]]
        axes.errorbar(place, rate.value, ends, color=TEXT, capsize=3, linewidth=1)
        top = rate.high
    axes.annotate(
        f"{rate.value:.2f}",
        (place, top),
        (0, 3),
        textcoords="offset points",
        ha="center",
        fontsize=8.5,
        color=TEXT,
    )


def plot_cumulative_success(
    frames: RunFrames,
    *,
    by: str = "learner",
    most: int | None = None,
    heading: str = "Cumulative success CS(k)",
    provenance: str = "",
    bands: bool = True,
) -> Figure:
    """Plots CS(k) of each learner with its pointwise interval.

    Bands of more than three curves would hide each other and are left out; use
    `plot_cumulative_panels` instead.

    Args:
        frames: The runs.
        by: Column of the runs that defines a curve.
        most: Largest k; by default one more than the longest run reached, at most K.
        heading: Title.
        provenance: Line below the title.
        bands: Whether to shade the 95 % intervals.
    """
    figure, axes = new_figure(6.4, 4.0)
    curves = _curves(frames, by, most)
    for number, (name, curve) in enumerate(curves.items()):
        colour = COLOURS[number % len(COLOURS)]
        _step(axes, curve, number, colour, label=_counted(frames, by, name))
        if bands and len(curves) <= 3:
            _band(axes, curve, colour)
    _frame(axes, curves)
    axes.set_xlabel("iteration k", color=TEXT)
    title(axes, heading, provenance)
    legend(axes, len(curves))
    return figure


def plot_cumulative_panels(
    frames: RunFrames,
    *,
    by: str = "learner",
    most: int | None = None,
    heading: str = "Cumulative success CS(k)",
    provenance: str = "",
) -> Figure:
    """Plots a panel per learner: its CS(k) with its band, the others in grey.

    Args:
        frames: The runs.
        by: Column of the runs that defines a panel.
        most: Largest k; by default one more than the longest run reached, at most K.
        heading: Title of the figure.
        provenance: Line below the title.
    """
    curves = _curves(frames, by, most)
    columns = min(3, max(1, len(curves)))
    rows = max(1, math.ceil(len(curves) / columns))
    figure = new_plot(2.7 * columns, 2.1 * rows + 0.5)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for number, axes in enumerate(grid.flat[len(curves) :], len(curves)):
        axes.set_axis_off()
        # The panel above is now the lowest of its column.
        if number >= columns:
            grid.flat[number - columns].tick_params(labelbottom=True)
    for number, (name, curve) in enumerate(curves.items()):
        axes, colour = apply_style(grid.flat[number]), COLOURS[number % len(COLOURS)]
        for other in curves.values():
            axes.step(other["k"], other["cs"], "-", where="post", color=BEHIND, lw=1)
        _band(axes, curve, colour)
        _step(axes, curve, 0, colour)
        axes.set_title(_counted(frames, by, name), fontsize=9.5, color=TEXT)
    if curves:
        _frame(grid.flat[0], curves)
    figure.supxlabel("iteration k", fontsize=9.5, color=TEXT)
    text = f"{heading}\n{provenance}" if provenance else heading
    figure.suptitle(text, x=0.01, ha="left", fontsize=10.5, color=TEXT)
    return figure


def _curves(frames: RunFrames, by: str, most: int | None) -> dict[str, pd.DataFrame]:
    """CS(k) of each kind up to its own K, starting with CS(0) = 0."""
    # One more than the longest run reached.
    reached = min(int(frames.runs["K"].max()), int(frames.runs["done"].max()) + 1)
    last = reached if most is None else most
    begin = pd.DataFrame({"k": [0], "cs": [0.0], "low": [0.0], "high": [0.0]})
    return {
        name: pd.concat(
            [begin, cumulative_success(runs, min(last, int(runs["K"].max())))],
            ignore_index=True,
        )
        for name, runs in frames.runs.groupby(by, sort=False)
    }


def _counted(frames: RunFrames, by: str, name: str) -> str:
    return f"{name} (R = {int((frames.runs[by] == name).sum())})"


def _step(
    axes: Axes, curve: pd.DataFrame, number: int, colour: str, label: str = ""
) -> None:
    """Draws a curve with a marker at each of its steps."""
    value = curve["cs"].to_numpy(float)
    axes.step(
        curve["k"],
        value,
        where="post",
        color=colour,
        linestyle=LINES[number % len(LINES)],
        marker=MARKERS[number % len(MARKERS)],
        markersize=5,
        markevery=[int(n) for n in np.flatnonzero(np.diff(value)) + 1],
        label=label,
    )


def _band(axes: Axes, curve: pd.DataFrame, colour: str) -> None:
    rest = curve[curve["k"] > 0]
    if len(rest) == 1:  # has no width of its own
        rest = pd.concat([rest, rest.assign(k=rest["k"] + 0.4)])
    axes.fill_between(
        rest["k"],
        rest["low"],
        rest["high"],
        step="post",
        color=colour,
        alpha=0.14,
        linewidth=0,
    )


def _frame(axes: Axes, curves: dict[str, pd.DataFrame]) -> None:
    axes.set_xlim(0, max(curve["k"].max() for curve in curves.values()) + 0.4)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_ylim(0, 1.03)
