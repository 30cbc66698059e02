"""The command `tdac campaign`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Optional

import typer

from tdac_agent.cli.options import BUDGET, Json, KeyOverHttp, Trust, finite_cost

app = typer.Typer()


@app.command(
    epilog="Examples: `tdac campaign offline`; `tdac campaign my.yaml --dry-run`; "
    "`tdac campaign my.yaml --workers 8 --max-cost 40`"
)
def campaign(
    config: Annotated[
        str,
        typer.Argument(
            metavar="CONFIG", help="A YAML file, or the name of a shipped one."
        ),
    ],
    executor: Annotated[
        Literal["local", "ray"],
        typer.Option(help="Processes of this machine, or tasks of a Ray cluster."),
    ] = "local",
    workers: Annotated[
        Optional[int],  # noqa: UP045 - typer reads it at run time
        typer.Option(
            min=1,
            metavar="N",
            help="Runs at a time; more than cores where they wait for models.  "
            "[default: one a core]",
        ),
    ] = None,
    shard: Annotated[
        str,
        typer.Option(
            metavar="I/N", help="Every N-th run from the I-th: a machine's part."
        ),
    ] = "1/1",
    out: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            "--out", metavar="DIR", help="Its folder.  [default: campaigns/NAME]"
        ),
    ] = None,
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run", help="Print the runs and what they cost at most; makes none."
        ),
    ] = False,
    max_cost: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option(
            "--max-cost",
            min=0.0,
            callback=finite_cost,
            metavar="USD",
            help="Of all runs together.  [default: the file's]",
            rich_help_panel=BUDGET,
        ),
    ] = None,
    max_tokens: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option(
            "--max-tokens",
            min=0,
            metavar="N",
            help="Of all runs together.  [default: the file's]",
            rich_help_panel=BUDGET,
        ),
    ] = None,
    trust: Trust = False,
    key_over_http: KeyOverHttp = False,
    as_json: Json = False,
) -> None:
    """Make many runs: learners × optimizers × tasks × settings × R, and their tables.

    The same command goes on where the last one ended; a finished run is never repeated.
    """
    from tdac_agent.cli import campaign as command

    limits = {"max_cost": max_cost, "max_tokens": max_tokens}
    given = {name: value for name, value in limits.items() if value is not None}
    places = (executor, workers, shard, out)
    wanted = command.Wanted(config, given, *places, trust, key_over_http)
    if dry_run:
        from tdac_agent.cli import campaign_dry_run as dry

        raise typer.Exit(dry.run(wanted, as_json))
    raise typer.Exit(command.run(wanted, as_json))
