"""What all pages share: the frame, the style, and paths within the folder."""

from __future__ import annotations

import re
from collections.abc import Callable, Generator
from contextlib import contextmanager
from html import escape
from pathlib import Path
from urllib.parse import quote

from nicegui import events, ui

from tdac_agent.studio.folder import FILES, keep
from tdac_agent.studio.jobs import stop_job

STYLE = """
body { font-family: system-ui, sans-serif; background: #f6f6f3; color: #23262e; }
.q-header { background: #23262e; }
.nicegui-content { max-width: 1500px; margin: 0 auto; width: 100%; }
code.command { display: block; background: #eceae3; padding: .6em .8em;
  border-radius: 6px; white-space: pre-wrap; overflow-wrap: anywhere;
  font-size: .85rem; width: 100%; }
code.command span { display: inline-block; max-width: 100%; }
.board { width: 100%; border: 1px solid #d4d2c8; border-radius: 6px; overflow: hidden; }
.board img { width: 100%; cursor: crosshair; }
.choosing { display: grid; gap: 1.5rem; width: 100%; }
@media (min-width: 1024px) {
  .choosing { grid-template-columns: 26rem minmax(0, 1fr); }
  .beside { position: sticky; top: 4rem; align-self: start;
    --room: (100vh - 9rem); } /* height for the map */
}
@media (max-width: 1023px) {
  .choosing { grid-template-columns: minmax(0, 1fr); }
  .beside { order: -1; --room: 55vh; }
  /* What was found is in sight while the map above it is clicked. */
  .found { position: sticky; bottom: 0; z-index: 2; padding: .4em 0; width: 100%;
    background: #f6f6f3; border-top: 1px solid #d4d2c8; }
}
.world { width: min(100%, 78vh); }
.problem { color: #a3280f; } .fine { color: #12694a; } .note { color: #5d6068; }
iframe.report { border: 1px solid #d4d2c8; border-radius: 6px; width: 100%;
  height: 82vh; background: white; }
.status { border-radius: 999px; padding: .1em .7em; font-weight: 600;
  background: #e4e2da; }
.status.verified, .status.trained, .status.finished { background: #cfe9dc; }
.status.passed { background: #cfe6ec; }
.status.selected { background: #dcdcf3; }
.status.running { background: #d6e4f5; }
.status.not-verified, .status.not-finished { background: #f4d9d2; }
.q-uploader { width: 100%; max-width: 32rem; border: 2px dashed #bdbab0;
  border-radius: 8px; background: none; }
.q-uploader:hover, .q-uploader:focus-within { border-color: #1d5fae; }
.q-uploader__header { background: none; color: #3d4048; border-radius: 0; }
.q-uploader__header-content { position: relative; }
.q-uploader__title { font-size: .9rem; font-weight: 500; line-height: 1.4;
  white-space: normal; }
.q-uploader__subtitle, .q-uploader__list { display: none; }
/* A click anywhere opens the choice of a file. */
.q-uploader .q-btn, .q-uploader .q-btn .q-btn__content { position: static; }
.q-uploader__input { inset: 0; width: 100%; height: 100%; }
td a { color: #1d5fae; }
.compared { width: 100%; border-collapse: collapse; background: white;
  font-size: .9rem; }
.compared td, .compared th { text-align: left; vertical-align: top; padding: .3em .6em;
  border-bottom: 1px solid #e4e2da; overflow-wrap: anywhere; width: 35%; }
.compared td:first-child, .compared th:first-child { width: 1.6em; font-weight: 700;
  color: #a3280f; padding-right: 0; }
.compared td:nth-child(2) { color: #5d6068; width: auto; }
.compared .differs { background: #fbf0da; } .compared .differs td { font-weight: 600; }
.diff { background: white; border: 1px solid #d4d2c8; border-radius: 6px; width: 100%;
  margin: 0; padding: .6em 0; overflow: auto; max-height: 36rem; font-size: .8rem; }
.diff > * { display: block; padding: 0 .8em; width: max-content; min-width: 100%;
  text-decoration: none; }
.diff ins { background: #e3f5ec; color: #075e3d; }
.diff del { background: #fcebe4; color: #9a2c05; }
.diff b { color: #6a61b8; background: #f2f1fa; font-weight: 400; }
#lost:not([hidden]) { position: fixed; inset: auto 0 0 0; z-index: 9999;
  padding: .8em 1.2em; background: #a3280f; color: white; overflow-wrap: anywhere; }
#popup { display: none; } /* NiceGUI's own word about it */
pre.output { white-space: pre-wrap; overflow-wrap: anywhere; font-size: .8rem;
  max-height: 16rem; overflow: auto; width: 100%; margin: 0; }
"""
PATIENCE = 120.0
"""Seconds that a browser may need to show a page."""
LINKS = {
    "New controller": "/",
    "Runs": "/runs",
    "Worlds": "/worlds",
    "Benches": "/benches",
}


@contextmanager
def framed(title: str) -> Generator[None]:
    """The frame of a page, with links to the others."""
    ui.add_css(STYLE)
    ui.page_title(f"{title} – tdac studio")
    with ui.header().classes("items-center gap-4 py-2"):
        ui.label("tdac studio").classes("text-lg font-bold max-sm:hidden")
        for name, address in LINKS.items():
            ui.link(name, address).classes("text-white no-underline")
    with ui.column().classes("w-full gap-3 px-1"):
        yield


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
            ui.label(self._at).classes("text-xl font-bold")
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
    """A page in a frame without any rights."""
    rights = {"src": address, "sandbox": "allow-scripts", "title": title}
    ui.element("iframe").classes("report").props.update(rights)
