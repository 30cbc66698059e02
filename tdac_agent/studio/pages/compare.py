"""Two runs side by side."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from nicegui import ui

from tdac_agent.library.listing import row_of
from tdac_agent.models.budget import format_usd
from tdac_agent.runs.run_record import RUN_FILE
from tdac_agent.studio.pages.layout import address_of, framed, report_frame, within

FIGURES: dict[str, Callable[[dict[str, Any]], str]] = {
    "status": lambda row: str(row["status"]),
    "task": lambda row: str(row.get("task", "")),
    "writer": lambda row: str(row.get("learner", "")),
    "iterations": lambda row: f"{row.get('k', '–')} of {row.get('iterations', '–')}",
    "time": lambda row: f"{row.get('seconds') or 0.0:.0f} s",
    "tokens": lambda row: f"{row.get('tokens_in', 0) + row.get('tokens_out', 0):,}",
    "cost": lambda row: "–" if row.get("cost") is None else format_usd(row["cost"]),
}
"""Figures of runs beside each other, from the rows of the list."""


def add(place: Path) -> None:
    """Adds the page."""

    @ui.page("/compare")
    async def compare(one: str = "", other: str = "") -> None:
        with framed("Two runs"):
            runs = {}
            for at in (one, other):
                folder = within(place, at)
                if folder is None or not (folder / RUN_FILE).is_file():
                    ui.label(f"There is no run {at!r} here.").classes("problem")
                    return
                runs[at] = folder
            _show_figures(runs)
            with ui.row().classes("w-full gap-3"):
                for at, folder in runs.items():
                    with ui.column().classes("w-full lg:w-[49%] gap-1"):
                        ui.link(at, address_of("/run", at)).classes("font-bold")
                        report_frame(at, str((folder / RUN_FILE).stat().st_mtime_ns))


def _show_figures(runs: dict[str, Path]) -> None:
    """A table with the figures of runs, a column for each."""
    rows = {at: row_of(folder) for at, folder in runs.items()}
    names = ["", *rows]
    columns = [
        {"name": name, "label": name, "field": name, "align": "left"} for name in names
    ]
    lines = [
        {"": label, **{at: told(row) for at, row in rows.items()}}
        for label, told in FIGURES.items()
    ]
    ui.table(columns=columns, rows=lines).classes("w-full").props("dense flat")
