"""The commands `tdac bench`, `tdac bench show` and `tdac bench reveal`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import typer

from tdac_agent.cli.shared_options import (
    json_option,
    out_option,
    physics_option,
    tier_option,
)
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.option_fields import option
from tdac_agent.planners.names import planner_list
from tdac_agent.synthesis.options import Engine

bench_app = typer.Typer(
    help="Drive programs and learned policies on the same unseen worlds.",
    no_args_is_help=True,
)
app = typer.Typer()
app.add_typer(bench_app, name="bench")


@dataclass(frozen=True, slots=True)
class BenchOptions:
    """The flags of `tdac bench run`."""

    entrants: tuple[str, ...] = option(
        ...,
        "Controller files, folders of runs and trainings, .zip files of "
        "stable-baselines3, `builtin`, or a classical planner: "
        f"{planner_list()}; `privileged` is a "
        "planner that knows all movers. NAME=FILE names an entrant; NAME=FILE,FILE are "
        "policies trained alike with several seeds.",
        argument=True,
        metavar="ENTRANT...",
    )
    sets: str = option(
        "",
        "Task sets (`tdac sets`) or set.yaml files, with commas between them.",
        "--set",
        metavar="NAME,…",
    )
    tasks: str = option(
        "",
        "Tasks by name or folder, with commas between them: from jittered starts.",
        "--task",
        metavar="NAME,…",
    )
    split: str = option("test", "dev, test or hidden.", metavar="NAME")
    worlds: int = option(
        100,
        "Number of worlds of each set, and of starts of each task.",
        "-n",
        "--worlds",
        least=1,
    )
    out: Path | None = out_option(
        "Folder for the results; after an interruption, the same command drives only "
        "what is missing.  [default: runs/bench-1, …]"
    )
    salt_file: Path | None = option(
        None,
        "File with the salt of hidden worlds, which stay sealed until `tdac bench "
        "reveal`.  [default: drawn, and revealed at the end]",
        metavar="FILE",
    )
    physics: Engine = physics_option()
    tier: str = tier_option()
    executor: Literal["local", "ray"] | None = option(
        None,
        "Drive several files at a time: in processes of this machine (local), or on "
        "the Ray cluster in RAY_ADDRESS, which shares the folder (ray).  [default: one "
        "after another, each on all cores]",
    )
    workers: int | None = option(
        None,
        "Files at a time with --executor.  [default: one per core]",
        least=1,
        needs="--executor local or --executor ray",
    )
    as_json: bool = json_option()


@bench_app.command(
    "run",
    epilog="Examples: `tdac bench builtin dwa mine.py --set unknown`; `tdac bench "
    "builtin ppo=a.zip,b.zip --set known,crowd --split hidden -n 400 --out arena`",
)
@typed_options("bench:run")
def run_command(options: BenchOptions) -> None:
    """Drive entrants on the same worlds of task sets, or on tasks, and compare them.

    For a ranking to publish: several sets, hidden worlds, seeds of a training, figures.
    To compare a few policies while you work, use `tdac evaluate`.
    `tdac bench show DIR...` shows results again, `tdac bench reveal DIR` publishes
    hidden worlds.
    """


@dataclass(frozen=True, slots=True)
class ShowOptions:
    """The flags of `tdac bench show`."""

    folders: tuple[Path, ...] = option(
        ..., "Folders with results.", argument=True, metavar="DIR..."
    )
    out: Path | None = out_option(
        "Folder for the tables, figures and page of them all."
    )
    as_json: bool = json_option()


@bench_app.command(
    "show",
    epilog="Examples: `tdac bench show runs/bench-1`; "
    "`tdac bench show mine theirs --out both`",
)
@typed_options("bench:show_folders")
def show_command(options: ShowOptions) -> None:
    """Show results again, or those of several folders together."""


@dataclass(frozen=True, slots=True)
class RevealOptions:
    """The flags of `tdac bench reveal`."""

    folder: Path = option(..., "Folder with results.", argument=True, metavar="DIR")
    salt_file: Path = option(..., "The salt of its hidden worlds.", metavar="FILE")


@bench_app.command(
    "reveal", epilog="Example: `tdac bench reveal runs/bench-1 --salt-file my.hex`"
)
@typed_options("bench:reveal")
def reveal_command(options: RevealOptions) -> None:
    """Publish the hidden worlds of a bench: their salt and all episodes."""
