"""Figures of a bench: who is better where, and on which worlds."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdac_agent.plots.style import (
    COLOURS,
    MARKERS,
    TEXT,
    legend_above,
    line_style,
    panels,
)

DIFFICULTY = {
    "least_steps": "OT, steps",
    "gap": "gap, body diameters",
    "detour": "detour",
    "in_sight": "path with the goal in sight",
    "density": "occupied floor",
    "movers": "movers",
}
"""Columns with figures of worlds, and their labels."""
BINS = 4
"""Groups of worlds of about the same number, by a figure of difficulty."""
_KINDS = {
    "builtin": "builtin",
    "planner": "classical planner",
    "controller": "controller file",
    "learned": "learned",
    "baseline": "follows waypoints",
    "privileged": "knows the true world",
}
# Inches that the labels below and above the panels need.
ROOM = {"above": 0.8, "narrowest": 6.2}
# Characters of a name.
_LONGEST = 22


def plot_scores(rows: pd.DataFrame) -> Figure:
    """Plots the time score of each entrant with its interval, a panel per set.

    Args:
        rows: A row per set and entrant, with the columns `set`, `entrant`, `kind`,
            `worlds`, `time`, `low` and `high`; `time` is empty for one that did not
            drive.
    """
    sets = list(rows["set"].drop_duplicates())
    mean = rows.groupby("entrant", sort=False)["time"].mean()
    order = list(mean.sort_values(ascending=False, kind="stable").index)
    height = 0.55 + 0.22 * len(order)
    figure, grid = panels(len(sets), 2.1, height, left=1.3, **ROOM)
    for axes, name in zip(grid, sets, strict=False):
        own = rows[rows["set"] == name].set_index("entrant")
        for place, entrant in enumerate(order):
            _dot(axes, own, entrant, len(order) - place)
        axes.set_title(
            f"{name}, {int(own['worlds'].max())} worlds", loc="left", fontsize=9.5,
            color=TEXT,
        )  # fmt: skip
        axes.set_yticks(range(len(order), 0, -1), [_short(name) for name in order])
        axes.set_ylim(0.4, len(order) + 0.6)
        axes.set_xlim(-0.02, 1.0)
        axes.set_xticks([0, 0.25, 0.5, 0.75, 1], ["0", "", "0.5", "", "1"])
        axes.grid(visible=True, axis="x", color="#E5E5E5", linewidth=0.8)
    legend_above(figure, grid, 4)
    label = "time score: mean of success x OT / T, with 95 % intervals"
    if rows["time"].notna().sum() < len(sets) * len(order):
        label += "; –: did not drive"
    figure.supxlabel(label, fontsize=9, color=TEXT)
    return figure


def _dot(axes: Axes, own: pd.DataFrame, entrant: str, place: float) -> None:
    if entrant not in own.index or pd.isna(own.loc[entrant, "time"]):
        box = {"facecolor": "white", "edgecolor": "none", "pad": 2}
        axes.text(0.5, place, "–", ha="center", va="center", color="#666666", bbox=box)
        return
    row = own.loc[entrant]
    kind = list(_KINDS).index(row["kind"])
    axes.errorbar(
        row["time"],
        place,
        xerr=[[row["time"] - row["low"]], [row["high"] - row["time"]]],
        fmt=MARKERS[kind],
        color=COLOURS[kind],
        markersize=4,
        linewidth=1.2,
        label=_KINDS[row["kind"]],
        clip_on=False,
    )


def plot_difficulty(worlds: pd.DataFrame, name: str) -> Figure:
    """Plots the success of entrants on easy and on hard worlds of a set.

    Args:
        worlds: A row per episode, with the columns `set`, `entrant`, `success`, and
            those of `DIFFICULTY`.
        name: The set.
    """
    own = worlds[worlds["set"] == name]
    figures = [key for key in DIFFICULTY if own[key].nunique() > BINS]
    figure, grid = panels(len(figures), 2.4, 2.1, left=0.4, **ROOM)
    reached = own.groupby("entrant", sort=False)["success"].mean()
    entrants = list(reached.sort_values(ascending=False, kind="stable").index)
    for axes, key in zip(grid, figures, strict=False):
        for number, entrant in enumerate(entrants):
            rows = own[own["entrant"] == entrant]
            centres, success = _binned(rows[key], rows["success"])
            axes.plot(
                centres,
                success,
                **line_style(number),
                markersize=3.5,
                linewidth=1.2,
                label=_short(entrant),
                clip_on=False,
            )
        axes.set_xlabel(DIFFICULTY[key], fontsize=9, color=TEXT)
        axes.set_ylim(-0.02, 1.02)
        axes.xaxis.set_major_locator(MaxNLocator(4))
    legend_above(figure, grid, 4)
    label = f"reached, in {BINS} groups of as many worlds"
    figure.supylabel(label, fontsize=9, color=TEXT)
    return figure


def _binned(values: pd.Series, success: pd.Series) -> tuple[list[float], list[float]]:
    """Mean value and rate of success in groups of as many rows, by value."""
    order = values.to_numpy().argsort(kind="stable")
    groups = np.array_split(order, BINS)
    return (
        [float(values.iloc[group].mean()) for group in groups],
        [float(success.iloc[group].mean()) for group in groups],
    )


def plot_training(rows: pd.DataFrame) -> Figure:
    """Plots the time score of learned entrants over their training, a panel per set.

    Args:
        rows: As for `plot_scores`, with the columns `steps` and `files`, too.
    """
    learned = rows[(rows["kind"] == "learned") & rows["steps"].notna()]
    learned = learned[learned["time"].notna()]
    sets = list(learned["set"].drop_duplicates())
    entrants = list(learned["entrant"].drop_duplicates())
    most = (learned["steps"] / learned["files"]).max() / 1e6
    figure, grid = panels(len(sets), 2.4, 2.1, left=0.4, **ROOM)
    for axes, name in zip(grid, sets, strict=False):
        for row in learned[learned["set"] == name].itertuples():
            style = line_style(entrants.index(row.entrant))
            axes.errorbar(
                row.steps / row.files / 1e6,
                row.time,
                yerr=[[row.time - row.low], [row.high - row.time]],
                **{**style, "linestyle": "none"},
                label=_short(row.entrant),
            )
        best = rows[(rows["set"] == name) & (rows["kind"] != "learned")]["time"].max()
        if not pd.isna(best):
            axes.axhline(best, color="#666666", linewidth=1, linestyle="--")
        axes.set_title(name, loc="left", fontsize=9.5, color=TEXT)
        axes.set_xlim(0, 1.1 * most)
        axes.xaxis.set_major_locator(MaxNLocator(4))
        axes.set_ylim(0, 1)
    legend_above(figure, grid, 4)
    label = (
        "millions of steps to the kept policy, mean of its trainings; "
        "dashed: the best other entrant"
    )
    figure.supxlabel(label, fontsize=9, color=TEXT)
    figure.supylabel("time score, 95 % intervals", fontsize=9, color=TEXT)
    return figure


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST - 1]}…"
