"""The first section of the start page: which map or world."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from pathlib import Path

from nicegui import events, ui

from tdac_agent.studio.pages.layout import heading, keep_upload
from tdac_agent.studio.sources import OWN, is_source, own_sources, source_of, sources_in

MOST_BYTES = 64 << 20
ACCEPTED = "image, map.yaml + image, .map, .npy, .wbt"
POLARITIES = {"": "detect", "dark": "are dark", "light": "are light"}
NONE_OWN = (
    "This folder has no map or world of its own yet. Drop one above, or begin with the "
    "bundled one that is chosen."
)
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


class SourceChoice:
    """Bundled maps and worlds, files of the folder, and a place to drop one.

    Args:
        place: Folder of the studio.
        source: What is chosen at first.
        polarity: Which pixels of it are obstacles; empty to infer it.
        opened: Called with the choice after each change.
    """

    def __init__(
        self,
        place: Path,
        source: str,
        polarity: str,
        opened: Callable[[str], Awaitable[None]],
    ) -> None:
        self._place, self._opened = place, opened
        ui.add_body_html(DROP)
        heading("1. Map or world")
        options = sources_in(place)
        if source not in options:
            options.append(source)
        self._source = ui.select(
            options,
            value=source,
            label="bundled, or a file of this folder",
            with_input=True,
            on_change=self._another,
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
        self._none = ui.label(NONE_OWN).classes("note text-sm")
        self._none.visible = not own_sources(place)
        with ui.row().classes("items-center gap-2") as self._read:
            ui.label("obstacles")
            self._polarity = ui.toggle(
                POLARITIES,
                value=polarity if polarity in POLARITIES else "",
                on_change=self._chosen,
            ).props("no-caps dense")

    @property
    def polarity(self) -> str | None:
        """Which pixels of a map are obstacles; None to infer it."""
        return self._polarity.value or None

    def show_polarity(self, shown: bool) -> None:
        """Shows or hides the choice that only maps have."""
        self._read.visible = shown

    async def _another(self) -> None:
        """Opens another map; what was said about the one before is forgotten."""
        if self._polarity.value:
            self._polarity.value = ""  # opens it
        else:
            await self._chosen()

    async def _chosen(self) -> None:
        await self._opened(self._source.value)

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
        self._none.visible = False
        self._source.value = source
