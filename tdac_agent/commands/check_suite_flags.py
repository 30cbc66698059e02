"""The command `tdac check-suite`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from tdac_agent.commands.options import (
    Goal,
    Heading,
    Ignore,
    Json,
    MapOption,
    Metres,
    Profile,
    Radius,
    Snap,
    Start,
    TaskOption,
    Tier,
    WorldOption,
    task_flags,
)

app = typer.Typer()


@app.command(
    "check-suite",
    epilog="Example: `tdac check-suite --task office --suite my_tests`",
)
def check_suite(
    task: TaskOption = None,
    map_image: MapOption = None,
    world: WorldOption = None,
    ignore: Ignore = None,
    start: Start = None,
    goal: Goal = None,
    heading: Heading = None,
    robot_radius: Radius = None,
    snap: Snap = False,
    metres: Metres = False,
    suite: Annotated[
        Optional[Path],  # noqa: UP045 - typer reads it at run time
        typer.Option(help="Folder with your own test_*.py files, run as well."),
    ] = None,
    profile: Profile = None,
    tier: Tier = "auto",
    seed: Annotated[int, typer.Option(min=0, help="Of the jittered starts.")] = 0,
    repeats: Annotated[
        int, typer.Option(min=1, help="Verifications of each, which must agree.")
    ] = 5,
    as_json: Json = False,
) -> None:
    """Let a suite prove itself: a reference must pass it, bad controllers must not."""
    from tdac_agent.commands import check_suite as command

    spec = task_flags(
        task, map_image, world, ignore, start, goal, heading, robot_radius, None, snap,
        metres, None,
    )  # fmt: skip
    raise typer.Exit(command.run(spec, profile, suite, tier, seed, repeats, as_json))
