"""The paper's two figures: success rates as bars, CS(k) as curves."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from tdac_agent.metrics import Frames, cumulative_success, success_rate
from tdac_agent.plots.style import (
    LINES,
    MARKERS,
    TEXT,
    colours_of,
    legend,
    new_figure,
    spread,
    title,
)


def plot_success_rates(
    groups: dict[str, Frames],
    *,
    by: str = "learner",
    heading: str = "Success rate SR",
    provenance: str = "",
) -> Figure:
    """A bar per learner and group, with the interval of resampled runs.

    Args:
        groups: Runs by the name of where they are from; shown side by side.
        by: Column of the runs that makes a bar.
        heading: Title.
        provenance: A line below it: whose runs, how many.
    """
    names = _order(groups, by)
    figure, axes = new_figure(max(5.0, 1.1 + 0.95 * len(names)), 3.6)
    colours = colours_of(groups)
    offsets = spread(len(groups))
    width = 0.8 / max(1, len(groups))
    for (group, frames), offset in zip(groups.items(), offsets, strict=True):
        rates = {
            name: success_rate(frames.only(**{by: name}))
            for name in frames.runs[by].drop_duplicates()
        }
        for number, name in enumerate(names):
            rate = rates.get(name)
            if rate is None or math.isnan(rate.value):
                continue
            place = number + offset
            axes.bar(place, rate.value, 0.92 * width, color=colours[group])
            top = rate.value
            if not math.isnan(rate.low):
                ends = [[rate.value - rate.low], [rate.high - rate.value]]
                axes.errorbar(
                    place, rate.value, ends, color=TEXT, capsize=3, linewidth=1
                )
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
    axes.set_xticks(range(len(names)), names)
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.set_ylim(0, 1.12)
    axes.set_yticks(np.arange(0, 1.01, 0.25))
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    title(axes, heading, provenance)
    if len(groups) > 1:
        for group, colour in colours.items():
            axes.bar(0, 0, color=colour, label=group)
        legend(axes, len(groups))
    return figure


def plot_cumulative_success(
    frames: Frames,
    *,
    by: str = "learner",
    most: int | None = None,
    heading: str = "Cumulative success CS(k)",
    provenance: str = "",
    bands: bool = True,
) -> Figure:
    """CS(k) of each learner, with its pointwise interval.

    Args:
        frames: The runs.
        by: Column of the runs that makes a curve.
        most: Largest k; where the last curve has reached its end, by default.
        heading: Title.
        provenance: A line below it.
        bands: Whether to shade the 95 % intervals.
    """
    figure, axes = new_figure(6.4, 4.0)
    names = list(frames.runs[by].drop_duplicates())
    colours = colours_of(names)
    last = most if most is not None else _shown(frames.runs)
    for number, name in enumerate(names):
        curve = cumulative_success(frames.runs[frames.runs[by] == name], last)
        # From zero iterations, where nothing has succeeded.
        k = np.concatenate([[0], curve["k"]])
        value = np.concatenate([[0.0], curve["cs"]])
        count = int((frames.runs[by] == name).sum())
        axes.step(
            k,
            value,
            where="post",
            color=colours[name],
            linestyle=LINES[number % len(LINES)],
            marker=MARKERS[number % len(MARKERS)],
            markersize=5,
            markevery=[int(n) for n in np.flatnonzero(np.diff(value)) + 1],
            label=f"{name} (R = {count})",
        )
        if bands and len(names) <= 3:
            axes.fill_between(
                curve["k"],
                curve["low"],
                curve["high"],
                step="post",
                color=colours[name],
                alpha=0.14,
                linewidth=0,
            )
    axes.set_xlabel("iteration k", color=TEXT)
    axes.set_xlim(0, last + 0.4)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_ylim(0, 1.03)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    title(axes, heading, provenance)
    legend(axes, len(names))
    return figure


def _shown(runs: pd.DataFrame) -> int:
    """Iterations worth showing: one more than the longest run had."""
    return min(int(runs["K"].max()), int(runs["done"].max()) + 1)


def _order(groups: dict[str, Frames], by: str) -> list[str]:
    return list(
        dict.fromkeys(name for frames in groups.values() for name in frames.runs[by])
    )
