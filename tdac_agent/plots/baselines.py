"""Figures of baselines: learning curves, success rates and generalisation."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, MaxNLocator, PercentFormatter

from tdac_agent.metrics.exact import exact_interval
from tdac_agent.plots.style import (
    ENTRANTS,
    LINES,
    TEXT,
    Look,
    describe,
    legend_above,
    new_plot,
    panels,
    rows_of,
    shade,
    title,
)

OURS, MODEL, REFERENCE = "builtin", "recorded model", "reference"
"""Beginnings of the names of policies that are no baselines."""
SMALL = {"size": 9.5, "pad": 14, "rise": 4, "small": 7.5}
"""Of the titles of panels."""


def plot_learning_curves(curves: pd.DataFrame) -> Figure:
    """Plots success over training steps, a panel per task.

    Args:
        curves: A row per evaluation, with the columns `task`, `algo`, `seed`, `steps`
            and `success_rate`.
    """
    tasks = list(curves["task"].drop_duplicates())
    algos = list(curves["algo"].drop_duplicates())
    figure, grid = panels(len(tasks), 2.5, 2.1, left=0.3, above=0.7)
    for axes, task in zip(grid, tasks, strict=False):
        for number, algo in enumerate(algos):
            rows = curves[(curves["task"] == task) & (curves["algo"] == algo)]
            if not rows.empty:
                _curve(axes, rows, algo.upper(), number)
        count = curves[curves["task"] == task].groupby("algo")["seed"].nunique()
        seeds = ", ".join(
            f"{str(algo).upper()}: {n} seed{'s' * (n > 1)}" for algo, n in count.items()
        )
        title(axes, task.replace(" ", ", "), seeds, **SMALL)
        axes.xaxis.set_major_locator(MaxNLocator(4))
        axes.set_ylim(-0.03, 1.05)
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x / 1000:.0f}k"))
    heading = "Success of learned policies in training"
    legend_above(figure, grid, 5, title=heading)
    describe(
        figure,
        heading,
        "A panel per task: thin lines are single seeds, a bold line is their mean, and "
        "the shaded area is their range.",
        below="training steps of all robots; "
        "thin: each seed, bold: mean, shaded: range",
        beside="evaluation episodes with goal reached",
    )
    return figure


def _curve(axes: Axes, rows: pd.DataFrame, label: str, number: int) -> None:
    """Draws each seed, and mean and range over the steps that all seeds cover."""
    seeds = [seed.sort_values("steps") for _, seed in rows.groupby("seed")]
    colour = shade(ENTRANTS["learned"].colour, number)
    line = LINES[number % len(LINES)]
    for seed in seeds:
        axes.plot(seed["steps"], seed["success_rate"], color=colour, lw=0.6, alpha=0.6)
    first = max(seed["steps"].min() for seed in seeds)
    last = min(seed["steps"].max() for seed in seeds)
    steps = np.unique(rows["steps"])
    steps = steps[(first <= steps) & (steps <= last)]
    values = np.array(
        [np.interp(steps, seed["steps"], seed["success_rate"]) for seed in seeds]
    )
    low, high = values.min(axis=0), values.max(axis=0)
    axes.fill_between(steps, low, high, color=colour, alpha=0.18, lw=0)
    axes.plot(steps, values.mean(axis=0), line, color=colour, lw=1.8, label=label)


def plot_success_by_policy(evaluation: pd.DataFrame) -> Figure:
    """Plots success by policy with exact intervals: a panel per task, a dot per seed.

    Args:
        evaluation: A row per policy and task, with the columns `task`, `policy`,
            `training`, `knows`, `episodes` and `reached`; the last two are empty if
            there is no such policy.
    """
    tasks = list(evaluation["task"].drop_duplicates())
    learned = evaluation.dropna(subset=["training"])
    policies = list(pd.concat([learned, evaluation])["policy"].drop_duplicates())
    names = [f"{policy} ({_known(evaluation, policy)})" for policy in policies]
    width, height = 1.9, 0.7 + 0.24 * len(policies)
    figure, grid = panels(len(tasks), width, height, left=2.2, above=0.75)
    missing = False
    for axes, task in zip(grid, tasks, strict=False):
        rows = evaluation[evaluation["task"] == task]
        for place, policy in enumerate(policies):
            known = rows[rows["policy"] == policy].dropna(subset=["episodes"])
            _dots(axes, known, len(policies) - place, _look(rows, policy))
            missing |= known.empty
        rows_of(axes, task, names, pad=4)
        axes.set_xlim(-0.05, 1.05)
        axes.set_xticks([0, 0.5, 1])
        axes.xaxis.set_major_formatter(PercentFormatter(1.0))
    heading = "Goals reached, by task and policy"
    legend_above(figure, grid, 5, title=heading)
    label = (
        "episodes with goal reached without contact, exact 95 % intervals; "
        "at the right: % of all"
    )
    if evaluation["training"].notna().any():
        label += "\none dot per training seed"
    if missing:
        label += "; –: no such policy"
    describe(
        figure,
        heading,
        "A panel per task, a row per policy with what it knows. The colour and shape "
        "of a dot say the kind of policy.",
        below=label,
    )
    return figure


def _known(evaluation: pd.DataFrame, policy: str) -> str:
    """What a policy knows, as its row says."""
    return ", ".join(evaluation[evaluation["policy"] == policy]["knows"].unique())


def _look(evaluation: pd.DataFrame, policy: str) -> Look:
    """How the kind of a policy is drawn."""
    if evaluation[evaluation["policy"] == policy]["training"].notna().any():
        return ENTRANTS["learned"]
    kinds = {OURS: "builtin", MODEL: "controller", REFERENCE: "privileged"}
    found = [kind for begin, kind in kinds.items() if policy.startswith(begin)]
    return ENTRANTS[found[0] if found else "baseline"]


def _dots(axes: Axes, known: pd.DataFrame, place: float, look: Look) -> None:
    if known.empty:
        axes.text(0.02, place, "–", va="center", fontsize=8, color="#888888")
        return
    offsets = np.linspace(0.22, -0.22, len(known)) if len(known) > 1 else [0.0]
    for offset, row in zip(offsets, known.to_dict("records"), strict=True):
        reached, episodes = int(row["reached"]), int(row["episodes"])
        rate = reached / episodes
        low, high = exact_interval(reached, episodes)
        axes.errorbar(
            rate,
            place + offset,
            xerr=[[rate - low], [high - rate]],
            fmt=look.marker,
            color=look.colour,
            markersize=4,
            linewidth=1,
            label=look.words,
            clip_on=False,
        )
    axes.annotate(
        f"{100 * known['reached'].sum() / known['episodes'].sum():.0f}",
        (1.0, place),
        (5, 0),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        va="center",
        fontsize=7.5,
        color=TEXT,
        annotation_clip=False,
    )


def plot_generalisation(results: pd.DataFrame) -> Figure:
    """Plots success on the training task and on other tasks, over all seeds, in %.

    Args:
        results: A row per policy and task, with the columns `trained_on`,
            `evaluated_on`, `seen`, `episodes` and `reached`, and `algo` if there are
            several.
    """
    trained = results["trained_on"].str.replace(" ", ", ")
    if "algo" in results:
        trained = results["algo"].str.upper() + ": " + trained
    sums = results.assign(trained=trained).groupby(
        ["trained", "evaluated_on"], sort=False
    )
    cells = sums[["reached", "episodes"]].sum()
    rates = (cells["reached"] / cells["episodes"]).unstack(sort=False)
    seen = sums["seen"].first().unstack(sort=False)
    rows, columns = list(rates.index), list(rates.columns)
    figure = new_plot(2.2 + 0.52 * len(columns), 1.4 + 0.36 * len(rows))
    axes = figure.add_subplot()
    axes.imshow(rates.to_numpy(float), cmap="cividis", vmin=0, vmax=1, aspect="auto")
    for y, policy in enumerate(rows):
        for x, place in enumerate(columns):
            _cell(axes, x, y, rates.loc[policy, place], seen.loc[policy, place])
    axes.set_xticks(range(len(columns)), columns, rotation=45, ha="right", fontsize=8)
    axes.set_yticks(range(len(rows)), rows, fontsize=8)
    axes.tick_params(length=0, colors=TEXT)
    axes.spines[:].set_visible(False)
    heading = "Goals reached on the training task and on others, in %"
    title(axes, heading, pad=10)
    describe(
        figure,
        heading,
        "A row per task of training, a column per task of evaluation; a frame marks "
        "the task of training. A cell is the mean of all seeds.",
    )
    axes.set_xlabel("evaluated on (framed: training task)", fontsize=9, color=TEXT)
    axes.set_ylabel("trained on", fontsize=9, color=TEXT)
    return figure


def _cell(axes: Axes, x: int, y: int, rate: float, seen: object) -> None:
    if math.isnan(rate):
        return
    colour = "white" if rate < 0.55 else "black"
    axes.text(
        x, y, f"{100 * rate:.0f}", ha="center", va="center", color=colour, fontsize=8
    )
    if seen is True or seen is np.True_:
        frame = Rectangle((x - 0.5, y - 0.5), 1, 1, fill=False, ec="#D55E00", lw=2)
        axes.add_patch(frame).set_clip_on(False)
