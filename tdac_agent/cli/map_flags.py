"""The commands `tdac map` and `tdac world`: what is in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Optional

import typer

from tdac_agent.cli.options import (
    Goal,
    Json,
    Metres,
    Polarity,
    Radius,
    Snap,
    Threshold,
)

app = typer.Typer()


@app.command("map", epilog="Example: `tdac map plan.png --start 90 302 --goal 178 386`")
def map_command(
    image: Annotated[str, typer.Argument(help="Map image or map file.")],
    start: Annotated[
        Optional[tuple[float, float]],  # noqa: UP045 - typer reads it at run time
        typer.Option("--start", metavar="X Y", help="Start, px."),
    ] = None,
    goal: Goal = None,
    robot_radius: Radius = None,
    snap: Snap = False,
    metres: Metres = False,
    polarity: Polarity = None,
    threshold: Threshold = None,
    preset: Annotated[
        Literal["default", "paper"],
        typer.Option(help="`default`, or `paper` for the literal grid search."),
    ] = "default",
    out: Annotated[
        Optional[Path],  # noqa: UP045 - typer reads it at run time
        typer.Option("--out", help="Folder to write.  [default: NAME-map]"),
    ] = None,
    as_json: Json = False,
) -> None:
    """Turn a map image into an occupancy grid, and show how.

    Without start and goal it writes a preview with rulers to read pixels off.
    """
    from tdac_agent.cli import maps
    from tdac_envs.mapping.params import Said

    said = Said(polarity, threshold)
    maps.run(image, start, goal, robot_radius, snap, metres, said, preset, out, as_json)


@app.command("world", epilog="Example: `tdac world maze.wbt --png maze.png`")
def world_command(
    file: Annotated[
        str, typer.Argument(help="Webots world, V6 to R2025a, or a bundled name.")
    ],
    png: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--png", metavar="OUT", help="Draw it from above."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Show what is in a Webots world: e-pucks, goal, arena, obstacles."""
    from tdac_agent.cli import world

    world.run(file, png, as_json)
