"""The summary of all runs: rates with their intervals, and figures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from tdac_agent.html_report.figures import drawn
from tdac_agent.metrics import (
    ASSUMPTIONS,
    Rate,
    RunFrames,
    first_pass,
    frames_of,
    set_frame_of,
    success_rate,
    summarise,
    summarise_sets,
)
from tdac_agent.metrics.table import KIND
from tdac_agent.plots import plot_cumulative_success, plot_success_rates
from tdac_agent.runs.history import RunHistory

MOST_CURVES = 8


@dataclass(frozen=True, slots=True)
class Overview:
    """Summary of all runs.

    Attributes:
        kinds: A row per kind of run on tasks: its labels, and its metrics as text.
        set_kinds: Likewise for runs on task sets.
        assumptions: A line per kind of interval: what it assumes.
        figures: Title and data URL of each figure; none for a single run.
    """

    kinds: tuple[dict[str, Any], ...]
    set_kinds: tuple[dict[str, Any], ...]
    assumptions: tuple[str, ...]
    figures: tuple[tuple[str, str], ...]


def overview_of(histories: Sequence[RunHistory]) -> Overview:
    """Summarises runs of one or several kinds."""
    frames = frames_of(one.run for one in histories)
    set_kinds = tuple(_set_kinds(histories))
    if not len(frames.runs):
        return Overview((), set_kinds, (), ())
    table = summarise(frames).to_dict("records")
    groups = [frames.only(**{name: row[name] for name in KIND}) for row in table]
    working = {str(one.run.folder) for one in histories if one.status == "running"}
    kinds = tuple(
        _kind(row, group.runs, group.runs["run"].isin(working))
        for row, group in zip(table, groups, strict=True)
    )
    return Overview(kinds, set_kinds, _assumptions(groups), _figures(frames))


def _kind(
    row: dict[str, Any], runs: pd.DataFrame, working: pd.Series
) -> dict[str, Any]:
    return row | {
        "running": int(working.sum()),
        "cut_short": int((runs["censored"] & ~working).sum()),
        "sr": _rate(row, "sr"),
        "first_pass": _rate(row, "first_pass"),
        "cs_K": _rate(row, "cs_K"),
        "tau_mean": _number(row["tau_mean"], ".1f"),
        **_means(row, "passed"),
    }


def _set_kinds(histories: Sequence[RunHistory]) -> Iterator[dict[str, Any]]:
    """Yields the rows of the runs on task sets."""
    frame = set_frame_of(one.run for one in histories)
    working = {str(one.run.folder) for one in histories if one.status == "running"}
    for row in summarise_sets(frame).to_dict("records") if len(frame) else ():
        same = (frame[list(KIND)] == [row[name] for name in KIND]).all(axis=1)
        running = int(frame[same]["run"].isin(working).sum())
        yield row | {
            "running": running,
            "cut_short": row["censored"] - running,
            "rate": _rate(row, "rate"),
            "time_score": _rate(row, "time_score"),
            "episodes_mean": _number(row["episodes_mean"], ",.0f"),
            **_means(row, "verified"),
        }


def _means(row: dict[str, Any], word: str) -> dict[str, str]:
    return {
        "tokens_each": _number(row[f"tokens_per_{word}"], ",.0f"),
        "cost_each": _number(row[f"cost_per_{word}"], ".3f"),
        "seconds_mean": _number(row["seconds_mean"], ",.0f"),
    }


def _rate(row: dict[str, Any], name: str) -> str:
    ends = row[f"{name}_low"], row[f"{name}_high"]
    return str(Rate(row[name], 0, 0, *ends, ""))


def _number(value: float, form: str) -> str:
    return "–" if pd.isna(value) else format(value, form)


def _assumptions(groups: list[RunFrames]) -> tuple[str, ...]:
    """The kind of interval of each metric, and what it assumes."""
    methods = [("SR", success_rate(group).method) for group in groups]
    methods += [("CS(K), first pass", first_pass(group).method) for group in groups]
    return tuple(
        f"{name}: {ASSUMPTIONS[method]}"
        if method == "none"
        else f"{name}: {method}: {ASSUMPTIONS[method]}"
        for name, method in dict.fromkeys(methods)
    )


def _figures(frames: RunFrames) -> tuple[tuple[str, str], ...]:
    names = frames.runs["learner"].nunique()
    if len(frames.runs) < 2 or names > MOST_CURVES:
        return ()
    source = f"{len(frames.runs)} runs"
    if frames.runs["task"].nunique() > 1:
        source += " of all tasks"
    figures = {
        "Success rate SR": plot_success_rates({source: frames}, provenance=source),
        "Cumulative success CS(k)": plot_cumulative_success(
            frames, provenance=f"{source}; pointwise 95 % intervals"
        ),
    }
    return tuple((name, drawn(figure)) for name, figure in figures.items())


def format_seconds(seconds: float) -> str:
    """Formats a duration, such as `2 min 05 s`."""
    if not math.isfinite(seconds):
        return "–"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{seconds:.1f} s"
