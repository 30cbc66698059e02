"""Lets only the browser in that was given the address with the token.

A page of another site, or another user of this machine, can reach a port of the
loopback interface. So each request needs a cookie that no script can read and no
other site can send; the host must be this machine, and what changes something must
come from a page of the studio.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

HOSTS = "127.0.0.1", "localhost"
# A new document loads the page, so that the cookie is sent whatever page had the link.
_ENTRANCE = (
    '<!doctype html><html lang="en"><meta charset="utf-8"><title>tdac studio</title>'
    '<meta http-equiv="refresh" content="0; url=/"><a href="/">tdac studio</a>'
)
_REFUSED = (
    "Open the address that `tdac studio` printed: this browser has not been let in, "
    "or the studio has been started again."
)
_HEADERS = (
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"SAMEORIGIN"),
    (b"cache-control", b"no-store"),
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
        self._hosts = {f"{host}:{port}" for host in HOSTS}
        self._origins = {f"http://{host}" for host in self._hosts}

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
            await _answer(send, 403, _REFUSED, "text/plain")

    def _is_allowed(self, scope: Scope) -> bool:
        headers = _headers(scope)
        return self._is_here(scope, headers) and self._has_session(headers)

    def _is_here(self, scope: Scope, headers: dict[str, str]) -> bool:
        """Whether the host is this one, and the page that asks is one of ours."""
        if headers.get("host") not in self._hosts:
            return False
        reads = scope["type"] == "http" and scope["method"] in ("GET", "HEAD")
        origin = headers.get("origin")
        return origin in self._origins or (reads and origin is None)

    def _has_session(self, headers: dict[str, str]) -> bool:
        try:
            found = SimpleCookie(headers.get("cookie", "")).get(self._cookie)
        except CookieError:
            return False
        return found is not None and _equal(found.value, self._session)

    def _has_token(self, scope: Scope) -> bool:
        query = parse_qs(scope["query_string"].decode("latin-1"))
        given = query.get("token", [""])[0]
        return (
            scope["type"] == "http"
            and scope["method"] == "GET"
            and self._is_here(scope, _headers(scope))
            and _equal(given, self.token)
        )

    async def _let_in(self, send: Send) -> None:
        cookie = f"{self._cookie}={self._session}; HttpOnly; SameSite=Strict; Path=/"
        await _answer(send, 200, _ENTRANCE, "text/html", ("set-cookie", cookie))


def _headers(scope: Scope) -> dict[str, str]:
    return {name.decode("latin-1"): v.decode("latin-1") for name, v in scope["headers"]}


def _equal(one: str, other: str) -> bool:
    """Compares two secrets in constant time."""
    return hmac.compare_digest(one.encode("utf-8", "replace"), other.encode())


async def _answer(
    send: Send, status: int, text: str, kind: str, *more: tuple[str, str]
) -> None:
    headers = [(b"content-type", f"{kind}; charset=utf-8".encode()), *_HEADERS]
    headers += [(name.encode(), value.encode()) for name, value in more]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": text.encode()})
