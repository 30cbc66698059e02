"""The commands `tdac sets` and `tdac sets show`."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import typer

from tdac_agent.cli.shared_options import Json, json_option
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.option_fields import option

sets_app = typer.Typer(help="List and show task sets: worlds new to a controller.")
app = typer.Typer()
app.add_typer(sets_app, name="sets")


class Split(StrEnum):
    """The splits that can be shown."""

    TRAIN = "train"
    DEV = "dev"
    TEST = "test"


@dataclass(frozen=True, slots=True)
class ShowSetOptions:
    """The flags of `tdac sets show`."""

    name: str = option(
        ..., "Task set (`tdac sets` lists them), or set.yaml.", argument=True
    )
    split: Split = option(Split.DEV, "train, dev or test.", metavar="NAME")
    index: int | None = option(
        None, "Number of a world to show with its figures.", least=0
    )
    png: Path | None = option(
        None, "Draw the world of --index, or world 0, to a PNG file.", metavar="FILE"
    )
    sheet: Path | None = option(
        None, "Draw 24 worlds, from that of --index on, to a PNG file.", metavar="FILE"
    )
    as_json: bool = json_option()


@sets_app.callback(
    invoke_without_command=True,
    epilog="Examples: `tdac sets`; `tdac sets show unknown --index 3 --png world.png`",
)
@typed_options("sets:list_sets")
def sets_command(context: typer.Context, as_json: Json = False) -> None:
    """List task sets, or show the worlds of one."""


@sets_app.command(
    "show",
    epilog="Examples: `tdac sets show lost`; `tdac sets show unknown --index 3`; "
    "`tdac sets show my_set.yaml --sheet worlds.png`. The lengths of --json are in its "
    "`unit`: px on maps, also for a set in metres (its `resolution` converts), else m.",
)
@typed_options("sets:show")
def show_command(options: ShowSetOptions) -> None:
    """Show a task set, and the figures and pictures of its worlds."""
