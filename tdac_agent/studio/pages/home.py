"""The first page: a map or world, start and goal by clicks, and who writes."""

from __future__ import annotations

import asyncio
import math
import shlex
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar
from urllib.parse import quote

from nicegui import ui

from tdac_agent.studio.draft import (
    Checked,
    TaskDraft,
    check,
    fitting_radius,
    sentence_of,
    snapped,
)
from tdac_agent.studio.jobs import free_folder, start
from tdac_agent.studio.pages.clickable_map import ClickableMap, Mode
from tdac_agent.studio.pages.layout import (
    ShownCommand,
    address_of,
    framed,
    heading,
    shown_first,
)
from tdac_agent.studio.pages.overlay import overlay
from tdac_agent.studio.pages.source_choice import SourceChoice
from tdac_agent.studio.pages.task_form import TaskForm
from tdac_agent.studio.pages.writers import Writers
from tdac_agent.studio.source_view import (
    Kind,
    SourceView,
    as_it_is,
    names_of,
    view_of,
)
from tdac_envs.core.compiled import compiling
from tdac_envs.core.errors import PolarityError, TdacError

T = TypeVar("T")
FIRST = "map: maze"
EITHER = (
    "The obstacles of this map may be its dark or its light pixels: choose above which "
    "ones they are."
)
PATIENCE = 0.5
"""Seconds after which the page says what it waits for."""


def add(place: Path) -> None:
    """Adds the page."""

    @ui.page("/")
    async def page(
        source: str = FIRST, task: str = "", obstacles: str = "", robot: str = ""
    ) -> None:
        with framed("New controller", place):
            await StartPage(place).show(source, task, obstacles, robot)


class StartPage:
    """The state of one opened page.

    Args:
        place: Folder of the studio.
    """

    def __init__(self, place: Path) -> None:
        self._place = place
        self._view: SourceView | None = None
        self._draft: TaskDraft | None = None
        self._checked: Checked | None = None
        self._turn = 0  # number of the newest choice: the work on older ones is dropped

    async def show(self, source: str, task: str, obstacles: str, robot: str) -> None:
        """Builds the page, with what its address says."""
        with ui.element("div").classes("choosing"):
            with ui.column().classes("min-w-0 gap-3"):
                self._source = SourceChoice(self._place, source, obstacles, self._open)
                heading("2. Start and goal")
                self._form = TaskForm(
                    self._typed, self._resized, self._named, self._move, self._shrink
                )
                self._build_start()
            with ui.column().classes("beside min-w-0 gap-2"):
                self._map = ClickableMap(self._clicked, self._turned)
        await shown_first()
        if self._turn == 0:  # nobody was faster than the page
            await self._open(source)
            await self._take(task, robot)

    def _build_start(self) -> None:
        heading("3. Who writes")
        self._writers = Writers(self._place, self._refresh_command, on_task=True)
        self._go = ui.button("Write and verify a controller", on_click=self._begin)
        self._go.disable()
        ui.label("The same on the command line:").classes("note text-sm")
        self._command = ShownCommand()

    async def _open(self, source: str) -> None:
        """Reads another map or world."""
        self._turn += 1
        turn = self._turn
        kind, _, name = source.partition(": ")
        asked = self._source.polarity
        try:
            path = name if name in names_of(_kind(kind)) else str(self._place / name)
            read = partial(view_of, _kind(kind), path, asked)
            view = await self._waiting(f"Reading {name} …", read)
        except PolarityError:
            picture = await asyncio.to_thread(as_it_is, path)
            if turn == self._turn:
                self._refuse(EITHER, picture)
            return
        except (TdacError, OSError, ValueError) as error:
            if turn == self._turn:
                self._refuse(str(error))
            return
        if turn != self._turn:  # something else has been chosen meanwhile
            return
        kept = asked if kind == "map" else None
        self._view, self._draft = view, TaskDraft.of(view, name, kept)
        self._map.show(view.png)
        self._map.begin(f"{kind} {name}", view.reading, view.notes)
        self._map.take(view, self._draft.start)
        self._source.show_polarity(view.kind == "map")
        self._form.show(self._draft, view)
        await self._check()

    async def _waiting(self, text: str, work: Callable[[], T]) -> T:
        """What slow work gives; the page says what it waits for."""
        turn = self._turn
        task = asyncio.create_task(asyncio.to_thread(work))
        self._go.disable()
        while not (await asyncio.wait({task}, timeout=PATIENCE))[0]:
            if turn == self._turn:
                now = compiling()
                self._form.tell(f"{text} ({now})" if now else text, good=True)
        return task.result()

    def _refuse(self, text: str, picture: bytes = b"") -> None:
        """Says why there is no draft; with a picture, how to read it must be chosen."""
        self._checked, self._draft = None, None
        self._form.clear()
        self._map.show(picture)
        if picture:
            self._source.show_polarity(True)
        self._map.mark("")
        self._map.begin("", "", ())
        self._map.take(None)
        self._form.tell(text, good=False)
        self._refresh_command()

    async def _clicked(self, mode: Mode, x: float, y: float) -> None:
        """Takes a click on the picture."""
        if self._view is None or self._draft is None:
            return
        unit = self._view.unit
        place = self._view.place(x, y)
        # On a map, the middle of a pixel.
        nearest = (round(place[0]), round(place[1])) if unit == "px" else place
        if mode == "start":
            await self._change(self._draft.with_start(nearest, unit))
        elif mode == "heading":
            await self._change(self._draft.facing(place))
        else:
            await self._change(self._draft.with_goal(nearest, unit))

    async def _turned(self, angle: float) -> str:
        """Turns the start heading, clockwise on the picture, rad."""
        draft, view = self._draft, self._view
        if draft is None or view is None or draft.start is None:
            return "Place the start first."
        turned = draft.turned(math.copysign(1.0, view.scale[1]) * angle)
        await self._change(turned)
        return f"The heading is {math.degrees(turned.heading or 0.0):.0f}°."

    async def _change(self, draft: TaskDraft) -> None:
        """Shows another draft, and checks it."""
        assert self._view is not None
        self._draft = draft
        self._form.show(draft, self._view)
        await self._check()

    async def _typed(self) -> None:
        if self._draft is not None:
            # Not shown: half of a place may have been typed.
            self._draft = self._form.written(self._draft)
            await self._check()

    async def _take(self, task: str, robot: str) -> None:
        """Takes places, radius and robot from the address of the page."""
        draft, view, values = self._draft, self._view, numbers_in(task)
        if draft is None or view is None:
            return
        if robot in (each.name for each in view.robots):
            draft = replace(draft, robot=robot)
        if len(values) == 6:
            x, y, heading, goal_x, goal_y, radius = values
            start, goal = (x, y), (goal_x, goal_y)
            draft = replace(draft, start=start, goal=goal, heading=heading)
            draft = replace(draft, radius=radius)
        if draft != self._draft:
            await self._change(draft)

    async def _move(self) -> None:
        """Moves start and goal to the nearest free places."""
        draft, view = self._draft, self._view
        if draft is None or view is None:
            return
        try:
            moved = await asyncio.to_thread(snapped, draft, self._place)
        except (TdacError, ValueError) as error:
            self._form.tell(str(error), good=False)
            return
        await self._change(moved)

    async def _shrink(self) -> None:
        """Takes the largest radius of the slider that gets through."""
        draft = self._draft
        fitting = None if draft is None else fitting_radius(draft, self._checked)
        if draft is not None and fitting is not None:
            await self._change(replace(draft, radius=fitting))

    async def _resized(self) -> None:
        if self._draft is not None:
            self._draft = replace(self._draft, radius=self._form.radius)
            await self._check()

    async def _named(self) -> None:
        draft, robot = self._draft, self._form.robot
        if draft is not None and draft.robot != robot:
            await self._change(replace(draft, robot=robot))

    async def _check(self) -> None:
        """Finds the path of the draft, or why there is none."""
        draft, view = self._draft, self._view
        assert draft is not None
        assert view is not None
        self._turn += 1
        turn, self._checked = self._turn, None
        if draft.goal is None or (draft.start is None and view.start is None):
            text = "Click the start, a point ahead of it, and the goal."
            self._form.tell(text, good=True)
        else:
            work = partial(check, draft, view, self._place)
            checked = await self._waiting("Looking for the shortest path …", work)
            if turn != self._turn:
                return
            self._checked = checked
            self._form.tell(*sentence_of(checked, view))
            self._map.show(checked.picture or view.png)
        self._map.mark(overlay(view, draft, self._checked))
        self._form.show_checked(draft, self._checked, view)
        ui.navigate.history.replace(address_with(draft))
        self._refresh_command()

    def _refresh_command(self) -> None:
        words = self._words()
        self._command.show("tdac " + shlex.join(words) if words else "")
        ready = self._checked is not None and self._checked.task is not None
        self._go.set_enabled(ready and self._writers.problem() is None)

    def _words(self) -> list[str]:
        if self._draft is None:
            return []
        return ["synth", *self._draft.words(), *self._writers.words()]

    async def _begin(self) -> None:
        """Starts the run, and opens its page."""
        if self._checked is None or self._checked.task is None or not self._go.enabled:
            return
        self._go.disable()  # for the second click of a double click
        folder = free_folder(self._checked.task.name, self._place)
        words = [*self._words(), "--out", folder]
        words = self._writers.with_folder(words, folder)
        try:
            start(self._place, words, folder)
        except OSError as error:
            ui.notify(f"cannot start: {error.strerror}", type="negative")
            self._go.enable()
            return
        ui.navigate.to(address_of("/run", folder))


def address_with(draft: TaskDraft) -> str:
    """Address of the page with a draft, which loads the page with it again."""
    address = f"/?source={quote(f'{draft.kind}: {draft.source}')}"
    if draft.polarity is not None:
        address += f"&obstacles={draft.polarity}"
    if draft.robot is not None:
        address += f"&robot={quote(draft.robot)}"
    values = *(draft.start or ()), draft.heading, *(draft.goal or ()), draft.radius
    if len(values) < 6 or None in values:
        return address
    return f"{address}&task={','.join(f'{value:.6g}' for value in values)}"


def numbers_in(task: str) -> list[float]:
    """The numbers in the address of a draft; none if it is no such address."""
    try:
        values = [float(part) for part in task.split(",")]
    except ValueError:
        return []
    return values if all(map(math.isfinite, values)) else []


def _kind(kind: str) -> Kind:
    return "world" if kind == "world" else "map"
