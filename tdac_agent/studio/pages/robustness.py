"""Robustness of a verified controller, on request, with the worst episodes to watch."""

from __future__ import annotations

import shlex
from functools import partial
from pathlib import Path

from nicegui import ui

from tdac_agent.studio.folder import STATE, as_word, made_within
from tdac_agent.studio.jobs import job_of, start, stop_job
from tdac_agent.studio.pages.films import show_film
from tdac_agent.studio.pages.layout import heading, say_empty
from tdac_agent.studio.run_status import readable_run
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_envs.core.intake import RECORD_BYTES, read_file

EPISODES = 200
SHOWN = 6
NONE_MEASURED = (
    "Nothing has been measured yet. Press Measure to drive it with other starts, range "
    "noise, slip and delay, or type:"
)
NO_FAILURE = "No episode failed. To find the smallest deviation with which one does:"


class Robustness:
    """A part of the page of a run.

    Args:
        place: Folder of the studio.
        at: The run, relative to it.
    """

    def __init__(self, place: Path, at: str) -> None:
        self._place, self._at, self._seen = place, at, ""
        self._out = f"{STATE}/robust/{at.replace('/', '-')}"
        with ui.card().classes("w-full") as self._card:
            heading("Robustness")
            with ui.row().classes("items-center"):
                self._count = ui.number("disturbed episodes", value=EPISODES, min=1)
                self._go = ui.button("Measure", on_click=self._begin)
                self._stop = ui.button(
                    "Stop", on_click=partial(stop_job, place, self._out)
                ).props("flat")
                self._now = ui.label().classes("note")
            with ui.column().classes("w-full") as self._none:
                say_empty(NONE_MEASURED, command=shlex.join(["tdac", *self._words()]))
            self._found = ui.column().classes("w-full gap-1")
            self._film = ui.column().classes("w-full")
        self._card.visible = False

    def look(self, folder: Path) -> None:
        """Shows what has been measured, and which video is finished."""
        if not self._card.visible:
            run = readable_run(folder)
            if run is None or not run.passed or run.on_set:
                return
            self._card.visible = True
        job = job_of(self._place, self._out)
        running = job is not None and job.running
        self._go.set_enabled(not running)
        self._stop.visible = running
        self._now.text = f"measuring … {job.seconds:.0f} s" if job and running else ""
        path = self._place / self._out / "episodes.json"
        try:
            text = read_file(path, RECORD_BYTES).decode()
            report = EpisodeReport.model_validate_json(text)
        except (OSError, ValueError):
            return
        self._none.visible = False
        if text != self._seen:
            self._seen = text
            self._show(report)

    def _show(self, report: EpisodeReport) -> None:
        self._found.clear()
        with self._found:
            text = f"{report.successes} of {report.count} episodes reached the goal"
            if report.interval is not None:
                low, high = report.interval.low, report.interval.high
                text += f" (95 % interval {low:.3f} to {high:.3f})"
            ui.label(f"{text}.")
            units, first = report.provenance.units, report.provenance.first
            name = f"episode {(report.closest or first) - first + 1}"
            for line in report.gap_lines(units, name):
                ui.label(f"{line}.")
            if report.successes == report.count:
                search = ["tdac", "falsify", as_word(self._at)]
                say_empty(NO_FAILURE, command=shlex.join(search))
            with ui.row().classes("items-center gap-2"):
                ui.label("Failures first, then the slowest; click one to watch it:")
                for episode in report.worst[:SHOWN]:
                    name = f"episode {episode.number - report.provenance.first + 1}"
                    ui.button(
                        f"{name}: {episode.outcome}, {episode.steps} steps",
                        on_click=partial(self._watch, episode.number, name),
                    ).props("outline no-caps dense")

    def _begin(self) -> None:
        made_within(self._place, self._out)
        start(self._place, [*self._words(), "--out", self._out], self._out)

    def _words(self) -> list[str]:
        """The words of the command line, without the folder of the results."""
        count = str(int(self._count.value or EPISODES))
        return ["verify", as_word(self._at), "--robust", count]

    def _watch(self, seed: int, name: str) -> None:
        """Draws a video of an episode, and shows it."""
        film = f"{self._out}/seed-{seed}.mp4"
        if not (self._place / film).is_file():
            made_within(self._place, self._out)
            words = ["play", as_word(self._at), "--seed", str(seed), "--video", film]
            start(self._place, words, film)
        self._film.clear()
        with self._film:
            show_film(self._place, film, name)
