"""The commands `tdac webots …` and `tdac export …`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from tdac_agent.cli.options import Heading, Json, Start, Tier

webots_app = typer.Typer(
    no_args_is_help=True, help="Run Webots controllers in worlds of Webots."
)
export_app = typer.Typer(no_args_is_help=True, help="Take a controller elsewhere.")
app = typer.Typer()
app.add_typer(webots_app, name="webots")
app.add_typer(export_app, name="export")


@webots_app.command(
    "run", epilog="Example: `tdac webots run my_controller.py maze.wbt --steps 4000`"
)
def webots_run(
    controller: Annotated[Path, typer.Argument(help="The controller's file.")],
    world: Annotated[str, typer.Argument(help="A `.wbt` file, or a bundled world.")],
    steps: Annotated[
        Optional[int],  # noqa: UP045 - typer reads it at run time
        typer.Option(
            min=1, help="Steps of the world at most.  [default: as the env's horizon]"
        ),
    ] = None,
    start: Start = None,
    heading: Heading = None,
    goal: Annotated[
        Optional[tuple[float, float]],  # noqa: UP045
        typer.Option("--goal", metavar="X Y", help="m.  [default: the world's GOAL]"),
    ] = None,
    tolerance: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option(help="How near to the goal is there, m.  [default: 0.02]"),
    ] = None,
    ignore: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(help="Name or type of a node that may be missing; repeatable."),
    ] = None,
    webots_sensors: Annotated[
        bool,
        typer.Option(
            "--webots-sensors",
            help="Sensors with Webots' noise and materials; the goal's mark is seen.",
        ),
    ] = False,
    video: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="Write .mp4 or .gif."),
    ] = None,
    tier: Tier = "auto",
    as_json: Json = False,
) -> None:
    """Run a Webots controller as it is, judged by the environment.

    Exit 0: it reached the goal (if there is one) and touched nothing.
    """
    from tdac_agent.cli import webots

    raise typer.Exit(
        webots.run(
            controller, world, steps, start, heading, goal, tolerance,
            tuple(ignore or ()), webots_sensors, video, tier, as_json,
        )
    )  # fmt: skip


@export_app.command(
    "webots", epilog="Example: `tdac export webots runs/epuck-1 --out my_project`"
)
def export_webots(
    run: Annotated[Path, typer.Argument(help="Folder of a verified run.")],
    out: Annotated[Path, typer.Option(help="Folder to write, new or empty.")],
    tier: Tier = "auto",
    as_json: Json = False,
) -> None:
    """Write a Webots project with a verified e-puck controller.

    The controller is not changed; an adapter beside it gives it what it observes. It
    is then driven once here. Nothing is run in Webots itself.
    """
    from tdac_agent.cli import export

    raise typer.Exit(export.run(run, out, tier, as_json))
