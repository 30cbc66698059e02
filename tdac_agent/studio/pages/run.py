"""The page of a run: what it does now, what it found, and what can be done with it."""

from __future__ import annotations

import asyncio
import shlex
from pathlib import Path
from typing import Any

from nicegui import ui

from tdac_agent.library.listing import row_of
from tdac_agent.runs.run_record import RUN_FILE, load_run
from tdac_agent.studio.deployable import deployable
from tdac_agent.studio.folder import as_word, within
from tdac_agent.studio.jobs import StudioJob, job_of, start
from tdac_agent.studio.pages.layout import (
    JobButtons,
    ShownCommand,
    framed,
    job_heading,
    report_frame,
    shown_first,
    status_badge,
)
from tdac_agent.studio.pages.questions import Questions
from tdac_agent.studio.pages.robustness import Robustness
from tdac_agent.studio.run_status import (
    SELECTED,
    about_given,
    asked_by,
    candidates_of,
    episodes_driven,
    is_from_elsewhere,
    last_step,
    progress_of,
)
from tdac_envs.core.errors import TdacError

ELSEWHERE = "This run was not begun here: its verdict is only what its files claim."
NOTHING = "use this machine: its candidates run in the sandbox"
FIRST = "The first candidate appears here as soon as it has been tested."
LETTERS = "k: iteration; j: number of the repair, 0 for the first version."
SECONDS = 1.0
"""Between two looks at the folder."""


def add(place: Path) -> None:
    """Adds the page."""

    @ui.page("/run")
    async def page(at: str = "") -> None:
        with framed(at):
            folder = within(place, at)
            known = folder is not None and (folder.is_dir() or job_of(place, at))
            if folder is None or not at or not known:
                ui.label(f"There is no run {at!r} in this folder.").classes("problem")
                return
            await RunPage(place, at, folder).show()


class RunPage:
    """The state of one opened page.

    Args:
        place: Folder of the studio.
        at: The run, relative to it.
        folder: Its folder.
    """

    def __init__(self, place: Path, at: str, folder: Path) -> None:
        self._place, self._at, self._folder = place, at, folder
        self._seen: Any = None
        self._reported = ""

    async def show(self) -> None:
        """Builds the page, and keeps it up to date."""
        self._badge, self._now = job_heading(self._at)
        self._command = ShownCommand()
        with ui.row().classes("gap-2 items-center"):
            self._buttons = JobButtons(self._interrupt, self._go_on)
            self._download = ui.button("Download the controller", on_click=self._save)
            self._judge = ui.button("Verify on hidden worlds", on_click=self._hidden)
            self._follow = ui.switch("show each new candidate", value=True)
        self._verdict = ui.element("pre").classes("output")
        with self._verdict:
            self._verdict_text = ui.label()
        self._wishes = ui.column().classes("w-full gap-1")
        self._questions = Questions(self._place / f"{self._at}-questions", self._folder)
        self._awaited = ui.label().classes("note text-sm whitespace-pre-line")
        self._report = ui.column().classes("w-full")
        self._robust = Robustness(self._place, self._at)
        printed = ui.expansion("What the command printed").classes("w-full")
        with printed:
            ui.label(LETTERS).classes("note text-sm")
            with ui.element("pre").classes("output"):
                self._output = ui.label()
        await shown_first()
        await self._look()
        ui.timer(SECONDS, self._look)

    async def _look(self) -> None:
        """Shows what has changed."""
        job = job_of(self._place, self._at)
        state = await asyncio.to_thread(_state, self._folder, job)
        self._questions.look(running=state[1])
        self._robust.look(self._folder)
        self._show_clock(state, job)
        if state == self._seen:
            return
        self._seen = state
        row, running, _, version, output = state
        self._show_row(row, running, job)
        self._output.text = output
        if (
            version
            and version != self._reported
            and (self._follow.value or not self._reported or not running)
        ):
            self._reported = version
            self._report.clear()
            with self._report:
                report_frame(self._at, version)

    def _show_row(
        self, row: dict[str, Any], running: bool, job: StudioJob | None
    ) -> None:
        status = row["status"] if row else "running" if running else "not begun"
        self._badge.clear()
        with self._badge:
            status_badge(status)
        go_on = row.get("go_on", "") if row else ""
        report = shlex.join(["tdac", "report", as_word(self._at)])
        begun = job.command if job is not None and job.ours else ""
        self._command.show(begun or go_on or report)
        # An agent starts its server itself.
        continues = bool(go_on) and not row.get("agent") and status != "running"
        self._buttons.show(running=running, continues=continues)
        self._follow.visible = running
        done = bool(row) and status in ("verified", "selected")
        self._download.visible = done
        self._judge.visible = done and status == "selected"
        self._wishes.clear()
        given = about_given(self._folder) if row else ""
        if given:
            with self._wishes:
                ui.label(given).classes("problem")
        if status == "selected":
            with self._wishes:
                ui.label(SELECTED).classes("note text-sm")
        if row and is_from_elsewhere(self._folder):
            with self._wishes:
                ui.label(ELSEWHERE).classes("note text-sm")
        if not running and not row and job is not None:
            with self._wishes:
                last = job.output().strip().splitlines()[-1:] or ["nothing was printed"]
                ui.label(f"The run did not start: {last[0]}").classes("problem")

    def _show_clock(self, state: _State, job: StudioJob | None) -> None:
        """Where the run stands, and for how long its command has run."""
        row, running, driven, version, output = state
        text = progress_of(row, running)
        if running and job is not None:
            text = "; ".join(filter(None, (text, driven))) + f" ({job.seconds:.0f} s)"
            said = last_step(output), "" if version else FIRST
            self._awaited.text = "\n".join(filter(None, said))
        self._awaited.visible = running
        self._now.text = text
        judged = job_of(self._place, self._verdict_about)
        self._verdict.visible = judged is not None
        if judged is not None:
            self._verdict_text.text = f"$ {judged.command}\n{judged.output()}"
            self._judge.set_enabled(not judged.running)

    @property
    def _verdict_about(self) -> str:
        return f"{self._at}: hidden"

    def _hidden(self) -> None:
        at = as_word(self._at)
        words = ["verify", f"{at}/controller.py", "--set", f"{at}/set.yaml"]
        start(self._place, words, self._verdict_about)

    def _save(self) -> None:
        ui.download.content(
            deployable(self._folder), f"{self._folder.name}.zip", "application/zip"
        )

    def _interrupt(self) -> None:
        job = job_of(self._place, self._at)
        if job is not None:
            job.stop()

    def _go_on(self, *, trusted: bool = False) -> None:
        """Continues the run; one from elsewhere first lists what it asks for."""
        try:
            run = load_run(self._folder)
            asked = asked_by(run)
        except (TdacError, OSError) as error:
            ui.notify(str(error), type="negative")
            return
        if asked is not None and not trusted:
            self._ask(asked)
            return
        more = () if run.enough is None else run.enough.words
        words = ["synth", "--resume", self._at, *more]
        start(self._place, [*words, *(["--trust"] if asked else [])], self._at)
        self._wishes.clear()

    def _ask(self, asked: list[str]) -> None:
        self._wishes.clear()
        with self._wishes, ui.card().classes("w-full"):
            ui.label("This run was not begun here. To continue, it asks to:")
            for what in asked or [NOTHING]:
                ui.label(f"• {what}").classes("problem")
            ui.button(
                "I trust it: continue", on_click=lambda: self._go_on(trusted=True)
            ).props("color=negative")


_State = tuple[dict[str, Any], bool, str, str, str]


def _state(folder: Path, job: StudioJob | None) -> _State:
    """Row of the list, whether it runs, how far, version of its report, and output."""
    running = job is not None and job.running
    output = job.output() if job is not None else ""
    if not (folder / RUN_FILE).is_file():
        return {}, running, "", "", output
    row = row_of(folder)
    running = running or row["status"] == "running"
    judged = candidates_of(folder)
    version = f"{judged}-{row['status']}" if judged or not running else ""
    driven = episodes_driven(folder) if running else ""
    return row, running, driven, version, output
