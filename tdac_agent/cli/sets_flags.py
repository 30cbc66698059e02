"""The commands `tdac sets` and `tdac sets show`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Optional

import typer

from tdac_agent.cli.options import Json, file_flag, number_flag

sets_app = typer.Typer(help="List and show task sets: worlds new to a controller.")
app = typer.Typer()
app.add_typer(sets_app, name="sets")


class Split(StrEnum):
    """The splits that can be shown."""

    TRAIN = "train"
    DEV = "dev"
    TEST = "test"


@sets_app.callback(
    invoke_without_command=True,
    epilog="Examples: `tdac sets`; `tdac sets show unknown --index 3 --png world.png`",
)
def sets_command(context: typer.Context, as_json: Json = False) -> None:
    """List task sets, or show the worlds of one."""
    if context.invoked_subcommand is None:
        from tdac_agent.cli import sets

        raise typer.Exit(sets.list_sets(as_json))


@sets_app.command(
    "show",
    epilog="Examples: `tdac sets show lost`; `tdac sets show unknown --index 3`; "
    "`tdac sets show my_set.yaml --sheet worlds.png`",
)
def show_command(
    name: Annotated[
        str, typer.Argument(help="Task set (`tdac sets` lists them), or set.yaml.")
    ],
    split: Annotated[
        Split, typer.Option(metavar="NAME", help="train, dev or test.")
    ] = Split.DEV,
    index: Annotated[
        Optional[int],  # noqa: UP045 - typer reads it at run time
        number_flag(min=0, help="Number of a world to show with its figures."),
    ] = None,
    png: Annotated[
        Path | None,
        file_flag(help="Draw the world of --index, or world 0, to a PNG file."),
    ] = None,
    sheet: Annotated[
        Path | None,
        file_flag(help="Draw 24 worlds, from that of --index on, to a PNG file."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Show a task set, and the figures and pictures of its worlds."""
    from tdac_agent.cli import sets

    raise typer.Exit(sets.show(name, split.value, index, png, sheet, as_json))
