"""Reports, pictures and videos of the folder, each in a frame without any rights."""

from __future__ import annotations

import functools
from pathlib import Path

import fastapi
from fastapi import HTTPException, Response
from fastapi.responses import FileResponse

from tdac_agent.errors import RunError
from tdac_agent.html_report.page import make_page
from tdac_agent.studio.folder import within

# A report is made from files that others may have written, and a page in the folder may
# be anyone's: its frame can neither read the studio's cookie, nor ask any server for
# anything.
RIGHTS = "sandbox allow-scripts; default-src 'unsafe-inline' data:"
ISOLATED = {
    "Content-Security-Policy": RIGHTS,
    "Cache-Control": "no-store",
}
SHOWN = {
    ".html": "text/html; charset=utf-8",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".mp4": "video/mp4",
    ".py": "text/plain; charset=utf-8",
}


def add(application: fastapi.FastAPI, place: Path) -> None:
    """Adds the addresses of files."""

    @application.get("/report")
    def report(at: str, version: str = "") -> Response:
        folder = within(place, at)
        if folder is None or not folder.is_dir():
            raise HTTPException(404, "no such run")
        try:
            html = _report(folder, version)
        except RunError as error:
            raise HTTPException(404, str(error)) from error
        return Response(html, media_type="text/html; charset=utf-8", headers=ISOLATED)

    @application.get("/file")
    def file(at: str) -> Response:
        path = within(place, at)
        kind = None if path is None else SHOWN.get(path.suffix)
        if path is None or kind is None or not path.is_file():
            raise HTTPException(404, "no such file")
        return FileResponse(path, media_type=kind, headers=ISOLATED)


@functools.lru_cache(maxsize=4)
def _report(folder: Path, version: str) -> bytes:
    """The report on a run in one of its states."""
    del version
    return make_page(folder).html
