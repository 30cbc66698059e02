"""`tdac mcp`: serves coding agents by the Model Context Protocol."""

from __future__ import annotations

import os
import shutil
import sys
from importlib.util import find_spec
from typing import TYPE_CHECKING

from tdac_agent.cli.mcp_flags import McpOptions
from tdac_agent.cli.task_choice import chosen_problem
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.library.listing import next_folder
from tdac_agent.option_fields import typed_fields
from tdac_agent.runs.run_record import Agent
from tdac_envs.core.errors import TaskError
from tdac_envs.core.extras import install_command

if TYPE_CHECKING:
    from tdac_agent.mcp.session import Session


def run(flags: TaskFlags, options: McpOptions) -> None:
    """Serves until the agent leaves, or a signal.

    Raises:
        TaskError: Flags contradict each other, an extra is missing, or the task or the
            task set cannot be used.
        RunError: The run folder cannot be used.
    """
    if find_spec("mcp") is None:
        raise TaskError(f"the server needs an extra: {install_command('mcp')}")
    from tdac_agent.mcp.gate import given_token
    from tdac_agent.mcp.opening import EPISODES, begun, open_session
    from tdac_agent.mcp.serve import serve_stdio

    out, http = options.out, options.http
    known = begun(out) if out is not None and not typed_fields(flags) else None
    problem = known.problem if known else chosen_problem(flags)
    problem = problem.allowed(options.suite, trust=False)
    most = options.episodes or (known.episodes if known else EPISODES)
    folder = out or next_folder(problem.name)
    agent: Agent = "over HTTP" if http else "unconfined"
    token = given_token() if http else None
    try:
        with open_session(problem, folder, most, agent) as session:
            try:
                if http:
                    _serve_http(session, options.port or 0, token)
                else:
                    serve_stdio(session)
            finally:
                if out is None and not session.submissions:
                    shutil.rmtree(folder)
    except KeyboardInterrupt:
        if http:
            raise
        # The thread that reads stdin would keep the process.
        print("interrupted", file=sys.stderr, flush=True)
        os._exit(130)


def _serve_http(session: Session, port: int, token: str | None) -> None:
    """Serves over HTTP; prints the address, and on stderr a token that was drawn."""
    from tdac_agent.loopback import listen
    from tdac_agent.mcp.gate import drawn_token
    from tdac_agent.mcp.serve import serve_http

    secret = drawn_token() if token is None else token

    def announce(address: str) -> None:
        print(address, flush=True)
        if token is None:
            print(f"bearer token: {secret}", file=sys.stderr, flush=True)

    try:
        opened = listen(port)
    except OSError as error:
        raise TaskError(f"--port {port}: {error.strerror}; give another one") from error
    with opened:
        serve_http(session, opened, secret, announce)
