"""Benches: start one, see how far it is, and look at its results."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

from nicegui import ui

from tdac_agent.bench.arena import DRIVEN
from tdac_agent.bench.bench import RESULTS, SPLITS
from tdac_agent.bench.page import PAGE
from tdac_agent.evaluation.policies import BUILTIN, PRIVILEGED
from tdac_agent.planners.names import planner_names
from tdac_agent.studio.folder import as_word, folders_with, lines_in, within
from tdac_agent.studio.jobs import StudioJob, free_folder, job_of, jobs, start
from tdac_agent.studio.pages.layout import (
    JobPage,
    ShownCommand,
    address_of,
    file_frame,
    framed,
    heading,
    say_empty,
    say_missing,
    shown_first,
    status_badge,
)
from tdac_agent.studio.pages.trail import BENCHES, NEW
from tdac_agent.studio.pages.worlds import NO_POLICIES, policies_in
from tdac_agent.verification.judge.sequential import MOST_EPISODES
from tdac_agent.verification.salt import SEALED
from tdac_agent.verification.store import REPORT_FILE, ROWS_FILE, UNFINISHED
from tdac_envs.ladder.set_file import shipped_names

FOREIGN = (
    "This bench was not started here: the command above is only what its file says, "
    "and cannot be continued from this page."
)
WORLDS = 20
SECONDS = 1.0
"""Between two looks at the folder."""
FIRST = " ({:.0f} s): making the worlds, driving the first episodes"
ABOUT = {
    "dev": "Worlds of dev are for feedback and selection: those who were tuned on them "
    "have an advantage.",
    "test": "Worlds of test are public, and for comparisons.",
    "hidden": "Hidden worlds are drawn now and revealed at the end. Your ledger of "
    "hidden evaluations counts this one for each file.",
}


def add(place: Path) -> None:
    """Adds the pages."""

    @ui.page("/benches")
    async def benches() -> None:
        with framed("Benches", place):
            BenchForm(place).show()
            if not show_benches(place, "Benches of this folder"):
                say_empty("No bench in this folder yet. Start the one above.")

    @ui.page("/bench")
    async def bench(at: str = "") -> None:
        with framed(at or "Bench", place, under=[BENCHES], headed=False):
            folder = within(place, at)
            made = folder is not None and (folder / PAGE).is_file()
            if folder is None or not at or not (made or bench_job(place, at)):
                say_missing("bench", at, "Benches")
                return
            await BenchPage(place, at, folder).show()


class BenchForm:
    """The form that starts a bench.

    Args:
        place: Folder of the studio.
    """

    def __init__(self, place: Path) -> None:
        self._place = place

    def show(self) -> None:
        """Builds the form."""
        heading("New bench")
        ui.label(
            "Controllers, classical planners and learned policies drive on the same "
            "worlds, and are compared."
        ).classes("note")
        own = policies_in(self._place)
        if not own:
            say_empty(NO_POLICIES, link=NEW)
        options = [BUILTIN, *planner_names(), PRIVILEGED, *own]
        with ui.row().classes("w-full items-end gap-4"):
            self._entrants = _choice(options, [BUILTIN, "follow-the-gap"], "entrants")
            self._sets = _choice(list(shipped_names()), ["unknown"], "task sets")
            self._split = ui.select(list(SPLITS), value="test", label="split").classes(
                "w-28"
            )
            self._worlds = ui.number(
                "worlds of each set", value=WORLDS, min=1, max=MOST_EPISODES,
                precision=0,
            ).classes("w-36")  # fmt: skip
        self._note = ui.label().classes("text-sm note")
        self._command = ShownCommand()
        self._go = ui.button("Start the bench", on_click=self._begin)
        for each in (self._entrants, self._sets, self._split, self._worlds):
            each.on_value_change(self._refresh)
        self._refresh()

    def _words(self) -> list[str]:
        """The words of the command line, without the folder."""
        entrants = named_entrants(self._entrants.value)
        worlds = ["--split", self._split.value, "-n", f"{self._worlds.value or 0:.0f}"]
        return ["bench", *entrants, "--set", ",".join(self._sets.value), *worlds]

    def _refresh(self) -> None:
        ready = self._entrants.value and self._sets.value and self._worlds.value
        self._go.set_enabled(bool(ready))
        self._command.show(shlex.join(["tdac", *self._words()]) if ready else "")
        self._note.text = ABOUT[self._split.value]
        if not ready:
            self._note.text = "Choose entrants, task sets and the number of worlds."

    def _begin(self) -> None:
        """Starts the bench, and opens its page."""
        if not self._go.enabled:
            return
        self._go.disable()  # for the second click of a double click
        folder = free_folder("bench", self._place)
        start(self._place, [*self._words(), "--out", folder], folder)
        ui.navigate.to(address_of("/bench", folder))


class BenchPage(JobPage):
    """The page of one bench."""

    async def show(self) -> None:
        """Builds the page, and keeps it up to date."""
        self._shown = ""
        self._build_heading()
        self._bar = ui.linear_progress(0.0, show_value=False).props("rounded")
        self._command = ShownCommand()
        with ui.row().classes("gap-2"):
            self._build_buttons(self._go_on)
        self._foreign = ui.label(FOREIGN).classes("note text-sm")
        self._results = ui.column().classes("w-full")
        with ui.element("pre").classes("output") as self._printed:
            self._output = ui.label()
        await shown_first()
        self._look()
        ui.timer(SECONDS, self._look)

    def _look(self) -> None:
        """Shows what has changed."""
        job = bench_job(self._place, self._at)
        running = job is not None and job.running
        page = self._folder / PAGE
        done = page.is_file() and not running
        continues = job is not None and job.ours and not done
        status = status_of(self._folder, job)
        self._show_status(status, running=running, continues=continues)
        show = shlex.join(["tdac", "bench", "show", as_word(self._at)])
        self._command.show(show if job is None else job.command)
        self._foreign.visible = job is not None and not job.ours
        self._printed.visible = not done
        self._bar.visible = job is not None and not done
        self._output.text = job.output() if job is not None else ""
        self._now.text = ""
        if job is not None and not done:
            self._bar.value, self._now.text = progress_of(job, self._folder)
            if continues and not running:
                self._now.text += "; Continue resumes with the next episode"
        version = str(page.stat().st_mtime_ns) if done else ""
        if version != self._shown:
            self._shown = version
            self._results.clear()
            if done:
                with self._results:
                    file_frame(f"{self._at}/{PAGE}", version, f"Bench {self._at}")

    def _go_on(self) -> None:
        """Starts the same command again: it goes on with the next episode."""
        job = bench_job(self._place, self._at)
        if job is not None and job.ours:
            start(self._place, job.file.words, self._at)
            self._look()


def bench_job(place: Path, at: str) -> StudioJob | None:
    """The newest command of the form that works on a bench."""
    job = job_of(place, at)
    return job if job is not None and bench_words(job) else None


def named_entrants(chosen: Sequence[str]) -> list[str]:
    """Entrants as words of the command line: files of the same name get other names."""
    words, names = [], set[str]()
    for each in chosen:
        path = Path(each)
        own = path.parent.name if path.stem in ("controller", "policy") else path.name
        name, number = own, 1
        while name in names:
            number += 1
            name = f"{own}-{number}"
        names.add(name)
        words.append(each if name == path.name else f"{name}={each}")
    return words


def progress_of(job: StudioJob, folder: Path) -> tuple[float, str]:
    """The share of a bench that has been driven, from 0 to 1, and a line about it.

    Args:
        job: Its command.
        folder: Folder of the bench.
    """
    entrants, sets, worlds = _form_of(job)
    most = worlds * len(entrants) * len(sets)
    driven = 0
    for kept in (DRIVEN, SEALED):
        driven += worlds * len(list(folder.glob(f"{kept}/*/*/{REPORT_FILE}")))
        for rows in folder.glob(f"{kept}/*/*/{UNFINISHED}/{ROWS_FILE}"):
            driven += lines_in(rows)
    driven = min(driven, most)
    text = f"{driven} of {most} episodes driven"
    if job.running:
        text += f" ({job.seconds:.0f} s)" if driven else FIRST.format(job.seconds)
    return driven / most, text


def _choice(options: list[str], value: list[str], label: str) -> ui.select:
    chosen = ui.select(options, value=value, label=label, multiple=True)
    return chosen.props("use-chips").classes("w-full sm:w-80")


def show_benches(place: Path, title: str) -> bool:
    """Links to the benches of the folder; returns whether there are any."""
    begun = {job.file.about: job for job in reversed(jobs(place)) if bench_words(job)}
    names = {*folders_with(place, RESULTS), *begun}
    if names:
        heading(title)
    for name in sorted(names):
        job = begun.get(name)
        with ui.row().classes("items-center gap-3"):
            ui.link(name, address_of("/bench", name))
            status_badge(status_of(place / name, job))
            ui.label(bench_words(job) if job else "").classes("note text-sm")
    return bool(names)


def bench_words(job: StudioJob) -> str:
    """What drives where in a bench of the form; empty for another command."""
    entrants, sets, worlds = _form_of(job)
    return f"{', '.join(entrants)} on {','.join(sets)}" if worlds else ""


def _form_of(job: StudioJob) -> tuple[Sequence[str], Sequence[str], int]:
    """Entrants, task sets and worlds of each set; no worlds for another command."""
    words = job.file.words
    match words:
        case ["bench", *_] if {"--set", "-n"} <= {*words[:-1]}:
            at, worlds = words.index("--set"), words[words.index("-n") + 1]
            known = worlds.isascii() and worlds.isdecimal() and len(worlds) < 8
            entrants, sets = words[1:at], words[at + 1].split(",")
            return entrants, sets, int(worlds) if known and entrants else 0
    return (), (), 0


def status_of(folder: Path, job: StudioJob | None) -> str:
    """Status of a bench.

    Args:
        folder: Its folder.
        job: The newest command that works on it, if the studio has begun it.
    """
    if job is not None and job.running:
        return "running"
    return "finished" if (folder / PAGE).is_file() else "not finished"
