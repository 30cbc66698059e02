"""The picture of the start page, on which start, heading and goal are set.

They are clicked, or set by keys at a cursor that the arrow keys move.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable, Sequence
from io import BytesIO
from typing import Literal

from nicegui import events, ui
from PIL import Image as PictureFile

from tdac_agent.html_report.scene import data_address
from tdac_agent.studio.map_cursor import ARROWS, MapCursor
from tdac_agent.studio.source_view import Place, SourceView

Mode = Literal["start", "heading", "goal"]
AFTER: dict[Mode, Mode] = {"start": "heading", "heading": "goal", "goal": "goal"}
"""What the next click sets."""
PLACES: dict[str, Mode] = {"s": "start", "g": "goal"}
"""Keys that set a place at the cursor."""
TURN = math.radians(15)
"""By which the key H turns the start heading, rad, clockwise on the picture."""
HELP = """By keyboard: Tab to the map. <kbd>←</kbd> <kbd>→</kbd> <kbd>↑</kbd>
<kbd>↓</kbd> move a cursor by a pixel (in a world by a centimetre), with
<kbd>Shift</kbd> by ten. <kbd>S</kbd> places the start there, <kbd>G</kbd> the goal.
<kbd>H</kbd> turns the robot by 15° to the right, with <kbd>Shift</kbd> to the left."""
# Keys with Ctrl, Alt or Meta stay those of the browser.
FORWARD = """(event) => {
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  if (!%s.includes(key)) return;
  event.preventDefault();
  emit({ key: key, shift: event.shiftKey });
}""" % [*ARROWS, *PLACES, "h"]


class ClickableMap:
    """A picture, what a click or a key on it sets, and how it was read.

    Args:
        placed: Called with what is set, and the point of the picture.
        turned: Called with the angle by which the heading is turned, rad, clockwise on
            the picture; returns what is to be said about it.
    """

    def __init__(
        self,
        placed: Callable[[Mode, float, float], Awaitable[None]],
        turned: Callable[[float], Awaitable[str]],
    ) -> None:
        self._placed, self._turned, self._shown = placed, turned, b""
        self._view: SourceView | None = None
        self._first: Place | None = None
        self._cursor: MapCursor | None = None
        self._turns = 0
        self._marks = ""
        self._mode = ui.toggle(
            {"start": "click the start", "heading": "its heading", "goal": "the goal"},
            value="start",
        ).props("no-caps dense")
        self._build_picture()
        self._reading = ui.label().classes("note text-sm")
        self._notes = ui.column().classes("gap-0")

    def _build_picture(self) -> None:
        with ui.element("div").classes("keys") as keys:
            self._image = ui.interactive_image(
                on_mouse=self._on_mouse, cross="#d55e00"
            ).classes("board")
            self._image.props('alt="The map or world"')
        keys.props("tabindex=0 role=application aria-describedby=map-keys")
        keys.props("aria-label='Map with a cursor'")
        keys.on("keydown", self._on_key, js_handler=FORWARD)
        self._told = ui.label().classes("text-sm")
        self._told.props("role=status aria-live=polite")
        about = ui.html(HELP, sanitize=False, tag="p").classes("note text-sm")
        about.props("id=map-keys")

    def begin(self, alt: str, reading: str, notes: Sequence[str]) -> None:
        """Describes another picture; the next click sets the start."""
        self._image.props["alt"] = alt  # a file may have any name
        self._image.update()
        self._reading.text = reading
        self._notes.clear()
        with self._notes:
            for note in notes:
                ui.label(note).classes("note text-sm")
        self._mode.value = "start"

    def take(self, view: SourceView | None, first: Place | None = None) -> None:
        """Takes the view of another picture; the cursor begins anew.

        Args:
            view: The view; None if nothing can be placed on the picture.
            first: Where the cursor begins; None for the middle.
        """
        self._view, self._first, self._cursor = view, first, None
        self._told.text = ""

    def show(self, png: bytes) -> None:
        """Shows a picture, so that all of it is in the window."""
        if png == self._shown:
            return
        self._shown = png
        if not png:
            self._image.set_source("")
            return
        width, height = PictureFile.open(BytesIO(png)).size
        self._image.style(f"width: min(100%, var(--room) * {width / height:.4f})")
        self._image.set_source(data_address(png, "image/png"))

    def mark(self, svg: str) -> None:
        """Draws marks over the picture, and the cursor over them."""
        self._marks = svg
        if self._view is not None and self._cursor is not None:
            svg += self._cursor.svg(self._view)
        self._image.content = svg

    async def _on_mouse(self, event: events.MouseEventArguments) -> None:
        if not self._shown:
            return
        mode: Mode = self._mode.value
        self._mode.value = AFTER[mode]
        await self._placed(mode, event.image_x, event.image_y)

    async def _on_key(self, event: events.GenericEventArguments) -> None:
        view = self._view
        if view is None:
            return
        key, shift = event.args["key"], bool(event.args["shift"])
        before = self._cursor or MapCursor.on(view, self._first)
        if key == "h":
            self._turns += 1
            number = self._turns
            text = await self._turned(-TURN if shift else TURN)
            if number == self._turns:  # a later turn may be told before this one
                self._told.text = text
            return
        if key in PLACES:
            self._cursor = before
            ((x, y),) = view.at([before.place]).tolist()
            self._told.text = f"The {PLACES[key]} is placed here."
            await self._placed(PLACES[key], x, y)
            return
        cursor = self._cursor = before.moved(view, key, far=shift)
        self.mark(self._marks)
        text = await asyncio.to_thread(cursor.told, view)
        if cursor is self._cursor:  # no further key was pressed meanwhile
            edge = " The edge of the picture." if cursor == before else ""
            self._told.text = text + edge
