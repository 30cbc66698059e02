"""Worlds of task sets: look at them, drive one, watch two policies on the same one."""

from __future__ import annotations

import asyncio
import io
import shlex
from pathlib import Path

import cv2
import numpy as np
from nicegui import ui

from tdac_agent.evaluation.replay import SHOWN
from tdac_agent.html_report.scene import data_address
from tdac_agent.planners.names import planner_names
from tdac_agent.studio.driving import KeyboardDrive
from tdac_agent.studio.folder import FILES, STATE, as_word, keep, made_within
from tdac_agent.studio.jobs import free_folder, start
from tdac_agent.studio.pages.films import show_film
from tdac_agent.studio.pages.layout import (
    ShownCommand,
    address_of,
    framed,
    heading,
    say_empty,
    shown_first,
)
from tdac_agent.studio.pages.trail import NEW
from tdac_agent.studio.pages.writers import Writers
from tdac_agent.synthesis.options import RACE, USUAL
from tdac_agent.synthesis.workload import MOST_EPISODES
from tdac_envs.core.errors import TdacError
from tdac_envs.drawing.canvas import Image
from tdac_envs.ladder.picture import draw_world
from tdac_envs.ladder.set_file import set_names
from tdac_envs.ladder.task_sets import TaskSet, load_set
from tdac_envs.ladder.worlds import LadderWorld

EPISODES = USUAL[RACE]["episodes"]
LEAST = 2
"""Episodes of a run on a set: one for a test, one for the selection."""
SECONDS = 0.05
"""Between two frames of a drive, at least."""
NO_POLICIES = (
    "No controller of your own is in this folder yet, so the list has ours alone."
)
KEYS = "Drive with the arrow keys or W A S D; R begins again."


def add(place: Path) -> None:
    """Adds the page."""

    @ui.page("/worlds")
    async def page(level: str = "unknown") -> None:
        with framed("Worlds", place):
            await WorldsPage(place).show(level)


class WorldsPage:
    """The state of one opened page.

    Args:
        place: Folder of the studio.
    """

    def __init__(self, place: Path) -> None:
        self._place = place
        self._tasks: TaskSet | None = None
        self._drive: KeyboardDrive | None = None
        self._chosen: tuple[str, str, int] | None = None

    async def show(self, level: str) -> None:
        """Builds the page."""
        names = list(set_names())
        with ui.row().classes("w-full items-end gap-3"):
            self._name = ui.select(
                names, value=level if level in names else names[0], label="task set",
                on_change=self._open,
            ).classes("w-40")  # fmt: skip
            self._split = ui.select(
                list(SHOWN), value="dev", label="split", on_change=self._open
            ).classes("w-28")
            self._index = ui.number(
                "world", value=0, min=0, precision=0, on_change=self._open
            ).classes("w-28")
            ui.button("Next", on_click=self._next).props("outline")
        self._about = ui.label().classes("note text-sm")
        with ui.row().classes("w-full gap-6 items-start"):
            self._image = ui.interactive_image().classes("board world")
            self._image.props('alt="The world with its shortest path"')
            with ui.column().classes("gap-3 w-80"):
                self._facts = ui.column().classes("gap-0")
                self._build_driving()
                self._build_use()
        self._build_watching()
        ui.keyboard(on_key=self._key)
        self._timer = ui.timer(SECONDS, self._step, active=False)
        await shown_first()
        await self._open()

    def _build_driving(self) -> None:
        heading("Drive it yourself")
        self._keys = ui.label(KEYS).classes("note text-sm")
        ui.button("Drive", on_click=self._begin_drive).props("outline")
        self._status = ui.label().props("role=status")

    def _build_use(self) -> None:
        heading("Use it")
        self._one_map = ui.button(on_click=self._as_map).props("outline no-caps")
        self._one_map.bind_enabled_from(
            self._name, "value", lambda name: name != "epuck"
        )
        whole = "Write a controller for the whole set …"
        ui.button(whole, on_click=self._ask_writer).props("outline no-caps")

    def _build_watching(self) -> None:
        heading("Watch two policies on this world")
        own = policies_in(self._place)
        if not own:
            say_empty(NO_POLICIES, link=NEW)
        options = ["builtin", *planner_names(), *own]
        with ui.row().classes("items-end gap-3"):
            self._one = ui.select(options, value="builtin", label="left").classes(
                "w-64"
            )
            self._other = ui.select(
                options, value="follow-the-gap", label="right"
            ).classes("w-64")
            ui.button("Watch", on_click=self._watch)
        self._command = ShownCommand()
        self._films = ui.element("div").classes(
            "w-full grid grid-cols-1 sm:grid-cols-2 gap-3"
        )

    @property
    def _world(self) -> tuple[str, str, int]:
        """Set, split and number of the chosen world."""
        return self._name.value, self._split.value, int(self._index.value or 0)

    async def _open(self) -> None:
        """Shows the chosen world, unless it is shown already."""
        chosen = self._world
        if chosen == self._chosen:
            return
        self._chosen = chosen
        self._timer.deactivate()
        self._drive = None
        self._about.text = f"Drawing world {chosen[2]} of {chosen[0]} …"
        self._facts.clear()
        try:
            tasks, picture, facts = await asyncio.to_thread(look_at, *chosen)
        except TdacError as error:
            self._about.text = ""
            ui.notify(str(error), type="warning")
            return
        if chosen != self._chosen:  # another one has been chosen meanwhile
            return
        self._tasks = tasks
        self._about.text = tasks.file.description
        without = " (without movers)" if tasks.file.movers else ""
        self._one_map.text = f"Write a controller for this map{without}"
        self._image.set_source(as_address(picture))
        self._facts.clear()
        with self._facts:
            for key, value in facts.items():
                ui.label(f"{key}: {value}").classes("text-sm")
        self._status.text = ""

    def _next(self) -> None:
        self._index.value = int(self._index.value or 0) + 1

    async def _begin_drive(self) -> None:
        """Puts the robot at the start, and listens to the keys."""
        self._drive = await asyncio.to_thread(KeyboardDrive.of, *self._world)
        self._timer.interval = max(SECONDS, self._drive.dt)
        self._timer.activate()
        self._status.text = "Go."

    def _key(self, event: object) -> None:
        drive = self._drive
        if drive is None:
            return
        name, down = str(event.key.name), bool(event.action.keydown)  # type: ignore[attr-defined]
        if name.lower() == "r" and down:
            drive.begin()
            self._timer.activate()
        drive.press(name, down)

    async def _step(self) -> None:
        drive = self._drive
        if drive is None:
            return
        picture = await asyncio.to_thread(drive.step)
        self._image.set_source(as_address(picture))
        self._status.text = drive.status
        if drive.over:
            self._status.text += " – press R to begin again"
            self._timer.deactivate()

    def _as_map(self) -> None:
        """Keeps the world's map as a file, and opens it on the first page."""
        assert self._tasks is not None
        _, split, index = self._world
        world = self._tasks.world(split, index)
        if not isinstance(world, LadderWorld):
            ui.notify("this world is not a map; choose another set", type="info")
            return
        at = f"{FILES}/{self._tasks.name}-{split}-{index}.npy"
        packed = io.BytesIO()
        np.save(packed, world.cells)
        keep(self._place, at, packed.getvalue())
        pose, goal = world.start, world.goal
        places = (*pose, *goal, self._tasks.file.robot.radius)
        values = ",".join(f"{float(value):.4g}" for value in places)
        ui.navigate.to(f"/?source=map: {at}&task={values}")

    def _ask_writer(self) -> None:
        """Asks who writes, and starts a run on the set."""
        name = self._name.value
        folder = free_folder(name, self._place)
        self._timer.deactivate()  # no robot drives behind the question
        with ui.dialog(value=True) as dialog, ui.card().classes("w-[40rem] max-w-full"):
            heading(f"A controller for all worlds of {name}")
            ui.label(
                "Candidates drive on worlds of the split dev: half of the episodes are "
                "for tests, half for the selection. 128 episodes take minutes."
            ).classes("note")

            def words() -> list[str]:
                most = ["--episodes", f"{episodes.value or 0:.0f}"]
                return ["synth", "--set", name, *most, *writers.words()]

            def changed() -> None:
                ready = writers.problem() is None and (episodes.value or 0) >= LEAST
                go.set_enabled(ready)
                command.show(shlex.join(["tdac", *words()]) if ready else "")

            writers = Writers(self._place, changed)
            episodes = ui.number(
                "episodes at most", value=EPISODES, min=LEAST, max=MOST_EPISODES,
                precision=0, on_change=changed,
            ).classes("w-40")  # fmt: skip
            command = ShownCommand()

            def begin() -> None:
                all_words = writers.with_folder([*words(), "--out", folder], folder)
                start(self._place, all_words, folder)
                dialog.close()
                ui.navigate.to(address_of("/run", folder))

            with ui.row():
                go = ui.button("Write it", on_click=begin)
                ui.button("Cancel", on_click=dialog.close).props("flat")
            changed()

    def _watch(self) -> None:
        """Lets two policies drive this world, and shows their videos."""
        name, split, index = self._world
        self._films.clear()
        for who in (self._one.value, self._other.value):
            kept = "".join(c if c.isalnum() else "-" for c in who)
            film = f"{STATE}/films/{name}-{split}-{index}-{kept}.mp4"
            made_within(self._place, f"{STATE}/films")
            world = ["--set", name, "--split", split, "--index", str(index)]
            words = ["play", who, *world, "--video", film]
            job = start(self._place, words, film)
            self._command.show(job.command)
            with self._films, ui.column().classes("min-w-0 gap-1"):
                show_film(self._place, film, who)


def look_at(name: str, split: str, index: int) -> tuple[TaskSet, Image, dict[str, str]]:
    """A world of a set: the set, a picture, and how hard it is."""
    tasks = load_set(name)
    world, task = tasks.world_and_task(split, index)
    hard, file = world.difficulty, tasks.file
    facts = {
        "generator": tasks.kind(split, index),
        "shortest path": f"{hard.length * file.per_unit:.4g} {file.shown_unit}",
        "at full speed": f"{hard.steps:.0f} steps",
        "narrowest passage": f"{hard.gap:.2f} body diameters",
        "detour": f"{hard.detour:.2f} times the straight line",
    }
    return tasks, draw_world(tasks, world, task), facts


def policies_in(place: Path) -> list[str]:
    """Controllers and learned policies of the folder."""
    paths = [*place.glob("*.py"), *place.glob("*/*.zip"), *place.glob("*.zip")]
    paths += [file.with_name("controller.py") for file in place.glob("runs/*/set.yaml")]
    paths += place.glob("runs/*/policy.zip")
    paths += [*place.glob(f"{FILES}/*.py")]
    names = (str(path.relative_to(place)) for path in paths if path.exists())
    return sorted(map(as_word, names))[:300]


def as_address(picture: Image) -> str:
    """A picture as a data URL."""
    _, data = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])
    return data_address(data.tobytes(), "image/jpeg")
