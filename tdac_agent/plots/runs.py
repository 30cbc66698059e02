"""Figures of one run: failed tests by candidate, and use of time and tokens."""

from __future__ import annotations

import itertools

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import StrMethodFormatter

from tdac_agent.errors import RunError
from tdac_agent.plots.style import (
    COLOURS,
    FAILED,
    NOTHING,
    PALE,
    TEXT,
    apply_style,
    legend,
    new_figure,
    new_plot,
    title,
)
from tdac_agent.runs.history import learner_named
from tdac_agent.runs.run_record import JOURNAL, Attempt, Run
from tdac_agent.storage.journal import JournalRecord, read_records

MOST_TESTS = 40
CELL, NARROW = 0.36, 0.21
"""Width of a candidate's column, inches: with few and with many candidates."""
MOST_LEVEL = 20
"""With more candidates, the labels are vertical."""
STEPS = {
    "generate": "writing",
    "edit": "editing",
    "summarise": "rules",
    "improve": "improving",
}


def plot_failures(run: Run) -> Figure:
    """Plots a row per test that ever failed, and a column per candidate (k, j)."""
    failed = list(dict.fromkeys(t for a in run.attempts for t in a.failed_tests))
    shown, left_out = failed[:MOST_TESTS], failed[MOST_TESTS:]
    cells = np.array(
        [
            [2 if not a.valid else int(test in a.failed_tests) for a in run.attempts]
            for test in shown
        ]
    ).reshape(len(shown), len(run.attempts))
    cell = CELL if len(run.attempts) <= MOST_LEVEL else NARROW
    width = 4.0 + cell * max(6, len(run.attempts))
    figure, axes = new_figure(width, 1.7 + 0.21 * max(3, len(shown)))
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    if cells.size:
        colours = ListedColormap([PALE, FAILED, NOTHING])
        axes.pcolormesh(cells, cmap=colours, vmin=0, vmax=2, edgecolor="w", linewidth=1)
        # A second cue besides colour.
        for y, x in np.argwhere(cells == 1):
            axes.text(x + 0.5, y + 0.5, "×", ha="center", va="center", color="w")
    for place, (before, after) in enumerate(itertools.pairwise(run.attempts), 1):
        if before.k != after.k:
            axes.axvline(place, color="w", linewidth=5)
            axes.axvline(place, color="#999999", linewidth=0.8)
    axes.set_xlim(0, max(6, len(run.attempts)))
    axes.invert_yaxis()
    axes.set_yticks(np.arange(len(shown)) + 0.5, [short_name(test) for test in shown])
    axes.tick_params(axis="y", labelsize=7.5, length=0)
    _label_candidates(axes, run.attempts)
    more = f"; {len(left_out)} of them not shown" if left_out else ""
    count = (
        f"{len(failed)} test{'' if len(failed) == 1 else 's'}" if failed else "no test"
    )
    learner = learner_named(run.learner)
    title(
        axes,
        f"Failed tests of {run.folder.name}",
        f"{learner}; {count} ever failed{more}",
    )
    names = {PALE: "passed", FAILED: "× failed", NOTHING: "no code"}
    there = [colour for number, colour in enumerate(names) if (cells == number).any()]
    figure.legend(
        handles=[Patch(color=colour, label=names[colour]) for colour in there],
        loc="outside lower right",
        ncols=3,
        frameon=False,
        fontsize=8,
    )
    return figure


def plot_breakdown(run: Run) -> Figure:
    """Plots the seconds and tokens of each candidate by use."""
    spent = _spent(journal_of(run))
    figure = new_plot(7.2 if run.tokens else 4.6, 3.2)
    panels = [
        apply_style(axes)
        for axes in figure.subplots(1, 2 if run.tokens else 1, squeeze=False).flat
    ]
    _stack(panels[0], spent, ("writing", "editing", "rules", "testing"), "seconds")
    counted = "" if run.tokens else "; tokens were not counted"
    subtitle = learner_named(run.learner) + counted
    title(panels[0], f"Time of {run.folder.name}", subtitle)
    if run.tokens:
        _stack(panels[1], spent, ("tokens in", "tokens out"), "tokens")
        panels[1].yaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
        cost = "" if run.cost is None else f"; {run.cost:.3f} USD"
        title(panels[1], "Tokens", f"{run.tokens:,} in total{cost}")
    return figure


def _label_candidates(axes: Axes, attempts: list[Attempt]) -> None:
    many = len(attempts) > MOST_LEVEL
    between = "   " if many else "\n"
    counts = [str(len(a.failed_tests)) if a.valid else "–" for a in attempts]
    labels = [
        f"{a.k}.{a.j}{between}{'✓' if a.passed else count}"
        for a, count in zip(attempts, counts, strict=True)
    ]
    places = np.arange(len(attempts)) + 0.5
    axes.set_xticks(places, labels, rotation=90 if many else 0, fontsize=8)
    axes.tick_params(axis="x", length=0)
    axes.set_xlabel("candidate k.j and its number of failed tests", color=TEXT, size=9)


def _stack(
    axes: Axes, spent: dict[str, dict[str, float]], parts: tuple[str, ...], unit: str
) -> None:
    """Draws a stacked bar per candidate; parts too small to see are left out."""
    names = list(spent)
    values = {
        part: np.array([uses.get(part, 0.0) for uses in spent.values()])
        for part in parts
    }
    most = sum(values.values(), np.zeros(len(names))).max(initial=0.0)
    below = np.zeros(len(names))
    for part, colour in zip(parts, COLOURS, strict=False):
        if values[part].max(initial=0.0) > 0.005 * most:
            axes.bar(names, values[part], bottom=below, color=colour, label=part)
            below += values[part]
    axes.set_xlabel("candidate k.j", color=TEXT)
    axes.set_ylabel(unit, color=TEXT)
    if len(names) > MOST_LEVEL:
        # Only the first candidate of an iteration is labelled.
        firsts = [n for n, name in enumerate(names) if name.endswith(".0")]
        kept = firsts[:: 1 + len(firsts) // 10]
        axes.set_xticks(kept, [names[n].removesuffix(".0") for n in kept])
        axes.set_xlabel("iteration k", color=TEXT)
    if below.any():
        legend(axes, 4)


def journal_of(run: Run) -> list[JournalRecord]:
    """The complete records of a run's journal.

    Raises:
        RunError: The run has no journal.
    """
    path = run.folder / JOURNAL
    if not path.is_file():
        raise RunError(f"cannot read {path}: no such file")
    return read_records(path)


def _spent(records: list[JournalRecord]) -> dict[str, dict[str, float]]:
    """Seconds and tokens by candidate and use."""
    spent: dict[str, dict[str, float]] = {}
    began: dict[str, float] = {}
    for record in records:
        event, seconds = record["event"], float(record["seconds"])
        if "k" not in record or "j" not in record:
            continue
        uses = spent.setdefault(f"{record['k']}.{record['j']}", {})
        if event in ("call.intent", "verify.start"):
            began[event] = seconds
        elif event == "call.reply":
            kind = str(record["kind"])
            use = STEPS.get(kind, kind)
            took = seconds - began.get("call.intent", seconds)
            uses[use] = uses.get(use, 0.0) + took
            for name in ("tokens_in", "tokens_out"):
                key = name.replace("_", " ")
                uses[key] = uses.get(key, 0.0) + record.get(name, 0)
        elif event == "verify.end" and "verify.start" in began:
            took = seconds - began.pop("verify.start")
            uses["testing"] = uses.get("testing", 0.0) + took
    return spent


def short_name(test: str) -> str:
    """A test's name without its file and `test_`."""
    return test.rpartition("::")[2].removeprefix("test_")
