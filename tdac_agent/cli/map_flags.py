"""The commands `tdac map` and `tdac world`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Optional

import typer

from tdac_agent.cli.options import (
    MAP_FILE,
    WORLD_FILE,
    FrameOption,
    Goal,
    Heading,
    Json,
    Metres,
    Polarity,
    Radius,
    Snap,
    Start,
    Threshold,
    dir_flag,
    file_flag,
    number_flag,
)

app = typer.Typer()


@app.command("map", epilog="Example: `tdac map plan.png --start 90 302 --goal 178 386`")
def map_command(
    image: Annotated[str, typer.Argument(help=f"{MAP_FILE}, or bundled map.")],
    start: Start = None,
    goal: Goal = None,
    heading: Heading = None,
    robot_radius: Radius = None,
    snap: Snap = False,
    frame: FrameOption = None,
    metres: Metres = False,
    polarity: Polarity = None,
    threshold: Threshold = None,
    preset: Annotated[
        Literal["default", "paper"],
        typer.Option(help="Parameter search: the default one, or the paper's."),
    ] = "default",
    out: Annotated[
        Optional[Path],  # noqa: UP045 - typer reads it at run time
        dir_flag("--out", help="Output folder.  [default: NAME-map]"),
    ] = None,
    ros: Annotated[
        bool,
        typer.Option(
            "--yaml", help="Also write the grid as a ROS map: map.yaml and map.pgm."
        ),
    ] = False,
    resolution: Annotated[
        Optional[float],  # noqa: UP045
        number_flag(
            "--resolution", help="Metres per pixel of --yaml, if the file gives none."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Turn a map image into an occupancy grid, with a preview.

    The preview has rulers, in pixels or metres, to read off start and goal.
    """
    from tdac_agent.cli import maps
    from tdac_agent.cli.flags import frame_of
    from tdac_envs.mapping.params import ReadingOptions

    said = ReadingOptions(polarity, threshold)
    task = maps.MapTask(start, goal, heading, robot_radius)
    back = maps.RosMap(ros, resolution)
    chosen = frame_of(frame, metres)
    maps.run(image, task, snap, chosen, said, preset, out, back, as_json)


@app.command("world", epilog="Example: `tdac world maze.wbt --png maze.png`")
def world_command(
    file: Annotated[
        str, typer.Argument(help=f"{WORLD_FILE} of V6 to R2025a, or bundled world.")
    ],
    png: Annotated[
        Optional[Path],  # noqa: UP045
        file_flag("--png", help="Draw the world from above."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Show the e-pucks, goal, arena and obstacles of a Webots world."""
    from tdac_agent.cli import world

    world.run(file, png, as_json)
