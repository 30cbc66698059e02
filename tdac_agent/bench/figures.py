"""Figures of the results in a folder."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from tdac_agent.bench.record import Bench
from tdac_agent.plots.arena import plot_difficulty, plot_scores, plot_training
from tdac_agent.plots.style import save_figure

SCORES, TRAINING = "scores.svg", "training.svg"
LEAST_WORLDS = 20
"""Worlds of a set that are enough for groups by difficulty."""


def draw_figures(
    found: Bench,
    worlds: pd.DataFrame | None,
    out: Path,
    *,
    scores: Figure | None = None,
) -> list[str]:
    """Draws the figures of a bench; returns the names of their files.

    Args:
        found: The bench.
        worlds: Its `worlds.csv`; None while the worlds are sealed.
        out: Folder for the figures.
        scores: The figure of the scores, if not that of all sets.
    """
    rows = frame_of(found)
    if rows["time"].isna().all():
        return []
    save_figure(scores or plot_scores(rows), out / SCORES)
    names = [SCORES]
    if ((rows["kind"] == "learned") & rows["steps"].notna()).any():
        save_figure(plot_training(rows), out / TRAINING)
        names.append(TRAINING)
    kinds = dict(zip(rows["entrant"], rows["kind"], strict=True))
    for each in found.sets if worlds is not None and len(worlds) else ():
        assert worlds is not None
        if (worlds["set"] == each.name).any() and each.worlds >= LEAST_WORLDS:
            names.append(f"difficulty-{each.name}.svg")
            figure = plot_difficulty(worlds, each.name, kinds)
            save_figure(figure, out / names[-1])
    return names


def frame_of(found: Bench) -> pd.DataFrame:
    """The rows of a bench as a table, for figures and notebooks."""
    return pd.DataFrame(
        [
            {
                "set": row.set,
                "entrant": row.entrant,
                "kind": row.kind,
                "knows": row.knows,
                "steps": row.steps,
                "files": len(row.files),
                "worlds": row.worlds,
                "time": row.time.value if row.time else None,
                "low": row.time.low if row.time else None,
                "high": row.time.high if row.time else None,
                "success": row.success.value if row.success else None,
                "path": row.path,
            }
            for row in found.rows
        ]
    ).astype({"time": float, "low": float, "high": float, "steps": float})
