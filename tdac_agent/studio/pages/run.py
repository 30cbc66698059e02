"""The page of a run: what it does now, what it found, and what can be done with it."""

from __future__ import annotations

import asyncio
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nicegui import ui

from tdac_agent.library.listing import row_of
from tdac_agent.runs.run_record import DELIVERED, RUN_FILE, Run, load_run
from tdac_agent.studio.folder import as_word, deployable, within
from tdac_agent.studio.jobs import StudioJob, job_of, start
from tdac_agent.studio.pages.layout import (
    JobPage,
    ShownCommand,
    framed,
    report_frame,
    say_missing,
    shown_first,
)
from tdac_agent.studio.pages.questions import Questions
from tdac_agent.studio.pages.robustness import Robustness
from tdac_agent.studio.pages.trail import above_run
from tdac_agent.studio.run_status import (
    SELECTED,
    asked_by,
    episodes_driven,
    from_elsewhere,
    initial_controller_text,
    last_step,
    progress_of,
    readable_run,
)
from tdac_agent.verification.confirmation import read_confirmation
from tdac_agent.verification.evidence import evidence_of, failed_last
from tdac_envs.core.errors import TdacError

ELSEWHERE = "{}: its verdict is only what its files claim."
NOTHING = "use this machine: its candidates run in the sandbox"
FIRST = "The first candidate appears here as soon as it has been tested."
NO_CANDIDATE = (
    "No candidate has been tested yet. Press Continue, or type the command above."
)
LETTERS = "k: iteration; j: number of the repair, 0 for the first version."
SECONDS = 1.0
"""Between two looks at the folder."""


def add(place: Path) -> None:
    """Adds the page."""

    @ui.page("/run")
    async def page(at: str = "") -> None:
        with framed(at or "Run", place, under=above_run(place, at), headed=False):
            folder = within(place, at)
            known = folder is not None and (folder.is_dir() or job_of(place, at))
            if folder is None or not at or not known:
                say_missing("run", at, "Runs")
                return
            await RunPage(place, at, folder).show()


class RunPage(JobPage):
    """The page of one run."""

    async def show(self) -> None:
        """Builds the page, and keeps it up to date."""
        self._seen: RunState | None = None
        self._reported = ""
        self._build_heading()
        self._command = ShownCommand()
        with ui.row().classes("gap-2 items-center"):
            self._build_buttons(self._go_on)
            self._download = ui.button("Download the controller", on_click=self._save)
            self._judge = ui.button("Verify on hidden worlds", on_click=self._hidden)
            self._follow = ui.switch("show each new candidate", value=True)
        with ui.element("pre").classes("output") as self._verdict:
            self._verdict_text = ui.label()
        self._remarks = ui.column().classes("w-full gap-1")
        self._questions = Questions(self._place / f"{self._at}-questions", self._folder)
        self._awaited = ui.label().classes("note text-sm whitespace-pre-line")
        self._report = ui.column().classes("w-full")
        self._robust = Robustness(self._place, self._at)
        self._printed = ui.expansion("What the command printed").classes("w-full")
        with self._printed:
            ui.label(LETTERS).classes("note text-sm")
            with ui.element("pre").classes("output"):
                self._output = ui.label()
        await shown_first()
        await self._look()
        ui.timer(SECONDS, self._look)

    async def _look(self) -> None:
        """Shows what has changed."""
        job = job_of(self._place, self._at)
        state = await asyncio.to_thread(state_of, self._folder, job)
        self._questions.look(running=state.running)
        self._robust.look(self._folder)
        self._show_clock(state, job)
        if state == self._seen:
            return
        self._seen = state
        self._show_row(state, job)
        self._output.text = state.output
        self._printed.visible = bool(state.output)
        new = state.version not in ("", self._reported)
        if new and (self._follow.value or not self._reported or not state.running):
            self._reported = state.version
            self._report.clear()
            with self._report:
                report_frame(self._at, state.version)

    def _show_row(self, state: RunState, job: StudioJob | None) -> None:
        go_on = state.row.get("go_on", "")
        report = shlex.join(["tdac", "report", as_word(self._at)])
        begun = job.command if job is not None and job.ours else ""
        self._command.show(begun or go_on or report)
        # An agent starts its server itself.
        own = bool(go_on) and not state.row.get("agent")
        continues = own and state.status != "running"
        self._show_status(state.status, running=state.running, continues=continues)
        self._follow.visible = state.running
        self._download.visible = state.status in DELIVERED
        self._judge.visible = state.status == "selected"
        self._remarks.clear()
        with self._remarks:
            for text, problem in _remarks(state, job):
                ui.label(text).classes("problem" if problem else "note text-sm")

    def _show_clock(self, state: RunState, job: StudioJob | None) -> None:
        """Shows how far the run is, and for how long its command has run."""
        text = progress_of(state.row, state.running)
        if state.running and job is not None:
            parts = filter(None, (text, state.driven))
            text = f"{'; '.join(parts)} ({job.seconds:.0f} s)"
        lines = last_step(state.output), "" if state.version else FIRST
        self._awaited.text = "\n".join(filter(None, lines))
        self._awaited.visible = state.running
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
        self._remarks.clear()

    def _ask(self, asked: list[str]) -> None:
        self._remarks.clear()
        with self._remarks, ui.card().classes("w-full"):
            ui.label("This run was not begun here. To continue, it asks to:")
            for what in asked or [NOTHING]:
                ui.label(f"• {what}").classes("problem")
            ui.button(
                "I trust it: continue", on_click=lambda: self._go_on(trusted=True)
            ).props("color=negative")


@dataclass(frozen=True, slots=True)
class RunState:
    """What the page shows of a run.

    Attributes:
        row: Its row of the list of runs; empty before it has a record.
        run: Its record, if it can be read.
        running: Whether its command runs.
        driven: How many episodes it has driven, if it runs on a task set.
        version: Tells its report from earlier ones; empty if there is none yet.
        output: The end of what its command printed.
    """

    row: dict[str, Any]
    run: Run | None
    running: bool
    driven: str
    version: str
    output: str

    @property
    def status(self) -> str:
        """Status of the run, also before it has a record."""
        unknown = "running" if self.running else "not begun"
        return str(self.row.get("status", unknown))


def state_of(folder: Path, job: StudioJob | None) -> RunState:
    """The state of a run.

    Args:
        folder: Its folder.
        job: The newest command that works on it, if the studio has started it.
    """
    running = job is not None and job.running
    output = job.output() if job is not None else ""
    if not (folder / RUN_FILE).is_file():
        return RunState({}, None, running, "", "", output)
    row, run = row_of(folder), readable_run(folder)
    running = running or row["status"] == "running"
    candidates = len(run.attempts) if run else 0
    version = f"{candidates}-{row['status']}" if candidates or not running else ""
    driven = episodes_driven(run) if run and running else ""
    return RunState(row, run, running, driven, version, output)


def _remarks(state: RunState, job: StudioJob | None) -> Iterator[tuple[str, bool]]:
    """Yields what is to be said about a run, and whether it is a problem."""
    failed = initial_controller_text(state.run) if state.run else ""
    if failed:
        yield failed, True
    if state.run and not state.run.attempts and not state.running:
        yield NO_CANDIDATE, False
    if state.status == "selected":
        yield SELECTED, False
    elif state.run and not state.run.on_set and not state.running:
        run = state.run
        confirmation = read_confirmation(run) if run.confirmations else None
        told = evidence_of(run, confirmation) if run.passed else failed_last(run)
        if told:
            yield f"{told[0].upper()}{told[1:]}", not run.passed
    if state.run and (remark := from_elsewhere(state.run)):
        yield ELSEWHERE.format(remark), False
    if not state.running and not state.row and job is not None:
        last = job.output().strip().splitlines()[-1:] or ["nothing was printed"]
        yield f"The run did not start: {last[0]}", True
