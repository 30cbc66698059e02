"""Servers for this machine alone: their sockets, and whose requests they answer.

A page of another site, or another user of this machine, can reach a port of the
loopback interface. So a server checks the host of each request (no DNS rebinding), its
origin, and a secret.
"""

from __future__ import annotations

import hmac
import socket
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]
"""An ASGI application; see the ASGI specification."""

HOST = "127.0.0.1"
HOSTS = HOST, "localhost"
SAFE_HEADERS = (
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"SAMEORIGIN"),
    (b"cache-control", b"no-store"),
)


def listen(port: int) -> socket.socket:
    """Opens a port of the loopback interface; 0 for a free one.

    Raises:
        OSError: It cannot be opened.
    """
    opened = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        opened.bind((HOST, port))
    except OSError:
        opened.close()
        raise
    opened.listen(64)
    return opened


class LocalAddress:
    """The names under which a port of this machine is reached.

    Args:
        port: The port.
    """

    def __init__(self, port: int) -> None:
        self._hosts = {f"{host}:{port}" for host in HOSTS}
        self._origins = {f"http://{host}" for host in self._hosts}

    def is_local(self, headers: dict[str, str], *, without_origin: bool) -> bool:
        """Whether the host, and the origin if there is one, are those of this server.

        Args:
            headers: Headers of the request.
            without_origin: Whether a request may have no origin.
        """
        if headers.get("host") not in self._hosts:
            return False
        origin = headers.get("origin")
        return origin in self._origins or (without_origin and origin is None)


def headers_of(scope: Scope) -> dict[str, str]:
    """The headers of a request, by lower-case name."""
    return {name.decode("latin-1"): v.decode("latin-1") for name, v in scope["headers"]}


def equal(given: str, secret: str) -> bool:
    """Compares a given text with a secret in constant time."""
    return hmac.compare_digest(given.encode("utf-8", "replace"), secret.encode())


async def answer(
    send: Send, status: int, text: str, kind: str, *more: tuple[str, str]
) -> None:
    """Sends a whole answer.

    Args:
        send: Sends to the client.
        status: HTTP status.
        text: The body.
        kind: Its media type, without the character set.
        *more: Names and values of further headers.
    """
    headers = [(b"content-type", f"{kind}; charset=utf-8".encode()), *SAFE_HEADERS]
    headers += [(name.encode(), value.encode()) for name, value in more]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": text.encode()})
