"""Lets only requests in that have the bearer token, and come from no foreign page."""

from __future__ import annotations

import os
import secrets

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
from tdac_envs.core.errors import TaskError

VARIABLE = "TDAC_MCP_TOKEN"
"""Environment variable with the bearer token."""
LEAST = 16
"""Least length of a token."""
_NOT_HERE = "The host or the origin of this request is not this server."
_NO_TOKEN = f"Give the header Authorization: Bearer TOKEN, see {VARIABLE}."


class Gate:
    """An ASGI application in front of another one.

    Args:
        app: The application.
        port: Port on which it is reached.
        token: The bearer token.
    """

    def __init__(self, app: App, port: int, token: str) -> None:
        self._app, self._address, self._token = app, LocalAddress(port), token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes a request on, or refuses it; see the ASGI specification."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await receive()  # the handshake
            await send({"type": "websocket.close", "code": 1008})
        # Programs send no origin, pages do.
        elif not self._address.is_local(headers_of(scope), without_origin=True):
            await answer(send, 403, _NOT_HERE, "text/plain")
        elif not self._has_token(headers_of(scope)):
            challenge = "www-authenticate", "Bearer"
            await answer(send, 401, _NO_TOKEN, "text/plain", challenge)
        else:
            await self._app(scope, receive, send)

    def _has_token(self, headers: dict[str, str]) -> bool:
        kind, _, given = headers.get("authorization", "").partition(" ")
        return kind.lower() == "bearer" and equal(given.strip(), self._token)


def given_token() -> str | None:
    """The token in the environment; None if there is none.

    Raises:
        TaskError: It cannot be used.
    """
    token = os.environ.get(VARIABLE, "").strip()
    if not token:
        return None
    if len(token) < LEAST or not token.isascii() or not token.isprintable():
        raise TaskError(
            f"{VARIABLE}: expected at least {LEAST} printable ASCII characters"
        )
    return token


def drawn_token() -> str:
    """A new token."""
    return secrets.token_urlsafe(24)
