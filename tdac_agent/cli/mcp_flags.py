"""The command `tdac mcp`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import typer

from tdac_agent.cli.shared_options import out_option, suite_option
from tdac_agent.cli.task_flags import ONLY_FOR_SYNTH, TaskFlags
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.option_fields import option

app = typer.Typer()


@dataclass(frozen=True, slots=True)
class McpOptions:
    """The further flags of `tdac mcp`."""

    episodes: int | None = option(
        None,
        "Maximum number of simulated episodes of all submissions together; on a task, "
        "each takes 6.  [default: 128]",
        least=1,
    )
    suite: Path | None = suite_option()
    out: Path | None = out_option(
        "Run folder; a run in it is continued, with its own task if none is named.  "
        "[default: runs/TASK-N]"
    )
    http: bool = option(
        False,
        "Serve HTTP on 127.0.0.1 instead of stdio. The bearer token is "
        "$TDAC_MCP_TOKEN; without it, one is drawn and printed on stderr.",
    )
    port: int | None = option(
        None,
        "Port of --http; 0 for a free one.  [default: 0]",
        least=0,
        most=65535,
        needs="--http",
    )


@app.command(
    epilog="Examples: `claude mcp add tdac -- tdac mcp --set unknown`; "
    "`tdac mcp --task maze --out runs/mine`; `tdac mcp --set lost --http`"
)
@typed_options("mcp:run", without=ONLY_FOR_SYNTH)
def mcp(flags: TaskFlags, options: McpOptions) -> None:
    """Serve coding agents, which write and submit controllers (MCP).

    An agent starts the command itself and talks to it on stdin and stdout, or reaches
    it by --http. Its submissions are judged in the sandbox and kept as a run. On a task
    set, they drive on worlds of dev, and the chosen one on hidden worlds.
    """
