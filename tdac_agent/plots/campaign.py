"""The figure of a campaign's rates: a panel per task, a dot per kind of run."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tdac_agent.plots.style import (
    ENTRANTS,
    TEXT,
    describe,
    legend_above,
    panels,
    rows_of,
)

ROOM = {"left": 2.3, "above": 0.75, "narrowest": 6.4}
"""Inches that the labels need."""
ASKS = "language model", "no language model"
"""Whether a learner asks one, by `free`."""
LOOKS = ENTRANTS["controller"], ENTRANTS["builtin"]
"""How those are drawn."""


def plot_rates(rows: pd.DataFrame, label: str) -> Figure:
    """Plots the rate of each kind of run with its interval, a panel per task.

    Args:
        rows: A row per task and kind, with the columns `task`, `kind`, `R`, `censored`,
            `free` (whether the learner asks no language model), `rate`, `low` and
            `high`. A rate is missing without trials, its ends without an interval.
        label: What the rate is.
    """
    tasks = list(rows["task"].drop_duplicates())
    kinds = list(rows["kind"].drop_duplicates())
    height = 0.5 + 0.42 * len(kinds)
    figure, grid = panels(len(tasks), 2.2, height, **ROOM)
    for axes, task in zip(grid, tasks, strict=False):
        for row in rows[rows["task"] == task].to_dict("records"):
            _dot(axes, row, len(kinds) - kinds.index(row["kind"]))
        rows_of(axes, task, kinds)
        axes.set_ylim(0.5, len(kinds) + 0.7)  # with room for the values
        axes.set_xlim(-0.02, 1.02)
        axes.set_xticks([0, 0.25, 0.5, 0.75, 1], ["0", "", "0.5", "", "1"])
    legend_above(figure, grid, len(ASKS))
    describe(
        figure,
        f"Rates of kinds of runs: {', '.join(tasks)}",
        f"A panel per task, a row per kind of run. {label}: a dot with its value, "
        "and its interval as a line. R is the number of runs.",
        below=label,
    )
    return figure


def _dot(axes: Axes, row: dict[str, object], place: float) -> None:
    rate, free = float(str(row["rate"])), bool(row["free"])
    axes.annotate(
        _said(row, rate),
        (0.5 if pd.isna(rate) else min(max(rate, 0.2), 0.8), place),
        (0, 5),
        textcoords="offset points",
        ha="center",
        fontsize=7.5,
        color=TEXT,
    )
    if pd.isna(rate):
        return
    low, high = (float(str(row[name])) for name in ("low", "high"))
    ends = None if pd.isna(low) else [[rate - low], [high - rate]]
    axes.errorbar(
        rate,
        place,
        xerr=ends,
        fmt=LOOKS[free].marker,
        color=LOOKS[free].colour,
        markersize=5,
        linewidth=1.2,
        capsize=2.5,
        label=ASKS[free],
        clip_on=False,
    )


def _said(row: dict[str, object], rate: float) -> str:
    """The figure over a dot: the rate, and of how many runs it is."""
    text = "–" if pd.isna(rate) else f"{rate:.2f}"
    text += f" (R = {row['R']}"
    return text + (f", {row['censored']} cut short)" if row["censored"] else ")")
