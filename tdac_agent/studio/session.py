"""Admits only a browser that has opened the address with the token.

A page of another site, or another user of this machine, can reach a port of the
loopback interface. So each request needs a cookie that no script can read and no
other site can send; the host must be this machine, and what changes something must
come from a page of the studio.

The token is new at each start. The cookie follows from the secret of the installation,
the folder, the port and the time at which it was given: after a restart on the same
port, open pages go on.
"""

from __future__ import annotations

import secrets
import time
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from urllib.parse import parse_qs

from tdac_agent.loopback import (
    App,
    LocalAddress,
    Receive,
    Scope,
    Send,
    answer,
    equal,
    headers_of,
)
from tdac_agent.tasks.installation import keyed

# A new document loads the page, so that the cookie is sent whatever page had the link.
_ENTRANCE = (
    '<!doctype html><html lang="en"><meta charset="utf-8"><title>tdac studio</title>'
    '<meta http-equiv="refresh" content="0; url=/"><a href="/">tdac studio</a>'
)
_REFUSED = (
    "Open the address that `tdac studio` printed: this browser has not been let in, or "
    "not within the last week, or the studio is now that of another folder."
)
LASTING = 7 * 24 * 3600
"""For how long a cookie is accepted, s."""


class SessionCheck:
    """An ASGI application in front of another one.

    Args:
        app: The application.
        port: Port on which it is reached.
        place: Folder of the studio. The cookie of another one is not accepted.

    Attributes:
        token: The secret that opens a session, in the address that is printed.
    """

    def __init__(self, app: App, port: int, place: Path) -> None:
        self.token = secrets.token_urlsafe(24)
        self._app, self._signed = app, f"studio|{port}|{place}"
        # Cookies are shared by all ports of a host.
        self._cookie = f"tdac-studio-{port}"
        self._address = LocalAddress(port)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes a request on, or refuses it; see the ASGI specification."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
        elif self._has_token(scope):  # first: removes it from the address
            await self._let_in(send)
        elif self._is_local(scope) and self._has_session(headers_of(scope)):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await receive()  # the handshake
            await send({"type": "websocket.close", "code": 1008})
        else:
            await answer(send, 403, _REFUSED, "text/plain")

    def _is_local(self, scope: Scope) -> bool:
        """Whether the host is this one, and the page that asks is one of ours."""
        reads = scope["type"] == "http" and scope["method"] in ("GET", "HEAD")
        return self._address.is_local(headers_of(scope), without_origin=reads)

    def _has_session(self, headers: dict[str, str]) -> bool:
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(self._cookie)
        except CookieError:
            return False
        content = "" if cookie is None else cookie.value
        time_text = content.partition(".")[0]
        is_number = time_text.isascii() and time_text.isdecimal()
        issued = int(time_text) if is_number and len(time_text) < 16 else 0
        is_recent = 0 <= time.time() - issued < LASTING
        return is_recent and equal(content, self._session(issued))

    def _session(self, issued: int) -> str:
        """The content of a cookie that is given at a time, in seconds since 1970."""
        signed = f"{self._signed}|{issued}".encode("utf-8", "surrogateescape")
        return f"{issued}.{keyed(signed).hex()}"

    def _has_token(self, scope: Scope) -> bool:
        query = parse_qs(scope["query_string"].decode("latin-1"))
        return (
            scope["type"] == "http"
            and scope["method"] == "GET"
            and self._is_local(scope)
            and equal(query.get("token", [""])[0], self.token)
        )

    async def _let_in(self, send: Send) -> None:
        content = f"{self._cookie}={self._session(int(time.time()))}"
        cookie = f"{content}; Max-Age={LASTING}; HttpOnly; SameSite=Strict; Path=/"
        await answer(send, 200, _ENTRANCE, "text/html", ("set-cookie", cookie))
