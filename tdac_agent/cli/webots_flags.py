"""The commands `tdac webots …` and `tdac export …`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from tdac_agent.cli.options import (
    TASK,
    VIDEO,
    WORLD_FILE,
    Ignore,
    Json,
    Speed,
    Tier,
    dir_flag,
    file_flag,
    number_flag,
)

webots_app = typer.Typer(
    no_args_is_help=True, help="Run Webots controllers in Webots worlds."
)
export_app = typer.Typer(
    no_args_is_help=True,
    help="Export a controller to Webots, or a task to Harbor.",
)
app = typer.Typer()
app.add_typer(webots_app, name="webots")
app.add_typer(export_app, name="export")


@webots_app.command(
    "run", epilog="Example: `tdac webots run my_controller.py maze.wbt --steps 4000`"
)
def webots_run(
    controller: Annotated[Path, typer.Argument(help="Webots controller file.")],
    world: Annotated[str, typer.Argument(help=f"{WORLD_FILE}, or bundled world.")],
    steps: Annotated[
        Optional[int],  # noqa: UP045 - typer reads it at run time
        number_flag(
            min=1,
            help="Maximum steps of the world.  [default: the environment's horizon]",
        ),
    ] = None,
    seconds: Annotated[
        Optional[float],  # noqa: UP045
        number_flag(
            min=1,
            help="CPU time of the controller, s; it may sleep as long.  [default: 10 s "
            "and the simulated time of all steps]",
        ),
    ] = None,
    start: Annotated[
        Optional[tuple[float, float]],  # noqa: UP045
        typer.Option(
            "--start",
            metavar="X Y [YAW]",
            help="Start, m; for YAW, see --heading.  [default: as in the world file]",
        ),
    ] = None,
    heading: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option(metavar="YAW", help="Start heading, rad, from +x towards +y."),
    ] = None,
    goal: Annotated[
        Optional[tuple[float, float]],  # noqa: UP045
        typer.Option(
            "--goal",
            metavar="X Y",
            help="Goal, m.  [default: the world's node GOAL]",
        ),
    ] = None,
    tolerance: Annotated[
        Optional[float],  # noqa: UP045
        number_flag(
            help="Distance at which the goal counts as reached, m.  [default: 0.02]"
        ),
    ] = None,
    ignore: Ignore = None,
    webots_sensors: Annotated[
        bool,
        typer.Option(
            "--webots-sensors",
            help="Sensors with Webots' noise and materials; they also see the goal "
            "marker.",
        ),
    ] = False,
    video: Annotated[
        Optional[Path],  # noqa: UP045
        file_flag(help=f"{VIDEO}."),
    ] = None,
    speed: Speed = None,
    tier: Tier = "auto",
    as_json: Json = False,
) -> None:
    """Run an unmodified Webots controller, judged by the environment.

    Exits with 0 if it reached the goal (if there is one) and touched nothing.
    """
    from tdac_agent.cli import webots

    raise typer.Exit(
        webots.run(
            controller, world, steps, seconds, start, heading, goal, tolerance,
            tuple(ignore or ()), webots_sensors, video, speed, tier, as_json,
        )
    )  # fmt: skip


@export_app.command(
    "webots", epilog="Example: `tdac export webots runs/epuck-1 --out my_project`"
)
def export_webots(
    run: Annotated[Path, typer.Argument(help="Run folder with a verified controller.")],
    out: Annotated[Path, dir_flag(help="Output folder, new or empty.")],
    tier: Tier = "auto",
    as_json: Json = False,
) -> None:
    """Write a Webots project with a verified e-puck controller.

    The controller is unchanged; an adapter supplies its observations. The project is
    then run once by tdac, not by Webots itself.
    """
    from tdac_agent.cli import export

    raise typer.Exit(export.run(run, out, tier, as_json))


@export_app.command(
    "harbor", epilog="Example: `tdac export harbor --set unknown --out my_task`"
)
def export_harbor(
    out: Annotated[Path, dir_flag("--out", help="Task folder, new or empty.")],
    task: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option("--task", metavar="PATH", help=f"{TASK}."),
    ] = None,
    set_name: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--set", metavar="NAME", help="Task set (`tdac sets`) or set.yaml."
        ),
    ] = None,
    worlds: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            "-n",
            min=1,
            max=100_000,
            help="Number of hidden worlds on which a controller drives.  [default: 20]",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write a task or a task set as a task folder of Harbor.

    It has the instruction, the agent's environment, tests that judge with tdac in a
    container of their own, and an oracle. The hidden worlds of a set follow from a salt
    that is drawn now; only the tests have it.
    """
    from tdac_agent.cli import export_harbor

    raise typer.Exit(export_harbor.run(task, set_name, worlds, out, as_json))
