"""The command `tdac campaign`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Optional

import typer

from tdac_agent.cli.options import (
    BUDGET,
    Json,
    KeyOverHttp,
    Trust,
    dir_flag,
    finite_cost,
    number_flag,
)

app = typer.Typer()


@app.command(
    epilog="Examples: `tdac campaign offline`; `tdac campaign my.yaml --dry-run`; "
    "`tdac campaign my.yaml --workers 8 --max-cost 40`"
)
def campaign(
    config: Annotated[
        str, typer.Argument(help="Campaign YAML file, or name of a bundled campaign.")
    ],
    executor: Annotated[
        Literal["local", "ray"],
        typer.Option(help="Processes on this machine, or tasks on a Ray cluster."),
    ] = "local",
    workers: Annotated[
        Optional[int],  # noqa: UP045 - typer reads it at run time
        number_flag(
            min=1,
            help="Concurrent runs; can exceed the cores if runs wait for models.  "
            "[default: one per core]",
        ),
    ] = None,
    shard: Annotated[
        str,
        typer.Option(
            metavar="I/N",
            help="Carry out only every N-th run, from the I-th on, so that N machines "
            "can share the runs.",
        ),
    ] = "1/1",
    out: Annotated[
        Optional[Path],  # noqa: UP045
        dir_flag("--out", help="Campaign folder.  [default: campaigns/NAME]"),
    ] = None,
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run", help="Print the runs and their maximum cost; start none."
        ),
    ] = False,
    max_cost: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option(
            "--max-cost",
            min=0.0,
            callback=finite_cost,
            metavar="USD",
            help="Cost limit of all runs together.  [default: the file's]",
            rich_help_panel=BUDGET,
        ),
    ] = None,
    max_tokens: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            "--max-tokens",
            min=0,
            help="Token limit of all runs together, input plus output.  "
            "[default: the file's]",
            rich_help_panel=BUDGET,
        ),
    ] = None,
    trust: Trust = False,
    key_over_http: KeyOverHttp = False,
    as_json: Json = False,
) -> None:
    """Carry out all synthesis runs of an experiment, and write their tables.

    The file asks for R runs of each task × learner × optimizer × prompt × setting. The
    same command continues an interrupted campaign; finished runs are not repeated.
    """
    from tdac_agent.cli import campaign as command

    limits = {"max_cost": max_cost, "max_tokens": max_tokens}
    given = {name: value for name, value in limits.items() if value is not None}
    places = (executor, workers, shard, out)
    wanted = command.CampaignCommand(config, given, *places, trust, key_over_http)
    if dry_run:
        from tdac_agent.cli import campaign_dry_run as dry

        raise typer.Exit(dry.run(wanted, as_json))
    raise typer.Exit(command.run(wanted, as_json))
