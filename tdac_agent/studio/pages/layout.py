"""What all pages share: the frame, the style, and paths within the folder."""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from html import escape
from pathlib import Path
from urllib.parse import quote

from nicegui import events, ui

from tdac_agent.studio.folder import FILES, keep
from tdac_agent.studio.jobs import stop_job
from tdac_agent.studio.pages.frames import FITTED
from tdac_agent.studio.pages.named_parts import NAMED
from tdac_agent.studio.pages.style import PRIMARY, STYLE
from tdac_agent.studio.pages.trail import Step, trail_html

PATIENCE = 120.0
"""Seconds that a browser may need to show a page."""
AWAITED = "The report is being made …"
SHOWN = "(event) => { event.target.previousElementSibling.hidden = true; }"
LINKS = {
    "New controller": "/",
    "Runs": "/runs",
    "Worlds": "/worlds",
    "Benches": "/benches",
}


@contextmanager
def framed(
    title: str, place: Path, *, under: Sequence[Step] = (), headed: bool = True
) -> Generator[None]:
    """The frame of a page: links to the others, and the way to this one.

    Args:
        title: What the page is about.
        place: Folder of the studio.
        under: The pages above it, from one of `LINKS` on.
        headed: Whether the title stands as a heading; otherwise the page has its own.
    """
    ui.add_css(STYLE)
    ui.add_body_html(NAMED)
    ui.add_body_html(FITTED)
    ui.colors(primary=PRIMARY)
    ui.page_title(f"{title} – tdac studio")
    with ui.header().classes("items-center gap-4 py-2"):
        ui.label("tdac studio").classes("text-lg font-bold max-sm:hidden")
        for name, address in LINKS.items():
            link = ui.link(name, address)
            if name == title:
                link.props("aria-current=page")
            elif under and name == under[0].name:
                link.props("aria-current=true")
    with ui.column().classes("w-full gap-3 px-1"):
        trail = ui.html(trail_html(title, place, under), sanitize=False, tag="nav")
        trail.classes("trail").props("aria-label='Where you are'")
        if headed:
            heading(title, 1)
        yield


def heading(text: str, level: int = 2) -> None:
    """A heading, of level 1 for what the page is about."""
    ui.html(escape(text), sanitize=False, tag=f"h{level}")


def say_missing(kind: str, at: str, page: str) -> None:
    """Says that there is no such thing in the folder, with a way back.

    Args:
        kind: What it would be, such as `run`.
        at: Its path from the address.
        page: The page of `LINKS` that lists what there is.
    """
    heading(f"There is no {kind} {at!r}" if at else f"No {kind} is chosen", 1)
    with ui.row().classes("items-baseline gap-1"):
        if at:
            ui.label("It may have been moved or deleted.")
        ui.link(f"All {page.lower()}", LINKS[page])


def say_empty(text: str, *, link: Step | None = None, command: str = "") -> None:
    """Says in a sentence that there is nothing to show yet, and what to do next.

    Args:
        text: The sentence.
        link: Page on which to do it.
        command: Command that does it, too.
    """
    with ui.column().classes("empty"):
        with ui.row().classes("items-baseline gap-2"):
            ui.label(text)
            if link is not None:
                ui.link(link.name, link.address)
        if command:
            ShownCommand().show(command)


async def shown_first() -> None:
    """Waits until the browser shows what has been built: slow work comes after it."""
    await ui.context.client.connected(timeout=PATIENCE)


class ShownCommand:
    """A command as it would be typed, with a button to copy it."""

    def __init__(self) -> None:
        self._text = ""
        with ui.row().classes("w-full items-center no-wrap gap-2") as self._row:
            self._code = ui.html(sanitize=False, tag="code").classes("command")
            ui.button(icon="content_copy", on_click=lambda: copied(self._text)).props(
                "flat dense aria-label='Copy the command'"
            )
        self._row.visible = False

    def show(self, text: str) -> None:
        """Shows another command; an empty one hides all."""
        self._text = text
        self._row.visible = bool(text)
        # A line ends between two words, not between the hyphens of a flag.
        words = (f"<span>{escape(word)}</span>" for word in text.split(" "))
        self._code.content = " ".join(words)


def copied(text: str) -> None:
    """Copies a text, and says so."""
    ui.clipboard.write(text)
    ui.notify("copied")


def address_of(page: str, at: str) -> str:
    """Address of a page about something in the folder."""
    return f"{page}?at={quote(at)}"


async def keep_upload(event: events.UploadEventArguments, place: Path) -> str:
    """Keeps an uploaded file; returns its path, relative to the studio's folder.

    Its name has nothing that a path or a shell would read otherwise.
    """
    name = re.sub(r"[^\w.-]+", "-", Path(event.file.name).name).lstrip(".-") or "file"
    at = f"{FILES}/{name}"
    keep(place, at, await event.file.read())
    return at


def status_badge(status: str) -> None:
    """A status in its colour."""
    ui.label(status).classes(_badge_classes(status))


def _badge_classes(status: str) -> str:
    return f"status {status.replace(' ', '-')}"


class JobPage:
    """A page about a run or bench: what it is, its status, what it does now, buttons.

    Args:
        place: Folder of the studio.
        at: The run or bench, relative to it.
        folder: Its folder, without links.
    """

    def __init__(self, place: Path, at: str, folder: Path) -> None:
        self._place, self._at, self._folder = place, at, folder

    def _build_heading(self) -> None:
        with ui.row().classes("w-full items-center gap-3"):
            heading(self._at, 1)
            self._badge = ui.label()
            self._now = ui.label().classes("note").props("role=status")

    def _build_buttons(self, go_on: Callable[[], object]) -> None:
        """Builds the buttons that stop the command, which takes a while, or start it.

        Args:
            go_on: Starts it again.
        """
        self._stop = ui.button("Stop", icon="stop", on_click=self._interrupt)
        self._resume = ui.button("Continue", icon="play_arrow", on_click=go_on)

    def _show_status(self, status: str, *, running: bool, continues: bool) -> None:
        """Shows the status, and the button that is of use now."""
        self._badge.text = status
        self._badge.classes(replace=_badge_classes(status))
        if not running:
            self._stop.text = "Stop"
            self._stop.enable()
        self._stop.visible = running
        self._resume.visible = continues and not running

    def _interrupt(self) -> None:
        self._stop.text = "Stopping …"
        self._stop.disable()
        stop_job(self._place, self._at)


def report_frame(at: str, version: str) -> None:
    """The report of a run in one of its states."""
    _frame(f"{address_of('/report', at)}&version={version}#play", f"Report on {at}")


def file_frame(at: str, version: str, title: str) -> None:
    """A page that was written to the folder, in one of its states."""
    _frame(f"{address_of('/file', at)}&version={version}", title)


def _frame(address: str, title: str) -> None:
    """A page in a frame without any rights; until it is there, a text says so."""
    rights = {"src": address, "sandbox": "allow-scripts", "title": title}
    with ui.element("div").classes("reported"):
        ui.label(AWAITED).classes("note")
        frame = ui.element("iframe").classes("report")
        frame.props.update(rights)
        frame.on("load", js_handler=SHOWN)
