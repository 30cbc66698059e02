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
    "--task epuck`; `tdac evaluate runs/maze-1 ppo.zip --task maze --out compared`; "
    "`tdac evaluate builtin ppo.zip --set unknown`"
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
        Optional[int],  # noqa: UP045
        number_flag(min=1, help="Episodes per policy and task.  [default: 100]"),
    ] = None,
    seed: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            min=0,
            help="Seed of the episodes, the same for all policies.  [default: 0]",
        ),
    ] = None,
    variation: Annotated[
        Optional[Literal["nominal", "jitter", "mixed", "random"]],  # noqa: UP045
        typer.Option(help=f"{VARIATION}  [default: jitter]"),
    ] = None,
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
            help="Folder for evaluation.json and episodes.csv; on tasks, also for "
            "timing.csv and a picture of all trajectories per task; on a task set, for "
            "the episodes of each policy.",
        ),
    ] = None,
    tier: Tier = "auto",
    as_json: Json = False,
    set_name: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--set",
            metavar="NAME",
            help="Task set (`tdac sets`) or set.yaml, instead of tasks: the same "
            "worlds for all policies.",
            rich_help_panel="Task set",
        ),
    ] = None,
    split: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            metavar="NAME",
            help="dev or test.  [default: test]",
            rich_help_panel="Task set",
        ),
    ] = None,
    worlds: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            "-n",
            "--worlds",
            min=1,
            help="Number of worlds.  [default: 100, or all if there are fewer]",
            rich_help_panel="Task set",
        ),
    ] = None,
) -> None:
    """Compare policies of any kind on the same tasks and seeds, or on a task set."""
    from tdac_agent.cli.set_flags import check_set, task_words

    single = {
        "--task": tasks,
        **task_words(named_task()),
        "--episodes": episodes,
        "--seed": seed,
        "--variation": variation,
    }
    check_set(set_name, {"--split": split, "-n": worlds}, single)
    if set_name is not None:
        from tdac_agent.cli import evaluate_set

        raise typer.Exit(
            evaluate_set.run(
                policies,
                set_name,
                split,
                worlds,
                wrappers,
                csv,
                out,
                tier,
                as_json,
            )
        )
    from tdac_agent.cli import evaluate as command

    raise typer.Exit(
        command.run(
            policies,
            tasks or [],
            named_task(),
            100 if episodes is None else episodes,
            0 if seed is None else seed,
            variation or "jitter",
            wrappers,
            csv,
            out,
            tier,
            as_json,
        )
    )
