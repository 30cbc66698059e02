"""The page at an address that has none."""

from __future__ import annotations

from pathlib import Path

from nicegui import ui

from tdac_agent.studio.pages.layout import LINKS, framed


def add(place: Path) -> None:
    """Adds the page; after all others."""

    @ui.page("/{path:path}")
    def unknown(path: str) -> None:
        with framed("There is no such page", place):
            ui.label(f"Nothing is at /{path}. These pages exist:")
            for name, address in LINKS.items():
                ui.link(name, address)
