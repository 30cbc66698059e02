"""The first page: a map or world, start and goal by clicks, and who writes."""

from __future__ import annotations

import asyncio
import math
import shlex
from dataclasses import replace
from pathlib import Path
from urllib.parse import quote

from nicegui import events, ui

from tdac_agent.html_report.scene import data_address
from tdac_agent.library.listing import next_folder
from tdac_agent.studio.board import Board, Kind, Place, board_of, names_of
from tdac_agent.studio.draft import Checked, Draft, check, snapped
from tdac_agent.studio.jobs import start
from tdac_agent.studio.pages.layout import (
    address_of,
    framed,
    keep_upload,
    shown_command,
    shown_first,
)
from tdac_agent.studio.pages.overlay import overlay
from tdac_agent.studio.pages.writers import Writers
from tdac_agent.studio.sources import OWN, is_source, source_of, sources_in
from tdac_envs.core.errors import PolarityError, TdacError
from tdac_envs.grid.plan import path_length

MOST_BYTES = 64 << 20
ACCEPTED = "image, map.yaml + image, .map, .npy, .wbt"
FIRST = "map: maze"
LEAST_RADIUS, RADIUS_STEP = 1.0, 0.5
ELSEWHERE = 0.5
"""By how much half of a passage must be less than the widest radius, px, if that gets
through elsewhere: it is measured between walls, the radius from pixel to pixel."""
# A file that is dropped beside the box would replace the page.
DROP = """<script>
addEventListener("dragover", (event) => event.preventDefault());
addEventListener("drop", (event) => {
  event.preventDefault();
  const input = document.querySelector(".q-uploader input[type=file]");
  if (!input || event.target.closest(".q-uploader")) return;
  input.files = event.dataTransfer.files;
  input.dispatchEvent(new Event("change", { bubbles: true }));
});
</script>"""


def add(place: Path) -> None:
    """Adds the page."""

    @ui.page("/")
    async def page(source: str = FIRST, task: str = "") -> None:
        ui.add_body_html(DROP)
        with framed("New controller"):
            await Choosing(place).show(source, task)


class Choosing:
    """The state of one opened page.

    Args:
        place: Folder of the studio.
    """

    def __init__(self, place: Path) -> None:
        self._place = place
        self._board: Board | None = None
        self._draft: Draft | None = None
        self._checked: Checked | None = None
        self._shown = b""
        self._turn = 0  # number of the newest choice: the work on older ones is dropped

    async def show(self, source: str, task: str) -> None:
        """Builds the page."""
        with ui.element("div").classes("choosing"):
            with ui.column().classes("min-w-0 gap-3"):
                self._build_source(source)
                self._build_task()
                self._build_start()
            with ui.column().classes("beside min-w-0 gap-2"):
                self._image = ui.interactive_image(
                    on_mouse=self._clicked, cross="#d55e00"
                ).classes("board")
                self._image.props('alt="The map or world"')
                self._reading = ui.label().classes("note text-sm")
                self._notes = ui.column().classes("gap-0")
        await shown_first()
        if self._turn == 0:  # nobody was faster than the page
            await self._open(source)
            await self._take(task)

    def _build_source(self, source: str) -> None:
        ui.label("1. Map or world").classes("text-lg font-bold")
        options = sources_in(self._place)
        if source not in options:
            options.append(source)
        self._source = ui.select(
            options,
            value=source,
            label="bundled, or a file of this folder",
            with_input=True,
            on_change=lambda event: self._open(event.value),
        ).classes("w-full")
        self._upload = ui.upload(
            label=f"Drop a file here, or click: {ACCEPTED}",
            multiple=True,
            auto_upload=True,
            max_file_size=MOST_BYTES,
            on_upload=self._uploaded,
            on_rejected=lambda: ui.notify(
                f"expected {', '.join(OWN)}, of at most {MOST_BYTES >> 20} MB",
                type="warning",
            ),
        ).props('flat accept="{}"'.format(",".join(OWN)))
        with ui.row().classes("items-center gap-2") as self._read:
            ui.label("obstacles")
            self._polarity = ui.toggle(
                {"": "detect", "dark": "are dark", "light": "are light"},
                value="",
                on_change=lambda: self._open(self._source.value),
            ).props("no-caps dense")

    def _build_task(self) -> None:
        ui.label("2. Start and goal").classes("text-lg font-bold")
        self._mode = ui.toggle(
            {"start": "click the start", "heading": "its heading", "goal": "the goal"},
            value="start",
        ).props("no-caps dense")
        names = ("start x", "start y", "heading, rad", "goal x", "goal y")
        self._numbers: dict[str, ui.number] = {}
        with ui.grid(columns=3).classes("w-full gap-2"):
            for name in names:
                self._numbers[name] = (
                    ui.number(name, format="%g")
                    .on("change", self._typed)
                    .on("keydown.enter", self._typed)
                    .props("dense")
                )
        with ui.column().classes("w-full gap-0") as self._sized:
            self._radius_text = ui.label("robot radius")
            self._radius = ui.slider(
                min=LEAST_RADIUS, max=40, step=RADIUS_STEP, value=15
            ).props("label aria-label='robot radius, px'")
            self._radius.on("change", self._resized)
        self._told = ui.label().classes("text-sm").props("role=status")
        self._snap = ui.button("Use the nearest free place", on_click=self._move).props(
            "outline no-caps dense"
        )
        self._fit = ui.button(on_click=self._shrink).props("outline no-caps dense")
        self._snap.visible = self._fit.visible = False

    def _build_start(self) -> None:
        ui.label("3. Who writes").classes("text-lg font-bold")
        self._writers = Writers(self._place, self._refresh_command, on_task=True)
        self._go = ui.button("Write and verify a controller", on_click=self._begin)
        ui.label("The same on the command line:").classes("note text-sm")
        self._command = shown_command("")

    async def _open(self, source: str) -> None:
        """Reads another map or world."""
        self._turn += 1
        turn = self._turn
        kind, _, name = source.partition(": ")
        asked = self._polarity.value or None
        try:
            path = name if name in names_of(_kind(kind)) else str(self._place / name)
            board = await asyncio.to_thread(board_of, _kind(kind), path, asked)
        except PolarityError as error:
            self._refuse(f"{error}. Choose which pixels are the obstacles.")
            return
        except (TdacError, OSError, ValueError) as error:
            self._refuse(str(error))
            return
        if turn != self._turn:  # something else has been chosen meanwhile
            return
        kept = asked if kind == "map" else None
        self._board, self._draft = board, Draft.of(board, name, kept)
        self._show_picture(board.png)
        self._image.props(f'alt="{kind} {name}"')
        self._reading.text = board.reading
        self._notes.clear()
        with self._notes:
            for note in board.notes:
                ui.label(note).classes("note text-sm")
        self._sized.visible = self._read.visible = board.kind == "map"
        self._radius.value = self._draft.radius or 15
        self._mode.value = "start"
        self._show_numbers(self._draft)
        await self._check()

    def _refuse(self, text: str) -> None:
        self._checked, self._draft = None, None
        self._snap.visible = self._fit.visible = False
        for number in self._numbers.values():
            number.value = None
        self._radius_text.text = ""
        self._image.set_source("")
        self._shown = b""
        self._image.content = ""
        self._reading.text = ""
        self._tell(text, good=False)
        self._refresh_command()

    async def _uploaded(self, event: events.UploadEventArguments) -> None:
        """Keeps a file, and opens it if it is a map or a world."""
        if not is_source(Path(event.file.name)):
            text = f"{event.file.name}: expected one of {', '.join(OWN)}"
            ui.notify(text, type="warning")
            return
        at = await keep_upload(event, self._place)
        source = source_of(self._place, self._place / at)
        if source is None:
            ui.notify(f"{at} is kept; drop its image, too", type="info")
            return
        self._source.set_options(sources_in(self._place))
        self._upload.reset()
        self._source.value = source

    async def _clicked(self, event: events.MouseEventArguments) -> None:
        if self._board is None or self._draft is None:
            return
        unit = self._board.unit
        place = self._board.place(event.image_x, event.image_y)
        mode, nearest = self._mode.value, _on_pixel(place, unit)
        if mode == "start":
            self._draft = self._draft.with_start(nearest, unit)
            self._mode.value = "heading"
        elif mode == "heading":
            self._draft = self._draft.facing(place)
            self._mode.value = "goal"
        else:
            self._draft = self._draft.with_goal(nearest, unit)
        self._show_numbers(self._draft)
        await self._check()

    async def _typed(self) -> None:
        if self._draft is None:
            return
        values = [self._numbers[name].value for name in self._numbers]
        x, y, heading, goal_x, goal_y = values
        start = None if x is None or y is None else (x, y)
        goal = None if goal_x is None or goal_y is None else (goal_x, goal_y)
        self._draft = replace(self._draft, start=start, goal=goal, heading=heading)
        await self._check()

    async def _take(self, task: str) -> None:
        """Takes start, heading, goal and radius from the address of the page."""
        values = [float(part) for part in task.split(",") if part]
        if self._draft is None or len(values) != 6:
            return
        x, y, heading, goal_x, goal_y, radius = values
        self._draft = replace(
            self._draft,
            start=(x, y),
            heading=heading,
            goal=(goal_x, goal_y),
            radius=radius,
        )
        self._radius.value = radius
        self._show_numbers(self._draft)
        await self._check()

    async def _move(self) -> None:
        """Moves start and goal to the nearest free places."""
        draft, board = self._draft, self._board
        if draft is None or board is None:
            return
        try:
            moved = await asyncio.to_thread(snapped, draft, self._place)
        except (TdacError, ValueError) as error:
            self._tell(str(error), good=False)
            return
        self._draft = moved
        self._show_numbers(moved)
        await self._check()

    async def _shrink(self) -> None:
        """Takes the largest radius of the slider that gets through."""
        draft = self._draft
        fitting = None if draft is None else fitting_radius(draft, self._checked)
        if fitting is not None:
            self._radius.value = fitting
            await self._resized()

    async def _resized(self) -> None:
        if self._draft is not None:
            self._draft = replace(self._draft, radius=float(self._radius.value))
            await self._check()

    async def _check(self) -> None:
        """Finds the path of the draft, or why there is none."""
        draft, board = self._draft, self._board
        assert draft is not None
        assert board is not None
        self._turn += 1
        turn, self._checked = self._turn, None
        if draft.goal is None or (draft.start is None and board.start is None):
            self._tell("Click the start, a point ahead of it, and the goal.", good=True)
        else:
            checked = await asyncio.to_thread(check, draft, board, self._place)
            if turn != self._turn:
                return
            self._checked = checked
            self._tell(*sentence_of(checked, board))
            self._show_picture(checked.picture or board.png)
        stuck = self._checked is not None and self._checked.task is None
        fitting = fitting_radius(draft, self._checked) if stuck else None
        self._snap.visible = stuck and board.kind == "map" and fitting is None
        self._fit.visible = fitting is not None
        if fitting is not None:
            self._fit.text = f"Use a radius of {fitting:g} px"
        self._image.content = overlay(board, draft, self._checked)
        ui.navigate.history.replace(address_with(draft))
        self._show_radius(draft)
        self._refresh_command()

    def _show_picture(self, png: bytes) -> None:
        if png != self._shown:
            self._shown = png
            self._image.set_source(data_address(png, "image/png"))

    def _show_numbers(self, draft: Draft) -> None:
        places = (*(draft.start or (None, None)), draft.heading)
        shown = (*places, *(draft.goal or (None, None)))
        for number, value in zip(self._numbers.values(), shown, strict=True):
            number.value = value

    def _show_radius(self, draft: Draft) -> None:
        text = f"robot radius {draft.radius:g} px" if draft.radius else ""
        widest = self._checked.widest if self._checked else None
        if widest is not None and widest > 0:
            text += f"; the widest that gets through has {widest:g} px"
        self._radius_text.text = text

    def _tell(self, text: str, good: bool) -> None:
        self._told.text = text
        self._told.classes(
            add="fine" if good else "problem", remove="problem" if good else "fine"
        )

    def _refresh_command(self) -> None:
        words = self._words()
        self._command.text = "tdac " + shlex.join(words) if words else ""
        ready = self._checked is not None and self._checked.task is not None
        self._go.set_enabled(ready and self._writers.problem() is None)

    def _words(self) -> list[str]:
        if self._draft is None:
            return []
        return ["synth", *self._draft.words(), *self._writers.words()]

    async def _begin(self) -> None:
        """Starts the run, and opens its page."""
        if self._checked is None or self._checked.task is None:
            return
        folder = str(next_folder(self._checked.task.name, self._place))
        words = [*self._words(), "--out", folder]
        words = self._writers.with_folder(words, folder)
        try:
            start(self._place, words, folder)
        except OSError as error:
            ui.notify(f"cannot start: {error.strerror}", type="negative")
            return
        ui.navigate.to(address_of("/run", folder))


def address_with(draft: Draft) -> str:
    """Address of the page with a draft, which loads the page with it again."""
    address = f"/?source={quote(f'{draft.kind}: {draft.source}')}"
    values = *(draft.start or ()), draft.heading, *(draft.goal or ()), draft.radius
    if len(values) < 6 or None in values:
        return address
    return f"{address}&task={','.join(f'{value:.6g}' for value in values)}"


def _kind(kind: str) -> Kind:
    return "world" if kind == "world" else "map"


def _on_pixel(place: Place, unit: str) -> Place:
    """A clicked place; on a map, the middle of a pixel."""
    return (round(place[0]), round(place[1])) if unit == "px" else place


def fitting_radius(draft: Draft, checked: Checked | None) -> float | None:
    """The largest radius of the slider that gets through; None if that is no help."""
    if checked is None or checked.widest is None or draft.radius is None:
        return None
    fitting = math.floor(checked.widest / RADIUS_STEP) * RADIUS_STEP
    return fitting if LEAST_RADIUS <= fitting < draft.radius else None


def sentence_of(checked: Checked, board: Board) -> tuple[str, bool]:
    """What was found, and whether it is good."""
    if checked.task is None:
        return checked.problem, False
    reach = checked.task.nominal.goal_tolerance
    text = (
        f"A path of {path_length(checked.path):.4g} {board.unit}; the goal is reached "
        f"within {reach:.3g} {board.unit} (disc)"
    )
    return f"{text}.{_about_passage(checked, board.unit)}", True


def _about_passage(checked: Checked, unit: str) -> str:
    """How wide the narrowest passage of the path is, and for which robots."""
    narrowest, widest = checked.narrowest, checked.widest
    if narrowest is None:
        return ""
    if narrowest.at != "path":
        away = narrowest.width / 2.0
        text = f"It is narrowest at the {narrowest.at}, {away:.3g} {unit} from a wall"
    else:
        text = f"Its narrowest passage (bar) is {narrowest.width:.3g} {unit} wide"
    if widest is None:
        return f" {text}."
    if narrowest.width / 2.0 > widest - ELSEWHERE:
        return f" {text}: room for a radius of {widest:g} {unit}."
    return f" {text}; another path has room for a radius of {widest:g} {unit}."
