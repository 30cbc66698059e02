"""The commands `tdac bench`, `tdac bench show` and `tdac bench reveal`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Optional

import typer

from tdac_agent.cli.options import Json, Tier, dir_flag, file_flag, number_flag

ExecutorName = Literal["local", "ray"]
bench_app = typer.Typer(
    help="Drive programs and learned policies on the same unseen worlds.",
    no_args_is_help=True,
)
app = typer.Typer()
app.add_typer(bench_app, name="bench")


@bench_app.command(
    "run",
    epilog="Examples: `tdac bench builtin dwa mine.py --set unknown`; `tdac bench "
    "builtin ppo=a.zip,b.zip --set known,crowd --split hidden -n 400 --out arena`",
)
def run_command(
    entrants: Annotated[
        list[str],
        typer.Argument(
            metavar="ENTRANT...",
            help="Controller files, folders of runs and trainings, .zip files of "
            "stable-baselines3, "
            "`builtin`, or a classical planner: `go-to-goal`, `tangent-bug`, "
            "`follow-the-gap`, `dwa`, `mppi`, `orca`; `privileged` is a planner that "
            "knows all movers. NAME=FILE names an entrant; "
            "NAME=FILE,FILE are policies trained alike with several seeds.",
        ),
    ],
    sets: Annotated[
        str,
        typer.Option(
            "--set",
            metavar="NAME,…",
            help="Task sets (`tdac sets`) or set.yaml files, with commas between them.",
        ),
    ],
    split: Annotated[
        str, typer.Option(metavar="NAME", help="dev, test or hidden.")
    ] = "test",
    worlds: Annotated[
        int,
        number_flag("-n", "--worlds", min=1, help="Number of worlds of each set."),
    ] = 100,
    out: Annotated[
        Optional[Path],  # noqa: UP045 - typer reads it at run time
        dir_flag(
            "--out",
            help="Folder for the results; after an interruption, the same command "
            "drives only what is missing.  [default: bench-1, …]",
        ),
    ] = None,
    salt_file: Annotated[
        Optional[Path],  # noqa: UP045
        file_flag(
            "--salt-file",
            help="File with the salt of hidden worlds, which stay sealed until `tdac "
            "bench reveal`.  [default: drawn, and revealed at the end]",
        ),
    ] = None,
    tier: Tier = "auto",
    executor: Annotated[
        Optional[ExecutorName],  # noqa: UP045
        typer.Option(
            help="Drive several files at a time: in processes of this machine (local), "
            "or on the Ray cluster in RAY_ADDRESS, which shares the folder (ray).  "
            "[default: one after another, each on all cores]",
        ),
    ] = None,
    workers: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            "--workers",
            min=1,
            help="Files at a time with --executor.  [default: one per core]",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Drive entrants on the same worlds of task sets, and compare them.

    `tdac bench show DIR...` shows results again, `tdac bench reveal DIR` publishes
    hidden worlds.
    """
    from tdac_agent.cli import bench

    spread = executor, workers
    raise typer.Exit(
        bench.run(entrants, sets, split, worlds, out, salt_file, tier, *spread, as_json)
    )


@bench_app.command(
    "show",
    epilog="Examples: `tdac bench show bench-1`; "
    "`tdac bench show mine theirs --out both`",
)
def show_command(
    folders: Annotated[
        list[Path], typer.Argument(metavar="DIR...", help="Folders with results.")
    ],
    out: Annotated[
        Optional[Path],  # noqa: UP045 - typer reads it at run time
        dir_flag("--out", help="Folder for the tables, figures and page of them all."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Show results again, or those of several folders together."""
    from tdac_agent.cli import bench

    raise typer.Exit(bench.show_folders(folders, out, as_json))


@bench_app.command(
    "reveal", epilog="Example: `tdac bench reveal bench-1 --salt-file my.salt`"
)
def reveal_command(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder with results.")],
    salt_file: Annotated[
        Path, file_flag("--salt-file", help="The salt of its hidden worlds.")
    ],
) -> None:
    """Publish the hidden worlds of a bench: their salt and all episodes."""
    from tdac_agent.cli import bench

    raise typer.Exit(bench.reveal(folder, salt_file))
