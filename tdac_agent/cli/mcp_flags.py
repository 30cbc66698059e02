"""The command `tdac mcp`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from tdac_agent.cli.options import TaskOption, dir_flag, number_flag

app = typer.Typer()


@app.command(
    epilog="Examples: `claude mcp add tdac -- tdac mcp --set unknown`; "
    "`tdac mcp --task maze --out runs/mine`; `tdac mcp --set lost --http`"
)
def mcp(
    task: TaskOption = None,
    set_name: Annotated[
        Optional[str],  # noqa: UP045 - typer reads it at run time
        typer.Option(
            "--set",
            metavar="NAME",
            help="Task set (`tdac sets`) or set.yaml: submissions drive on worlds of "
            "dev, the chosen one on hidden worlds.",
        ),
    ] = None,
    episodes: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            min=1,
            help="Maximum number of simulated episodes of all submissions together; on "
            "a task, each takes 6.  [default: 128]",
        ),
    ] = None,
    out: Annotated[
        Optional[Path],  # noqa: UP045
        dir_flag(
            "--out",
            help="Run folder; a run in it is continued, with its own task if none is "
            "given.  [default: runs/TASK-N]",
        ),
    ] = None,
    http: Annotated[
        bool,
        typer.Option(
            "--http",
            help="Serve HTTP on 127.0.0.1 instead of stdio. The bearer token is "
            "$TDAC_MCP_TOKEN; without it, one is drawn and printed on stderr.",
        ),
    ] = False,
    port: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            "--port",
            min=0,
            max=65535,
            help="Port of --http; 0 for a free one.  [default: 0]",
        ),
    ] = None,
) -> None:
    """Serve coding agents, which write and submit controllers (MCP).

    An agent starts the command itself and talks to it on stdin and stdout, or reaches
    it by --http. Its submissions are judged in the sandbox and kept as a run.
    """
    from tdac_agent.cli import mcp as command

    command.run(task, set_name, episodes, out, port, http)
