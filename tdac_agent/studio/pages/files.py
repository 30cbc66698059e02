"""Reports, pictures and videos of the folder, each in a frame without any rights."""

from __future__ import annotations

import functools
from pathlib import Path

import fastapi
from fastapi import HTTPException, Response
from fastapi.responses import FileResponse

from tdac_agent.errors import RunError
from tdac_agent.html_report.page import make_page, own_script
from tdac_agent.studio.folder import within
from tdac_envs.core.intake import read_file

# A report is made from files that others may have written, and a page in the folder may
# be anyone's: its frame can neither read the studio's cookie, nor ask any server for
# anything. Without scripts, no page can leave for another address by itself.
RIGHTS = "sandbox; default-src 'unsafe-inline' data:"
ISOLATED = {"Content-Security-Policy": RIGHTS, "Cache-Control": "no-store"}
POLICY = b'<meta http-equiv="Content-Security-Policy" '
MOST_BYTES = 256 << 20
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
        return Response(html, media_type=SHOWN[".html"], headers=headers_of(html))

    @application.get("/file")
    def file(at: str) -> Response:
        path = within(place, at)
        kind = None if path is None else SHOWN.get(path.suffix)
        if path is None or kind is None or not path.is_file():
            raise HTTPException(404, "no such file")
        if path.suffix == ".html":
            try:
                html = read_file(path, MOST_BYTES)
            except OSError as error:
                raise HTTPException(404, "no such file") from error
            return Response(html, media_type=kind, headers=headers_of(html))
        return FileResponse(path, media_type=kind, headers=ISOLATED)


def headers_of(html: bytes) -> dict[str, str]:
    """The headers of a page: the script of our own reports may run, no other one.

    With scripts, browsers obey `<meta http-equiv=refresh>`, too: so there must be no
    such element but the policy that our reports begin with.
    """
    plain = html.lower()
    starts = html.lstrip().startswith(b"<!doctype html>")  # in ASCII, no UTF-16
    if not starts or plain.count(b"http-equiv") != 1 or POLICY not in html:
        return ISOLATED
    rights = "sandbox allow-scripts; default-src 'none'; img-src data:"
    own = f"{rights}; style-src 'unsafe-inline'; script-src '{own_script()}'"
    return {**ISOLATED, "Content-Security-Policy": own}


@functools.lru_cache(maxsize=4)
def _report(folder: Path, version: str) -> bytes:
    """The report on a run in one of its states."""
    del version
    return make_page(folder).html
