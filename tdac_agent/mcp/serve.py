"""Serves a session over stdio, or over HTTP on the loopback interface."""

from __future__ import annotations

import signal
import socket
from collections.abc import Callable, Generator
from contextlib import closing, contextmanager

import anyio
import uvicorn
from mcp.server.stdio import stdio_server

from tdac_agent.loopback import HOST
from tdac_agent.mcp.gate import Gate
from tdac_agent.mcp.server import Counter
from tdac_agent.mcp.session import Session

PATH = "/mcp"
END_SECONDS = 1
"""How long open requests are waited for at the end."""


def serve_stdio(session: Session) -> None:
    """Serves one agent until it closes stdin; stdout belongs to the protocol.

    Raises:
        KeyboardInterrupt: A signal ended it. A thread may still wait for stdin, so that
            the process must be ended by `os._exit`.
    """
    with closing(Counter(session)) as counter, _interrupted_at_once():
        anyio.run(_speak, counter)


async def _speak(counter: Counter) -> None:
    server = counter.server()
    async with stdio_server() as (requests, answers):
        await server.run(requests, answers, server.create_initialization_options())


def serve_http(
    session: Session, opened: socket.socket, token: str, announce: Callable[[str], None]
) -> None:
    """Serves agents on the loopback interface until it is interrupted.

    Args:
        session: The session.
        opened: An open port, from `listen`.
        token: The bearer token that each request must have.
        announce: Called with the address.
    """
    with closing(Counter(session)) as counter:
        port = opened.getsockname()[1]
        application = counter.server().streamable_http_app(
            streamable_http_path=PATH, host=HOST
        )
        config = uvicorn.Config(
            Gate(application, port, token),
            log_level="critical",
            access_log=False,
            timeout_graceful_shutdown=END_SECONDS,
        )
        announce(f"http://{HOST}:{port}{PATH}")
        uvicorn.Server(config).run(sockets=[opened])


@contextmanager
def _interrupted_at_once() -> Generator[None]:
    """Signals interrupt the event loop itself.

    asyncio's own handler of SIGINT cancels the main task, which would wait for the
    thread that reads stdin.
    """

    def interrupt(number: int, frame: object) -> None:
        del number, frame
        raise KeyboardInterrupt

    numbers = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
    before = [signal.signal(number, interrupt) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)
