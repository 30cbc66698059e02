"""Figures of a bench: who is better where, and on which worlds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdac_agent.plots.style import (
    ENTRANTS,
    MARKERS,
    TEXT,
    Look,
    apply_style,
    describe,
    legend_above,
    new_plot,
    panels,
    rows_of,
    shade,
)

DIFFICULTY = {
    "least_steps": "least time (OT), steps",
    "gap": "gap, body diameters",
    "detour": "detour",
    "in_sight": "path with the goal in sight",
    "density": "occupied floor",
    "movers": "movers",
}
"""Columns with figures of worlds, and their labels."""
BINS = 4
"""Groups of worlds of about the same number, by a figure of difficulty."""
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
    mean = "mean" if len(over) == len(sets) else f"mean of {len(over)}"
    names = [spoken(each) for each in order]
    width = _NAMES + 1.3 * len(columns)
    figure = new_plot(max(width, 5.0), 1.1 + 0.27 * len(order) + 0.3 * told)
    for axes, name in zip(
        np.atleast_1d(figure.subplots(1, len(columns), sharey=True)),
        columns,
        strict=True,
    ):
        apply_style(axes)
        own = rows[rows["set"] == name].set_index("entrant")
        for place, entrant in enumerate(order):
            if name == "" and entrant in means.index:
                _dot(axes, means.loc[entrant], len(order) - place, heavy=True)
            elif entrant in own.index:
                _dot(axes, own.loc[entrant], len(order) - place)
        rows_of(axes, name or mean, names, size=9, labels=9)
        axes.set_xlim(-0.03, 1.0)
        axes.set_xticks([0, 0.5, 1], ["0", "0.5", "1"])
        axes.tick_params(axis="y", length=0)
    finding = best_of_kinds(means)
    legend_above(figure, figure.axes, 6, title=finding if told else "")
    least, most = int(rows["worlds"].min()), int(rows["worlds"].max())
    worlds = f"{least}" if least == most else f"{least} to {most}"
    label = "time score: mean of success × OT / T, with 95 % intervals"
    label += f"; {worlds} worlds per set"
    describe(
        figure,
        f"Time scores. {finding}" if len(means) else "Time scores",
        "A column per set of worlds, a row per entrant, the best one at the top. "
        "The colour and shape of a mark say the kind of entrant; its value is at the "
        "right.",
        below=label,
        size=8.5,
    )
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
    look = ENTRANTS[row["kind"]]
    axes.errorbar(
        row["time"],
        place,
        xerr=[[row["time"] - row["low"]], [row["high"] - row["time"]]],
        fmt=look.marker,
        color=look.colour,
        markersize=5 if heavy else 4,
        linewidth=1.2,
        label=look.words,
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


def plot_difficulty(
    worlds: pd.DataFrame, name: str, kinds: Mapping[str, str] | None = None
) -> Figure:
    """Plots the success of entrants on easy and on hard worlds of a set, in %.

    A panel per figure of difficulty, with a column for each group of worlds.

    Args:
        worlds: A row per episode, with the columns `set`, `entrant`, `index` (of the
            world), `success`, and those of `DIFFICULTY`.
        name: The set.
        kinds: The kind of each entrant, which is marked next to its name.
    """
    own = worlds[worlds["set"] == name]
    figures = [key for key in DIFFICULTY if own[key].nunique() > BINS]
    reached = own.groupby("entrant", sort=False)["success"].mean()
    entrants = list(reached.sort_values(ascending=False, kind="stable").index)
    height = 0.75 + 0.21 * len(entrants)
    room = {"left": _NAMES, "above": 0.75, "narrowest": ROOM["narrowest"]}
    figure, grid = panels(len(figures), 1.75, height, **room)
    for axes, key in zip(grid, figures, strict=False):
        groups = _groups(own, key)
        cells = np.array(
            [[_rate(group, entrant) for group in groups] for entrant in entrants]
        )
        axes.imshow(cells, cmap="cividis", vmin=0, vmax=1, aspect="auto")
        for y, x in np.ndindex(cells.shape):
            _cell(axes, x, y, float(cells[y, x]))
        middles = [f"{group[key].mean():.3g}" for group in groups]
        axes.set_xticks(range(BINS), middles, fontsize=8)
        axes.set_yticks(range(len(entrants)), [spoken(each) for each in entrants])
        axes.tick_params(axis="both", length=0, labelsize=8)
        axes.tick_params(axis="y", pad=13 if kinds else 4)
        axes.grid(visible=False)
        axes.spines[:].set_visible(False)
        axes.set_title(DIFFICULTY[key], loc="left", fontsize=9, color=TEXT)
    title = f"{name}: goals reached, in %, by difficulty of the world"
    if kinds:
        _mark_kinds(grid, [ENTRANTS[kinds[entrant]] for entrant in entrants])
        legend_above(figure, grid, 6, title=title)
    else:
        figure.suptitle(title, x=0.01, ha="left", fontsize=11, weight="bold")
    describe(
        figure,
        f"{name}: goals reached, by difficulty",
        f"A panel per figure of difficulty, a row per entrant, and {BINS} columns with "
        "a quarter of the worlds each, small values first. A cell has the share of "
        "goals reached, in per cent.",
        below=f"mean of the worlds of a column; the {BINS} columns have as many worlds "
        "each",
        size=8.5,
    )
    return figure


def _groups(worlds: pd.DataFrame, key: str) -> list[pd.DataFrame]:
    """The episodes in groups with as many worlds, by a figure of the worlds."""
    values = worlds.groupby("index")[key].first().sort_values(kind="stable")
    return [
        worlds[worlds["index"].isin(part)]
        for part in np.array_split(values.index.to_numpy(), BINS)
    ]


def _rate(group: pd.DataFrame, entrant: str) -> float:
    return float(group.loc[group["entrant"] == entrant, "success"].mean())


def _cell(axes: Axes, x: int, y: int, rate: float) -> None:
    """A share in per cent on its ground; nothing without episodes."""
    if not np.isnan(rate):
        colour = "white" if rate < 0.55 else "black"
        axes.text(
            x, y, f"{100 * rate:.0f}", ha="center", va="center", color=colour,
            fontsize=7.5,
        )  # fmt: skip


def _mark_kinds(grid: Sequence[Axes], looks: Sequence[Look]) -> None:
    """Marks the kind of the entrant of each row before its first cell."""
    for axes in grid:
        for y, look in enumerate(looks):
            (mark,) = axes.plot([-0.66], [y], look.marker, label=look.words)
            mark.set(color=look.colour, markersize=4.5, clip_on=False)
        axes.set_xlim(-0.5, BINS - 0.5)


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
        for row in learned[learned["set"] == name].to_dict("records"):
            _trained(axes, row, entrants.index(row["entrant"]))
        others = rows[(rows["set"] == name) & (rows["kind"] != "learned")]
        _best_other(axes, others)
        axes.set_title(name, loc="left", fontsize=9.5, color=TEXT)
        axes.set_xlim(0, 1.15 * most)
        axes.xaxis.set_major_locator(MaxNLocator(4))
        axes.set_ylim(0, 1)
    finding = "Time score of learned policies over their training"
    legend_above(figure, grid, 4, title=finding)
    describe(
        figure,
        finding,
        "A panel per set of worlds, a mark with its value per kind of training; a "
        "dashed line is the best entrant that did not learn.",
        below="millions of steps to the kept policy, mean of its trainings; "
        "dashed: the best other entrant",
        beside="time score, 95 % intervals",
    )
    return figure


def _trained(axes: Axes, row: dict[Any, Any], number: int) -> None:
    """A learned entrant: its kind's colour, and a shape and shade of its own."""
    look, place = ENTRANTS["learned"], row["steps"] / row["files"] / 1e6
    first = MARKERS.index(look.marker)
    axes.errorbar(
        place,
        row["time"],
        yerr=[[row["time"] - row["low"]], [row["high"] - row["time"]]],
        fmt=MARKERS[(first + number) % len(MARKERS)],
        color=shade(look.colour, number),
        markersize=5.5,
        label=spoken(row["entrant"]),
        clip_on=False,
        zorder=3,
    )
    axes.annotate(
        f"{row['time']:.2f}",
        (place, row["high"]),
        (0, 3),
        textcoords="offset points",
        ha="center",
        fontsize=8,
        color=TEXT,
    )


def _best_other(axes: Axes, others: pd.DataFrame) -> None:
    """A dashed line at the best score of entrants that did not learn, with its name."""
    scores = others.set_index("entrant")["time"].dropna()
    if scores.empty:
        return
    name, best = scores.idxmax(), float(scores.max())
    axes.axhline(best, color="#666666", linewidth=1, linestyle="--")
    # On the side of the line with more room.
    up = best < 0.5
    axes.annotate(
        f"{spoken(str(name))} {best:.2f}",
        (0.02, best),
        (0, 3 if up else -3),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        va="bottom" if up else "top",
        fontsize=8,
        color=TEXT,
    )


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST - 1]}…"
