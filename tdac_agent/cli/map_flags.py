"""The commands `tdac map` and `tdac world`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import typer

from tdac_agent.cli.shared_options import json_option, out_option
from tdac_agent.cli.task_flags import MAP_FILE, WORLD_FILE, TaskFlags
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.option_fields import option

app = typer.Typer()
NOT_OF_A_MAP = (
    *("file", "task", "map_image", "world", "ignore", "tolerance", "max_speed"),
    *("rays", "fov", "range_max", "robot_image", "movers", "dt", "instructions"),
    "set_name",
)
"""Flags of a task that `tdac map` does not have."""


@dataclass(frozen=True, slots=True)
class MapOptions:
    """The further flags of `tdac map`."""

    image: str = option(..., f"{MAP_FILE}, or bundled map.", argument=True)
    preset: Literal["default", "paper"] = option(
        "default", "Parameter search: the default one, or the paper's."
    )
    out: Path | None = out_option("Output folder.  [default: NAME-map]")
    ros: bool = option(
        False, "Also write the grid as a ROS map: map.yaml and map.pgm.", "--yaml"
    )
    as_json: bool = json_option()


@app.command("map", epilog="Example: `tdac map plan.png --start 90 302 --goal 178 386`")
@typed_options("maps:run", without=NOT_OF_A_MAP)
def map_command(options: MapOptions, flags: TaskFlags) -> None:
    """Turn a map image into an occupancy grid, with a preview.

    The preview has rulers, in pixels or metres, to read off start and goal.
    """


@dataclass(frozen=True, slots=True)
class WorldOptions:
    """The flags of `tdac world`."""

    file: str = option(
        ..., f"{WORLD_FILE} of V6 to R2025a, or bundled world.", argument=True
    )
    png: Path | None = option(None, "Draw the world from above.", metavar="FILE")
    as_json: bool = json_option()


@app.command("world", epilog="Example: `tdac world maze.wbt --png maze.png`")
@typed_options("world:run")
def world_command(options: WorldOptions) -> None:
    """Show the e-pucks, goal, arena and obstacles of a Webots world."""
