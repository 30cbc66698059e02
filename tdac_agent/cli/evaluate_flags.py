"""The command `tdac evaluate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Optional

import typer

from tdac_agent.cli.options import (
    TASK,
    VARIATION,
    WRAPPER,
    Json,
    Tier,
    dir_flag,
    file_flag,
    number_flag,
)
from tdac_agent.cli.task_flags import ONLY_FOR_SYNTH, NamedTask, takes_task

app = typer.Typer()


@app.command(
    epilog="Examples: `tdac evaluate reference builtin go-to-goal --task maze "
    "--task epuck`; `tdac evaluate runs/maze-1 ppo.zip --task maze --out compared`"
)
@takes_task(without=(*ONLY_FOR_SYNTH, "task"))
def evaluate(
    policies: Annotated[
        list[str],
        typer.Argument(
            metavar="POLICY...",
            help="Controller files, run folders, .zip files of stable-baselines3, "
            "`reference`, `builtin`, `follow-guidance`, `go-to-goal`, `random`.",
        ),
    ],
    tasks: Annotated[
        Optional[list[str]],  # noqa: UP045 - typer reads it at run time
        typer.Option(
            "--task", metavar="PATH", help=f"{TASK}; repeatable.  [default: maze]"
        ),
    ] = None,
    *,
    named_task: NamedTask,
    episodes: Annotated[
        int, number_flag(min=1, help="Episodes per policy and task.")
    ] = 100,
    seed: Annotated[
        int, number_flag(min=0, help="Seed of the episodes, the same for all policies.")
    ] = 0,
    variation: Annotated[
        Literal["nominal", "jitter", "mixed", "random"], typer.Option(help=VARIATION)
    ] = "jitter",
    wrappers: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            "--wrapper",
            metavar="NAME",
            help=f"{WRAPPER}  [default: as the .zip file records]",
        ),
    ] = None,
    csv: Annotated[
        Optional[Path],  # noqa: UP045
        file_flag("--csv", help="Write a CSV row per episode."),
    ] = None,
    out: Annotated[
        Optional[Path],  # noqa: UP045
        dir_flag(
            "--out",
            help="Folder for evaluation.json, episodes.csv, timing.csv and, per task, "
            "a picture of all trajectories.",
        ),
    ] = None,
    tier: Tier = "auto",
    as_json: Json = False,
) -> None:
    """Compare policies of any kind on the same tasks and seeds."""
    from tdac_agent.cli import evaluate as command

    raise typer.Exit(
        command.run(
            policies,
            tasks or [],
            named_task(),
            episodes,
            seed,
            variation,
            wrappers,
            csv,
            out,
            tier,
            as_json,
        )
    )
