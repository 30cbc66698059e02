"""The picture of the start page, on which start, heading and goal are clicked."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from io import BytesIO
from typing import Literal

from nicegui import events, ui
from PIL import Image as PictureFile

from tdac_agent.html_report.scene import data_address

Mode = Literal["start", "heading", "goal"]
AFTER: dict[Mode, Mode] = {"start": "heading", "heading": "goal", "goal": "goal"}
"""What the next click sets."""


class ClickableMap:
    """A picture, what a click on it sets, and how it was read.

    Args:
        clicked: Called with what a click sets, and the point of the picture.
    """

    def __init__(
        self, clicked: Callable[[Mode, float, float], Awaitable[None]]
    ) -> None:
        self._clicked, self._shown = clicked, b""
        self._mode = ui.toggle(
            {"start": "click the start", "heading": "its heading", "goal": "the goal"},
            value="start",
        ).props("no-caps dense")
        self._image = ui.interactive_image(
            on_mouse=self._on_mouse, cross="#d55e00"
        ).classes("board")
        self._image.props('alt="The map or world"')
        self._reading = ui.label().classes("note text-sm")
        self._notes = ui.column().classes("gap-0")

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
        """Draws marks over the picture."""
        self._image.content = svg

    async def _on_mouse(self, event: events.MouseEventArguments) -> None:
        if not self._shown:
            return
        mode: Mode = self._mode.value
        self._mode.value = AFTER[mode]
        await self._clicked(mode, event.image_x, event.image_y)
