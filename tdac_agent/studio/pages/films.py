"""Videos of episodes, which jobs draw."""

from __future__ import annotations

from pathlib import Path

from nicegui import ui

from tdac_agent.studio.jobs import job_of
from tdac_agent.studio.pages.layout import address_of


def show_film(place: Path, film: str, title: str) -> None:
    """Shows a video as soon as the job that draws it has ended.

    Args:
        place: Folder of the studio.
        film: File of the video, relative to it.
        title: What is written above it.
    """
    label = ui.label(f"{title}: drawing …").classes("note")
    column = ui.column().classes("w-full")

    def look() -> None:
        job = job_of(place, film)
        if job is not None and job.running:
            return
        timer.deactivate()
        printed = job.output().strip() if job else ""
        if not (place / film).is_file():
            label.text = f"{title}: {printed[-300:] or 'no video'}"
            return
        last = printed.splitlines()[-1:]
        label.text = f"{title}: {last[0]}" if last else title
        stamp = (place / film).stat().st_mtime_ns
        with column:
            address = f"{address_of('/file', film)}&v={stamp}"
            ui.video(address, autoplay=True).classes("w-full max-w-3xl")

    timer = ui.timer(0.5, look)
