"""The figures of a campaign, beside its tables."""

from __future__ import annotations

import re
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from tdac_agent.campaign.collect import Tables
from tdac_agent.metrics import RunFrames
from tdac_agent.metrics.table import KIND
from tdac_agent.models.prices import FREE
from tdac_agent.plots import (
    plot_cumulative_panels,
    plot_cumulative_success,
    plot_rates,
    save_figure,
)

NO_MODEL = "no language model"
SR = (
    "SR: iterations that passed all tests, as a fraction of those with a controller; "
    "95 % intervals"
)
VERIFIED = "runs verified on hidden worlds, as a fraction; exact 95 % intervals"


def write_figures(tables: Tables, out: Path) -> list[Path]:
    """Writes the figures of a campaign to its folder; returns their paths.

    SR and, for each task, CS(k); on task sets, the fraction of verified runs. Without
    any run there is nothing to draw.
    """
    paths = []
    for name, figure in _figures(tables).items():
        save_figure(figure, out / name)
        paths.append(out / name)
    return paths


def _figures(tables: Tables) -> dict[str, Figure]:
    figures = {}
    if len(tables.summary):
        rates = _rates(tables.summary, "sr")
        figures["success_rate.png"] = plot_rates(rates, SR)
        kinds = dict(zip(_keys(rates), rates["kind"], strict=True))
        for task in rates["task"].drop_duplicates():
            name = re.sub(r"[^\w.-]+", "-", task)
            figure = _cumulative(tables.tasks.only(task=task), task, kinds)
            figures[f"cumulative_success-{name}.png"] = figure
    if len(tables.set_summary):
        rates = _rates(tables.set_summary, "rate")
        figures["set_verified_rate.png"] = plot_rates(rates, VERIFIED)
    return figures


def _cumulative(
    frames: RunFrames, task: str, kinds: dict[tuple[object, ...], str]
) -> Figure:
    runs = frames.runs
    runs = runs.assign(kind=[kinds[key] for key in _keys(runs)])
    alone = runs["kind"].nunique() == 1
    text = "bands: pointwise 95 % intervals" + ("" if alone else "; grey: the others")
    if cut := int(runs["censored"].sum()):
        text += f"\n{cut} of {len(runs)} runs cut short (Kaplan-Meier)"
    plot = plot_cumulative_success if alone else plot_cumulative_panels
    return plot(
        RunFrames(runs, frames.candidates),
        by="kind",
        heading=f"{task}: runs that have passed by iteration k, CS(k)",
        provenance=text,
    )


def _rates(summary: pd.DataFrame, name: str) -> pd.DataFrame:
    """A row per kind of run, as `plot_rates` takes them."""
    rates = summary[[*KIND, "R", "censored"]].copy()
    rates["free"] = [_is_free(name) for name in summary["learner"]]
    for end in ("", "_low", "_high"):
        rates[end.removeprefix("_") or "rate"] = summary[f"{name}{end}"]
    rates["kind"] = kind_names(summary)
    return rates


def kind_names(summary: pd.DataFrame) -> list[str]:
    """What each kind of run is called: its learner, and what distinguishes it.

    Args:
        summary: A row per kind and task, with the columns `KIND`.
    """
    several = [name for name in ("setting", "prompt") if summary[name].nunique() > 1]
    rows = summary.to_dict("records")
    names = [_name(row, several, _short(row["learner"])) for row in rows]
    kinds = summary.drop(columns="task")[[n for n in KIND if n != "task"]]
    if len(set(names)) < len(kinds.drop_duplicates()):
        return [_name(row, several, row["learner"]) for row in rows]
    return names


def _name(row: dict[str, str], several: list[str], learner: str) -> str:
    parts = [Path(row[name]).name for name in several]
    if row["optimizer"] != row["learner"]:
        parts.append(f"repairs: {_short(row['optimizer'])}")
    if _is_free(row["learner"]):
        parts.append(NO_MODEL)
    return f"{learner}\n{', '.join(parts)}" if parts else learner


def _short(learner: str) -> str:
    """A model without the folder of its script or recording."""
    provider, _, rest = learner.partition(":")
    return f"{provider}:{Path(rest).name}" if rest and _is_free(learner) else learner


def _is_free(learner: str) -> bool:
    return learner.partition(":")[0] in FREE


def _keys(frame: pd.DataFrame) -> list[tuple[object, ...]]:
    """The kind of each row."""
    return [tuple(row) for row in frame[list(KIND)].itertuples(index=False)]
