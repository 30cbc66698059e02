"""Starts the studio: one server on the loopback interface of this machine."""

from __future__ import annotations

import webbrowser
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import fastapi
import uvicorn
from nicegui import ui

from tdac_agent.loopback import listen
from tdac_agent.studio.gate import Gate
from tdac_agent.studio.pages import bench, compare, files, home, run, shelf, worlds

MOST_MESSAGES = 100
"""Messages kept for a page that lost its connection, so that memory stays bounded."""


def serve(
    place: Path, port: int, announce: Callable[[str], None], *, open_it: bool
) -> None:
    """Serves the studio until it is interrupted.

    Args:
        place: Folder whose files and runs it shows, and in which commands run.
        port: Port on 127.0.0.1; 0 for a free one.
        announce: Called with the address once the port is open.
        open_it: Whether to open the address in the user's browser.

    Raises:
        OSError: The port cannot be opened.
    """
    with closing(listen(port)) as opened:
        port = opened.getsockname()[1]
        gate = Gate(_application(place.resolve()), port)
        address = f"http://127.0.0.1:{port}/?token={gate.token}"
        config = uvicorn.Config(
            gate, log_level="critical", access_log=False, ws_max_size=32 << 20
        )
        announce(address)
        if open_it:
            webbrowser.open(address)
        uvicorn.Server(config).run(sockets=[opened])


def _application(place: Path) -> fastapi.FastAPI:
    application = fastapi.FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    files.add(application, place)
    for page in (bench, compare, home, run, shelf, worlds):
        page.add(place)
    ui.run_with(
        application,
        title="tdac studio",
        message_history_length=MOST_MESSAGES,
        show_welcome_message=False,
    )
    return application
