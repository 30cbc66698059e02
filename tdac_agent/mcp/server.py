"""The protocol: answers requests by a session, one request at a time."""

from __future__ import annotations

import asyncio
import importlib.metadata
import sys
import time
import traceback
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from mcp.server import Server, ServerRequestContext
from mcp_types import (
    CallToolRequestParams,
    CallToolResult,
    ListToolsResult,
    PaginatedRequestParams,
)
from pydantic import ValidationError

from tdac_agent.errors import Fault
from tdac_agent.mcp.answers import Refused
from tdac_agent.mcp.session import Session
from tdac_agent.mcp.tools import BY_NAME, TOOLS, ToolSpec, problem
from tdac_agent.mcp.watch import Step, Stopped
from tdac_envs.core.errors import TdacError, hint, one_line_reason

Context = ServerRequestContext[dict[str, Any]]
T = TypeVar("T")
BETWEEN_STEPS = 1.0
"""Least time between two notifications of progress, s."""
PATIENCE = 20.0
"""Time that a request for information waits for what an earlier server left, s."""
INSTRUCTIONS = (
    "Write a robot controller: call read_task first, then submit controllers until one "
    "is good enough, then choose it."
)

UNFINISHED = (
    "an earlier server was ended while it judged; that is being finished first, which "
    "may take minutes: ask again in a minute"
)


class Counter:
    """Serves agents in a session: a single thread does all work, in order of arrival.

    Judging takes long, so the thread of the protocol stays free. A request that its
    client gives up is finished nevertheless if it has begun.

    Args:
        session: The session.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._thread = ThreadPoolExecutor(1, "tdac-mcp")
        # What an earlier server left unfinished comes first.
        self._caught_up = self._thread.submit(_answered, session.catch_up)

    def server(self) -> Server[dict[str, Any]]:
        """The server, for any transport."""
        return Server(
            "tdac",
            version=importlib.metadata.version("tdac"),
            title="tdac",
            instructions=INSTRUCTIONS,
            on_list_tools=self._list,
            on_call_tool=self._call,
        )

    def close(self) -> None:
        """Stops the present work, refuses the rest, and closes the session."""
        self._session.watch.stop()
        self._thread.shutdown(cancel_futures=True)
        self._session.close()

    async def _list(
        self, context: Context, parameters: PaginatedRequestParams | None
    ) -> ListToolsResult:
        del context, parameters
        return ListToolsResult(tools=[tool.declared() for tool in TOOLS])

    async def _call(
        self, context: Context, parameters: CallToolRequestParams
    ) -> CallToolResult:
        tool = BY_NAME.get(parameters.name)
        if tool is None:
            known = ", ".join(BY_NAME)
            meant = hint(parameters.name[:80], BY_NAME)
            name = parameters.name[:80]
            return problem(f"there is no tool {name!r}{meant}; the tools are {known}")
        try:
            arguments = tool.arguments.model_validate(parameters.arguments or {})
        except ValidationError as error:
            return problem(f"{tool.name}: {one_line_reason(error, tool.arguments)}")
        if tool.reads:
            left = asyncio.wrap_future(self._caught_up)
            done, _ = await asyncio.wait([left], timeout=PATIENCE)
            if not done:
                return problem(UNFINISHED)
        client, on_step = _client_of(context), _reporter(context)

        def work() -> CallToolResult:
            return self._work(tool, arguments, client, on_step)

        future = self._thread.submit(_answered, work)
        return await asyncio.wrap_future(future)

    def _work(
        self,
        tool: ToolSpec,
        arguments: Any,
        client: str,
        on_step: Callable[[Step], None],
    ) -> CallToolResult:
        self._session.watch.begin(on_step)
        try:
            self._session.catch_up()
            self._session.met(client)
            return tool.work(self._session, arguments, client)
        finally:
            self._session.watch.begin(None)


def _answered(work: Callable[[], T]) -> T | CallToolResult:
    """The result of some work, or a line on why there is none."""
    try:
        return work()
    except Exception as error:
        return problem(_line(error))


def _line(error: Exception) -> str:
    """What a client is told of an error; only a bug has a traceback, on stderr."""
    if isinstance(error, Refused):
        return str(error)
    if isinstance(error, Stopped):
        return "the server is being ended; start it again to go on"
    if isinstance(error, Fault):
        return f"infrastructure fault, no verdict: {error}"
    if isinstance(error, TdacError):
        return " ".join(str(error).split())
    if isinstance(error, OSError):
        return f"infrastructure fault, no verdict: {error.strerror}: {error.filename}"
    traceback.print_exception(error, file=sys.stderr)
    return "internal error of the server; its stderr has the details"


def _client_of(context: Context) -> str:
    """Name and version of the agent's program, as it reports them."""
    parameters = context.session.client_params
    if parameters is None:
        return "unnamed"
    return f"{parameters.client_info.name} {parameters.client_info.version}"


def _reporter(context: Context) -> Callable[[Step], None]:
    """Returns a function that tells the client, from another thread, of a step."""
    loop, last = asyncio.get_running_loop(), -BETWEEN_STEPS

    def report(step: Step) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= BETWEEN_STEPS or step.progress == step.total:
            last = now
            telling = context.session.report_progress(
                step.progress, step.total, step.message
            )
            asyncio.run_coroutine_threadsafe(telling, loop)

    return report
