"""The list of runs, trainings, campaigns and benches in the folder."""

from __future__ import annotations

import asyncio
import time
from datetime import datetime
from pathlib import Path
from typing import Any

from nicegui import events, ui

from tdac_agent.campaign.drive import CONFIG_FILE
from tdac_agent.library.listing import folders_of, row_of, variations_text
from tdac_agent.models.budget import format_usd
from tdac_agent.runs.run_record import DELIVERED, JOURNAL, RUN_FILE
from tdac_agent.studio.folder import folders_with, within
from tdac_agent.studio.jobs import StudioJob, jobs
from tdac_agent.studio.pages.bench import show_benches
from tdac_agent.studio.pages.layout import (
    address_of,
    framed,
    heading,
    report_frame,
    say_empty,
    say_missing,
    shown_first,
)
from tdac_agent.studio.pages.run_tables import NONE_BEGUN, TABLE_STYLE, RunTables
from tdac_agent.studio.pages.trail import NEW, RUNS
from tdac_agent.studio.run_groups import RunGroup, campaign_command, grouped
from tdac_envs.core.intake import read_zip

NONE = "–"
NO_RUNS = "No run in this folder yet. Let a first controller be written:"
SECONDS = 5.0
"""Between two looks at the folder."""
MOST_ROWS = 2_000
MOST_UPLOAD = 256 << 20
MOST_UNPACKED = 1 << 30
_known: dict[Path, tuple[tuple[int, ...], dict[str, Any]]] = {}


def add(place: Path) -> None:
    """Adds the page."""

    @ui.page("/runs")
    async def page() -> None:
        with framed("Runs", place):
            ui.add_css(TABLE_STYLE)
            run_list = RunList(place)
            _show_upload(place)
            await shown_first()
            await run_list.look()
            ui.timer(SECONDS, run_list.look)

    @ui.page("/campaign")
    async def campaign(at: str = "") -> None:
        with framed(at or "Campaign", place, under=[RUNS], headed=False):
            folder = within(place, at)
            if folder is None or not (folder / CONFIG_FILE).is_file():
                say_missing("campaign", at, "Runs")
                return
            heading(at, 1)
            if folders_of(folder):
                report_frame(at, str(time.time_ns()))
            else:
                say_empty(NONE_BEGUN, command=campaign_command(at))


class RunList:
    """The list of one opened page, and what is at work.

    Args:
        place: Folder of the studio.
    """

    def __init__(self, place: Path) -> None:
        self._place = place
        self._others: list[StudioJob] | None = None
        self._waiting = ui.label("reading the folder …").classes("note")
        self._empty = ui.column().classes("w-full")
        with self._empty:
            say_empty(NO_RUNS, link=NEW, command="tdac synth")
        self._tables = RunTables()
        self._beside = ui.column().classes("w-full gap-3")
        self._empty.visible = False

    async def look(self) -> None:
        """Shows what has changed in the folder."""
        groups = await asyncio.to_thread(_groups_in, self._place)
        self._waiting.visible = False
        self._tables.show(groups)
        self._empty.visible = not any(group.rows for group in groups)
        at_work = [job for job in jobs(self._place) if job.running]
        if at_work != self._others:
            self._others = at_work
            self._beside.clear()
            with self._beside:
                _show_others(self._place, at_work)


def _groups_in(place: Path) -> list[RunGroup]:
    return grouped(rows_in(place), folders_with(place, CONFIG_FILE))


def rows_in(place: Path) -> list[dict[str, Any]]:
    """A row for each run and training, the newest first."""
    known = sorted(map(_row, folders_of(place)), key=lambda row: row.get("started", ""))
    for folder in [each for each in _known if not each.exists()]:
        del _known[folder]
    return [_cells(place, row) for row in reversed(known[-MOST_ROWS:])]


def _row(folder: Path) -> dict[str, Any]:
    """The row of a run; that of a finished one is read once."""
    stamp = tuple(
        (folder / name).stat().st_mtime_ns if (folder / name).exists() else 0
        for name in (RUN_FILE, JOURNAL)
    )
    before = _known.get(folder)
    if before is not None and before[0] == stamp and before[1]["status"] != "running":
        return before[1]
    row = row_of(folder)
    _known[folder] = stamp, row
    return row


def _cells(place: Path, row: dict[str, Any]) -> dict[str, Any]:
    run = str(Path(row["run"]).resolve().relative_to(place))
    iteration = f"iteration {row['k']}" if "k" in row else NONE
    if row["status"] not in DELIVERED and "k" in row:
        iteration += f" of {row['iterations']}"
    iteration += variations_text(row) if "k" in row else ""
    cost = row.get("cost", 0.0)
    return {
        "run": run,
        "address": address_of("/run", run) if "steps" not in row else "",
        "task": str(row.get("task", NONE)),
        "writer": row.get("learner", NONE),
        "status": row["status"],
        "progress": f"{row['steps']:,} steps" if "steps" in row else iteration,
        "cost": format_usd(cost) if cost else NONE,
        "usd": cost,
        "started": _when(row.get("started", "")),
    }


def _when(started: str) -> str:
    try:
        return f"{datetime.fromisoformat(started).astimezone():%Y-%m-%d %H:%M}"
    except (ValueError, OverflowError):
        return started[:16]


def _show_others(place: Path, at_work: list[StudioJob]) -> None:
    """Benches, and commands that still run."""
    show_benches(place, "Benches")
    if at_work:
        heading("Running now")
    for job in at_work:
        with ui.row().classes("items-center"):
            page = {"synth": "/run", "bench": "/bench"}.get(job.file.words[0])
            if page:
                ui.link(job.file.about, address_of(page, job.file.about))
            ui.label(job.command).classes("font-mono text-sm")
            ui.button("Stop", on_click=job.stop).props("flat dense")


def _show_upload(place: Path) -> None:
    async def uploaded(event: events.UploadEventArguments) -> None:
        data = await event.file.read()
        try:
            folder = unpack(data, Path(event.file.name).stem, place / "runs")
        except (OSError, ValueError) as error:
            ui.notify(f"{event.file.name}: {error}", type="negative")
            return
        ui.navigate.to(address_of("/run", str(folder.relative_to(place))))

    heading("A run from elsewhere")
    ui.label(
        "A run folder as a .zip file is shown as data: nothing in it runs unless you "
        "continue it and agree to what it asks for."
    ).classes("note")
    ui.upload(
        label="Drop a .zip here, or click", auto_upload=True,
        max_file_size=MOST_UPLOAD, on_upload=uploaded,
    ).props("flat accept=.zip")  # fmt: skip


def unpack(data: bytes, name: str, parent: Path) -> Path:
    """Unpacks a run folder; returns where it is.

    Args:
        data: Content of a `.zip` file.
        name: Name for the folder.
        parent: Folder in which to put it.

    Raises:
        ValueError: It is no `.zip` file, has no run, leads out of its folder, or is too
            large.
    """
    parts = read_zip(data, MOST_UNPACKED)
    roots = [entry for entry in parts if Path(entry).name == RUN_FILE]
    if not roots:
        raise ValueError(f"it has no {RUN_FILE}")
    root = min(roots, key=lambda entry: entry.count("/")).removesuffix(RUN_FILE)
    kept = {
        entry.removeprefix(root): content
        for entry, content in parts.items()
        if entry.startswith(root) and not entry.endswith("/")
    }
    for inner in kept:
        if Path(inner).is_absolute() or ".." in Path(inner).parts:
            raise ValueError(f"{inner} leads out of the folder")
    folder = _free(parent, name)
    for inner, content in kept.items():
        (folder / inner).parent.mkdir(parents=True, exist_ok=True)
        (folder / inner).write_bytes(content)
    return folder


def _free(parent: Path, name: str) -> Path:
    parent.mkdir(parents=True, exist_ok=True)
    kept = "".join(c if c.isalnum() or c in "-_" else "-" for c in name)[:80] or "run"
    number, folder = 1, parent / kept
    while folder.exists():
        number += 1
        folder = parent / f"{kept}-{number}"
    folder.mkdir()
    return folder
