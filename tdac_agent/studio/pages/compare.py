"""Two runs side by side, with what differs between them."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from pathlib import Path

from nicegui import ui

from tdac_agent.errors import RunError
from tdac_agent.html_report.code import count_changes, shown_diff
from tdac_agent.runs.run_record import RUN_FILE
from tdac_agent.studio.comparison import (
    Line,
    difference,
    figures_of,
    lines_of,
    settings_of,
)
from tdac_agent.studio.folder import within
from tdac_agent.studio.pages.layout import (
    address_of,
    framed,
    heading,
    report_frame,
    say_missing,
    shown_first,
)
from tdac_agent.studio.pages.trail import RUNS

MOST_LINES = 3000
"""Lines of a diff that are shown."""


def add(place: Path) -> None:
    """Adds the page."""

    @ui.page("/compare")
    async def compare(one: str = "", other: str = "") -> None:
        with framed("Two runs", place, under=[RUNS], headed=False):
            runs = {}
            for at in (one, other):
                folder = within(place, at)
                if folder is None or not (folder / RUN_FILE).is_file():
                    say_missing("run", at, "Runs")
                    return
                runs[at] = folder
            heading("Two runs", 1)
            if len(runs) < 2:
                ui.label("Choose two different runs.").classes("problem")
                return
            await shown_first()
            await _show(list(runs), list(runs.values()))


async def _show(names: Sequence[str], folders: Sequence[Path]) -> None:
    try:
        figures = lines_of(*map(figures_of, folders))
        settings = lines_of(*map(settings_of, folders))
    except RunError as error:
        ui.label(str(error)).classes("problem")
        return
    _show_table(names, figures)
    different = [line for line in settings if line[1] != line[2]]
    same = [line for line in settings if line[1] == line[2]]
    heading("Settings")
    if different:
        _show_table(names, different)
    with ui.expansion(f"{len(same)} settings are the same").classes("w-full"):
        _show_table(names, same)
    heading("Controllers")
    await _show_difference(names, folders)
    heading("Reports")
    with ui.element("div").classes("w-full grid grid-cols-1 lg:grid-cols-2 gap-3"):
        for at, folder in zip(names, folders, strict=True):
            with ui.column().classes("gap-1 min-w-0"):
                ui.link(at, address_of("/run", at)).classes("font-bold")
                report_frame(at, str((folder / RUN_FILE).stat().st_mtime_ns))


def _show_table(names: Sequence[str], lines: Sequence[Line]) -> None:
    """A table with a column for each run; what differs is marked."""
    with ui.element("table").classes("compared"):
        with ui.element("tr"):
            for name in ("", "", *names):
                with ui.element("th"):
                    ui.label(name)
        for name, one, other in lines:
            with ui.element("tr").classes("differs" if one != other else ""):
                for text in ("≠" if one != other else "", name, one, other):
                    with ui.element("td"):
                        ui.label(text)


async def _show_difference(names: Sequence[str], folders: Sequence[Path]) -> None:
    """What the second controller has in place of the first one's lines."""
    diff = await asyncio.to_thread(difference, *folders)
    if diff is None:
        ui.label("One of the runs has no controller.").classes("note")
    elif not diff:
        ui.label("The controllers are the same.").classes("note")
    else:
        added, removed = count_changes(diff)
        ui.label(
            f"Lines only in {names[0]} (−): {removed}; only in {names[1]} (+): {added}."
        ).classes("note")
        text = shown_diff(diff, MOST_LINES)  # with all that was in the files escaped
        ui.html(text, sanitize=False, tag="pre").classes("diff").props("tabindex=0")
