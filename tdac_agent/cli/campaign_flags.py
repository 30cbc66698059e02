"""The command `tdac campaign`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import typer

from tdac_agent.cli.shared_options import (
    BUDGET,
    json_option,
    key_over_http_option,
    out_option,
    trust_option,
)
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.option_fields import option

app = typer.Typer()


@dataclass(frozen=True, slots=True)
class CampaignOptions:
    """The flags of `tdac campaign`."""

    config: str = option(
        ..., "Campaign YAML file, or name of a bundled campaign.", argument=True
    )
    executor: Literal["local", "ray"] = option(
        "local", "Processes on this machine, or tasks on a Ray cluster."
    )
    workers: int | None = option(
        None,
        "Concurrent runs; can exceed the cores if runs wait for models.  [default: one "
        "per core]",
        least=1,
    )
    shard: str = option(
        "1/1",
        "Carry out only every N-th run, from the I-th on, so that N machines can share "
        "the runs.",
        metavar="I/N",
    )
    out: Path | None = out_option("Campaign folder.  [default: campaigns/NAME]")
    dry_run: bool = option(False, "Print the runs and their maximum cost; start none.")
    max_cost: float | None = option(
        None,
        "Cost limit of all runs together.  [default: the file's]",
        least=0,
        metavar="USD",
        panel=BUDGET,
    )
    max_tokens: int | None = option(
        None,
        "Token limit of all runs together, input plus output.  [default: the file's]",
        least=0,
        panel=BUDGET,
    )
    trust: bool = trust_option()
    key_over_http: bool = key_over_http_option()
    as_json: bool = json_option()


@app.command(
    epilog="Examples: `tdac campaign offline`; `tdac campaign my.yaml --dry-run`; "
    "`tdac campaign my.yaml --workers 8 --max-cost 40`"
)
@typed_options("campaign:run")
def campaign(options: CampaignOptions) -> None:
    """Carry out all synthesis runs of an experiment, and write their tables.

    The file asks for R runs of each task × learner × optimizer × prompt × setting. The
    same command continues an interrupted campaign; finished runs are not repeated.
    """
