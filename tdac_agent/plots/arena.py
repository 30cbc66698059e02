"""Figures of a bench: who is better where, and on which worlds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdac_agent.plots.style import (
    COLOURS,
    GRID,
    MARKERS,
    TEXT,
    apply_style,
    legend_above,
    line_style,
    new_plot,
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
    "builtin": "our own program",
    "planner": "classical planner",
    "controller": "controller file",
    "learned": "learned policy",
    "baseline": "follows waypoints",
    "privileged": "knows the true world",
}
# Inches that the labels below and above the panels need.
ROOM = {"above": 0.8, "narrowest": 6.2}
# Characters of a name.
_LONGEST = 26
# Inches of the column of names.
_NAMES = 2.2
_SPOKEN = {
    "builtin": "our own program (builtin)",
    "first-answers": "language model, one answer",
    "dwa": "DWA",
    "mppi": "MPPI",
    "orca": "ORCA",
    "ppo": "PPO",
    "ppo-with-map": "PPO with the map",
    "recurrent-ppo": "recurrent PPO",
}


def plot_scores(
    rows: pd.DataFrame, over: Sequence[str] = (), *, told: bool = False
) -> Figure:
    """Plots the time score of each entrant with its interval, a column per set.

    Of several sets, the first column is the mean. An entrant that did not drive on a
    set has no mark there; without one of those in the mean, it has no mean.

    Args:
        rows: A row per set and entrant, with the columns `set`, `entrant`, `kind`,
            `worlds`, `time`, `low` and `high`; `time` is empty for one that did not
            drive.
        over: The sets of the mean; empty for all of them.
        told: Whether the title says the best mean of each kind of entrants.
    """
    rows = rows[rows["time"].notna()]
    sets = list(rows["set"].drop_duplicates())
    over = over or sets
    means = mean_scores(rows, over)
    order = _in_order(rows, means)
    columns = ["", *sets] if len(sets) > 1 else sets
    width = _NAMES + 1.3 * len(columns)
    figure = new_plot(max(width, 5.0), 1.1 + 0.27 * len(order) + 0.3 * told)
    for axes, name in zip(
        np.atleast_1d(figure.subplots(1, len(columns), sharey=True)),
        columns,
        strict=True,
    ):
        apply_style(axes)
        axes.grid(visible=True, axis="x", color=GRID, linewidth=0.8)
        own = rows[rows["set"] == name].set_index("entrant")
        for place, entrant in enumerate(order):
            if name == "" and entrant in means.index:
                _dot(axes, means.loc[entrant], len(order) - place, heavy=True)
            elif entrant in own.index:
                _dot(axes, own.loc[entrant], len(order) - place)
        axes.set_title(
            name or ("mean" if len(over) == len(sets) else f"mean of {len(over)}"),
            loc="left", fontsize=9, color=TEXT,
        )  # fmt: skip
        axes.set_yticks(range(len(order), 0, -1), [spoken(each) for each in order])
        axes.set_ylim(0.4, len(order) + 0.6)
        axes.set_xlim(-0.03, 1.0)
        axes.set_xticks([0, 0.5, 1], ["0", "0.5", "1"])
        axes.tick_params(axis="y", length=0)
    finding = best_of_kinds(means)
    figure.set_label(f"Time scores. {finding}" if len(means) else "Time scores")
    legend_above(figure, figure.axes, 6, title=finding if told else "")
    least, most = int(rows["worlds"].min()), int(rows["worlds"].max())
    worlds = f"{least}" if least == most else f"{least} to {most}"
    label = "time score: mean of success × OT / T, with 95 % intervals"
    label += f"; {worlds} worlds per set"
    figure.supxlabel(label, fontsize=8.5, color=TEXT)
    return figure


def mean_scores(rows: pd.DataFrame, sets: Sequence[str]) -> pd.DataFrame:
    """The mean time score over `sets` of the entrants that drove on all of them.

    The interval takes the worlds of different sets for independent.

    Returns:
        Columns `kind`, `time`, `low` and `high`, by entrant; the best one first.
    """
    own = rows[rows["set"].isin(list(sets)) & rows["time"].notna()]
    found = {}
    for entrant, each in own.groupby("entrant", sort=False):
        if len(each) == len(sets):
            mean = each["time"].mean()
            down = np.hypot.reduce(each["time"] - each["low"]) / len(each)
            up = np.hypot.reduce(each["high"] - each["time"]) / len(each)
            found[entrant] = each["kind"].iloc[0], mean, mean - down, mean + up
    columns = ["kind", "time", "low", "high"]
    means = pd.DataFrame.from_dict(found, orient="index", columns=columns)
    return means.sort_values("time", ascending=False, kind="stable")


def spoken(entrant: str) -> str:
    """The name of an entrant as a reader of a figure says it."""
    return _SPOKEN.get(entrant) or _short(entrant)


def best_of_kinds(means: pd.DataFrame) -> str:
    """The best mean of each kind of entrants, in a sentence."""
    best = means.groupby("kind", sort=False).head(1)
    words = [f"{spoken(name)} {row['time']:.2f}" for name, row in best.iterrows()]
    return f"On new worlds: {' · '.join(words)}"


def _in_order(rows: pd.DataFrame, means: pd.DataFrame) -> list[str]:
    """All entrants, by their mean over the sets on which they drove."""
    mean = rows.groupby("entrant", sort=False)["time"].mean()
    mean.update(means["time"])
    return list(mean.sort_values(ascending=False, kind="stable").index)


def _dot(axes: Axes, row: pd.Series, place: float, *, heavy: bool = False) -> None:
    kind = list(_KINDS).index(row["kind"])
    axes.errorbar(
        row["time"],
        place,
        xerr=[[row["time"] - row["low"]], [row["high"] - row["time"]]],
        fmt=MARKERS[kind],
        color=COLOURS[kind],
        markersize=5 if heavy else 4,
        linewidth=1.2,
        label=_KINDS[row["kind"]],
        clip_on=False,
    )
    axes.annotate(
        f"{row['time']:.2f}",
        (1.0, place),
        (3, 0),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        va="center",
        fontsize=8.5 if heavy else 7.5,
        weight="bold" if heavy else "normal",
        color=TEXT,
        annotation_clip=False,
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
