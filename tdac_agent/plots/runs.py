"""Figures of one run: what failed when, where time and tokens went, its timeline."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from tdac_agent.errors import RunError
from tdac_agent.journal import JournalRecord, read_records
from tdac_agent.plots.style import (
    COLOURS,
    FAILED,
    NOTHING,
    PASSED,
    TEXT,
    dress,
    legend,
    new_figure,
    title,
)
from tdac_agent.records import JOURNAL, Attempt, Run

MOST_TESTS = 40
STEPS = {"generate": "writing", "edit": "editing", "summarise": "rules"}


def plot_failures(run: Run) -> Figure:
    """A row per test that ever failed, a column per candidate (k, j)."""
    failed = _ever_failed(run.attempts)
    shown, left_out = failed[:MOST_TESTS], failed[MOST_TESTS:]
    cells = np.array(
        [
            [2 if not a.valid else int(test in a.failed_tests) for a in run.attempts]
            for test in shown
        ]
    ).reshape(len(shown), len(run.attempts))
    width = 3.6 + 0.34 * max(4, len(run.attempts))
    figure, axes = new_figure(width, 1.5 + 0.21 * max(3, len(shown)))
    colours = ListedColormap([PASSED, FAILED, NOTHING])
    axes.grid(visible=False)
    if cells.size:
        axes.pcolormesh(cells, cmap=colours, vmin=0, vmax=2, edgecolor="w", linewidth=1)
        # Not by colour alone.
        for y, x in np.argwhere(cells == 1):
            axes.text(x + 0.5, y + 0.5, "×", ha="center", va="center", color="w")
    axes.set_yticks(np.arange(len(shown)) + 0.5, [_short(test) for test in shown])
    axes.tick_params(axis="y", labelsize=7.5, length=0)
    labels = [f"{a.k}.{a.j}" for a in run.attempts]
    axes.set_xticks(np.arange(len(labels)) + 0.5, labels, rotation=90, fontsize=7.5)
    axes.set_xlabel("candidate k.j", color=TEXT)
    axes.invert_yaxis()
    more = f"; {len(left_out)} further tests left out" if left_out else ""
    told = "no test ever failed" if not failed else f"{len(failed)} tests ever failed"
    title(axes, f"What failed in {run.folder.name}", f"{run.learner}; {told}{more}")
    names = zip((PASSED, FAILED, NOTHING), ("passed", "failed", "no code"), strict=True)
    axes.legend(
        handles=[Patch(color=colour, label=name) for colour, name in names],
        loc="upper left",
        bbox_to_anchor=(1.0, 1.0),
        frameon=False,
        fontsize=8,
    )
    return figure


def plot_breakdown(run: Run) -> Figure:
    """Seconds and tokens of each candidate, by what they were used for."""
    spent = _spent(_journal(run))
    figure = Figure(figsize=(7.0, 3.2), layout="constrained")
    left, right = (dress(axes) for axes in figure.subplots(1, 2))
    names = list(spent)
    _stack(left, names, spent, ("writing", "editing", "rules", "testing"), "seconds")
    _stack(right, names, spent, ("tokens in", "tokens out"), "tokens")
    title(left, f"Time in {run.folder.name}", run.learner)
    title(right, "Tokens", "" if run.tokens_in else "none were counted")
    return figure


def plot_timeline(run: Run) -> Figure:
    """The run from above to below: what was found, what was changed, what it knew."""
    lines = list(_story(_journal(run)))
    height = 0.9 + 0.2 * sum(text.count("\n") + 1.6 for _, _, text, _ in lines)
    figure, axes = new_figure(7.6, max(2.0, height))
    axes.set_axis_off()
    row = 0.0
    for at, head, text, colour in lines:
        axes.plot([0], [row], "o", color=colour, markersize=7)
        axes.text(-0.15, row, at, ha="right", va="center", fontsize=8.5, color=TEXT)
        axes.text(
            0.2, row, head, va="center", fontsize=9, color=colour, fontweight="bold"
        )
        axes.text(2.2, row - 0.35, text, va="top", fontsize=8.5, color=TEXT)
        row += text.count("\n") + 1.6
    axes.plot([0, 0], [0, row - 1.6], color="#CCCCCC", zorder=0)
    axes.set_xlim(-1.0, 11.5)
    axes.set_ylim(row, -1.0)
    title(axes, f"Timeline of {run.folder.name}", f"{run.task}, {run.learner}")
    return figure


def _stack(
    axes: Any,
    names: list[str],
    spent: dict[str, dict[str, float]],
    parts: tuple[str, ...],
    unit: str,
) -> None:
    below = np.zeros(len(names))
    for number, part in enumerate(parts):
        values = np.array([spent[name].get(part, 0.0) for name in names])
        if values.any():
            axes.bar(names, values, bottom=below, color=COLOURS[number], label=part)
        below += values
    axes.set_xlabel("candidate k.j", color=TEXT)
    axes.set_ylabel(unit, color=TEXT)
    if below.any():
        legend(axes, 4)


def _journal(run: Run) -> list[JournalRecord]:
    """The whole records of a run's journal.

    Raises:
        RunError: There is none.
    """
    path = run.folder / JOURNAL
    if not path.is_file():
        raise RunError(f"cannot read {path}: there is no such file")
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


def _story(records: list[JournalRecord]) -> Iterator[tuple[str, str, str, str]]:
    """(where, what, text, colour) of what a reader wants to know."""
    for record in records:
        event = record["event"]
        at = f"k={record['k']}" if "k" in record else ""
        if "j" in record:
            at += f" j={record['j']}"
        if event == "verify.end":
            yield (at, *_verdict(record))
        elif event == "rules" and record["notes"]:
            rules = [f"{rule['id']}: {rule['text']}" for rule in record["rules"]]
            yield at, "rules", _wrapped(rules or ["none are in force"]), COLOURS[0]
        elif event == "call.fault":
            yield at, "fault", _wrapped([record["reason"]]), COLOURS[4]
        elif event == "run.end" and record["status"] != "verified":
            yield at, record["status"], "", FAILED


def _verdict(record: JournalRecord) -> tuple[str, str, str]:
    notes = record["notes"][:3]
    if record["passed"]:
        return "verified", _wrapped(["all tests passed", *notes]), PASSED
    if not record["valid"]:
        return "no code", _wrapped(notes), COLOURS[4]
    failed = [_short(test) for test in record["failed_tests"]]
    return f"{len(failed)} failed", _wrapped([", ".join(failed), *notes]), FAILED


def _wrapped(texts: list[str], most: int = 4) -> str:
    lines = [line for text in texts for line in textwrap.wrap(text, 96)]
    more = len(lines) - most
    return "\n".join(lines[:most] + ([f"… {more} more lines"] if more > 0 else []))


def _ever_failed(attempts: list[Attempt]) -> list[str]:
    return list(dict.fromkeys(t for a in attempts for t in a.failed_tests))


def _short(test: str) -> str:
    return test.rpartition("::")[2].removeprefix("test_")
