"""Starts the studio: one server on the loopback interface of this machine."""

from __future__ import annotations

import contextlib
import socket
import webbrowser
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import fastapi
import uvicorn
from nicegui import ui

from tdac_agent.loopback import listen
from tdac_agent.studio.folder import STATE, keep
from tdac_agent.studio.pages import (
    bench,
    compare,
    disconnected,
    files,
    home,
    run,
    run_list,
    unknown,
    worlds,
)
from tdac_agent.studio.session import SessionCheck
from tdac_envs.core.intake import read_file

PORT = "port"
"""File in `.studio` with the port of the last start."""
MOST_MESSAGES = 100
"""Messages kept for a page that lost its connection, so that memory stays bounded."""


def serve(
    place: Path, port: int, announce: Callable[[str], None], *, open_it: bool
) -> None:
    """Serves the studio until it is interrupted.

    Args:
        place: Folder whose files and runs it shows, and in which commands run.
        port: Port on 127.0.0.1; 0 for the last one of the folder, if it is free.
        announce: Called with the address once the port is open.
        open_it: Whether to open the address in the user's browser.

    Raises:
        OSError: The port cannot be opened.
    """
    place = place.resolve()
    with closing(opened_port(place, port)) as opened:
        port = opened.getsockname()[1]
        session = SessionCheck(_application(place), port, place)
        address = f"http://127.0.0.1:{port}/?token={session.token}"
        config = uvicorn.Config(
            session, log_level="critical", access_log=False, ws_max_size=32 << 20
        )
        announce(address)
        if open_it:
            webbrowser.open(address)
        uvicorn.Server(config).run(sockets=[opened])


def opened_port(place: Path, port: int) -> socket.socket:
    """Opens a port, and notes it for the next start: bookmarks and open pages have it.

    Args:
        place: Folder of the studio.
        port: The port; 0 for the last one of the folder, or else any that is free.

    Raises:
        OSError: The port cannot be opened.
    """
    note = place / STATE / PORT
    try:
        opened = listen(port or _noted(note))
    except OSError:
        if port:
            raise
        opened = listen(0)
    with contextlib.suppress(OSError):  # a folder that cannot be written can be shown
        keep(place, f"{STATE}/{PORT}", f"{opened.getsockname()[1]}\n".encode())
    return opened


def _noted(note: Path) -> int:
    """The port in a file; 0 if there is none."""
    try:
        port = int(read_file(note, 16))
    except (OSError, ValueError):
        return 0
    return port if 1024 <= port < 65536 else 0


def _application(place: Path) -> fastapi.FastAPI:
    application = fastapi.FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    files.add(application, place)
    disconnected.add(application, place)
    for page in (bench, compare, home, run, run_list, worlds):
        page.add(place)
    unknown.add(place)
    ui.run_with(
        application,
        title="tdac studio",
        language="en-US",
        dark=None,  # as the browser prefers
        message_history_length=MOST_MESSAGES,
        show_welcome_message=False,
    )
    return application
