"""Lets only the browser in that was given the address with the token.

A page of another site, or another user of this machine, can reach a port of the
loopback interface. So each request needs a cookie that no script can read and no
other site can send; the host must be this machine, and what changes something must
come from a page of the studio.
"""

from __future__ import annotations

import secrets
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from tdac_agent.loopback import (
    App,
    Here,
    Receive,
    Scope,
    Send,
    answer,
    equal,
    headers_of,
)

# A new document loads the page, so that the cookie is sent whatever page had the link.
_ENTRANCE = (
    '<!doctype html><html lang="en"><meta charset="utf-8"><title>tdac studio</title>'
    '<meta http-equiv="refresh" content="0; url=/"><a href="/">tdac studio</a>'
)
_REFUSED = (
    "Open the address that `tdac studio` printed: this browser has not been let in, "
    "or the studio has been started again."
)


class Gate:
    """An ASGI application in front of another one.

    Args:
        app: The application.
        port: Port on which it is reached.

    Attributes:
        token: The secret that opens a session, in the address that is printed.
    """

    def __init__(self, app: App, port: int) -> None:
        self.token = secrets.token_urlsafe(24)
        self._app, self._session = app, secrets.token_urlsafe(24)
        # Cookies are shared by all ports of a host.
        self._cookie = f"tdac-studio-{port}"
        self._here = Here(port)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes a request on, or refuses it; see the ASGI specification."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
        elif self._has_token(scope):  # first: it shall leave the address
            await self._let_in(send)
        elif self._is_allowed(scope):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await receive()  # the handshake
            await send({"type": "websocket.close", "code": 1008})
        else:
            await answer(send, 403, _REFUSED, "text/plain")

    def _is_allowed(self, scope: Scope) -> bool:
        headers = headers_of(scope)
        return self._is_here(scope, headers) and self._has_session(headers)

    def _is_here(self, scope: Scope, headers: dict[str, str]) -> bool:
        """Whether the host is this one, and the page that asks is one of ours."""
        reads = scope["type"] == "http" and scope["method"] in ("GET", "HEAD")
        return self._here.is_here(headers, without_origin=reads)

    def _has_session(self, headers: dict[str, str]) -> bool:
        try:
            found = SimpleCookie(headers.get("cookie", "")).get(self._cookie)
        except CookieError:
            return False
        return found is not None and equal(found.value, self._session)

    def _has_token(self, scope: Scope) -> bool:
        query = parse_qs(scope["query_string"].decode("latin-1"))
        given = query.get("token", [""])[0]
        return (
            scope["type"] == "http"
            and scope["method"] == "GET"
            and self._is_here(scope, headers_of(scope))
            and equal(given, self.token)
        )

    async def _let_in(self, send: Send) -> None:
        cookie = f"{self._cookie}={self._session}; HttpOnly; SameSite=Strict; Path=/"
        await answer(send, 200, _ENTRANCE, "text/html", ("set-cookie", cookie))
