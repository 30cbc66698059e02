"""The command `tdac evaluate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Optional

import typer

from tdac_agent.cli.options import Json, Tier

app = typer.Typer()


@app.command(
    epilog="Examples: `tdac evaluate reference builtin go-to-goal --task maze "
    "--task epuck`; `tdac evaluate runs/maze-1 ppo.zip --task maze --out compared`"
)
def evaluate(
    policies: Annotated[
        list[str],
        typer.Argument(
            metavar="POLICY...",
            help="controller.py files, run folders, .zip files of stable-baselines3, "
            "`reference`, `builtin`, `follow-guidance`, `go-to-goal`, `random`.",
        ),
    ],
    tasks: Annotated[
        Optional[list[str]],  # noqa: UP045 - typer reads it at run time
        typer.Option(
            "--task",
            help="Bundled name, task.yaml, or run folder; repeatable.  [default: maze]",
        ),
    ] = None,
    episodes: Annotated[
        int, typer.Option(min=1, help="Of each policy on each task.")
    ] = 100,
    seed: Annotated[
        int, typer.Option(min=0, help="Of the episodes, the same for all policies.")
    ] = 0,
    variation: Annotated[
        Literal["nominal", "jitter", "mixed", "random"],
        typer.Option(
            help="Starts: the task's own, within a body radius of it, mixed with "
            "any start, or any start and goal."
        ),
    ] = "jitter",
    wrappers: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            "--wrapper",
            metavar="NAME",
            help="Of a .zip that does not say it, innermost first; repeatable: "
            "`goal-relative`, `guidance`, `flatten`, or `none`.",
        ),
    ] = None,
    csv: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--csv", metavar="FILE", help="Write a row for each episode."),
    ] = None,
    out: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            "--out",
            metavar="DIR",
            help="Write evaluation.json, episodes.csv, timing.csv and, of each task, a "
            "picture with the ways of all policies.",
        ),
    ] = None,
    tier: Tier = "auto",
    as_json: Json = False,
) -> None:
    """Compare policies of any kind: same tasks, same seeds, same judge."""
    from tdac_agent.cli import evaluate as command

    raise typer.Exit(
        command.run(
            policies,
            tasks or ["maze"],
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
