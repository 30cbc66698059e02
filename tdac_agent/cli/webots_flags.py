"""The commands `tdac webots …` and `tdac export …`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import typer

from tdac_agent.cli.shared_options import (
    VIDEO,
    json_option,
    speed_option,
    tier_option,
)
from tdac_agent.cli.task_flags import ONLY_FOR_SYNTH, SETS, WORLD_FILE, TaskFlags
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.option_fields import option

webots_app = typer.Typer(
    no_args_is_help=True, help="Run Webots controllers in Webots worlds."
)
export_app = typer.Typer(
    no_args_is_help=True,
    help="Export a controller to Webots or ROS 2, or a task to Harbor.",
)
app = typer.Typer()
app.add_typer(webots_app, name="webots")
app.add_typer(export_app, name="export")


@dataclass(frozen=True, slots=True)
class WebotsOptions:
    """The flags of `tdac webots run`."""

    controller: Path = option(..., "Webots controller file.", argument=True)
    world: str = option(..., f"{WORLD_FILE}, or bundled world.", argument=True)
    steps: int | None = option(
        None,
        "Maximum steps of the world.  [default: the environment's horizon]",
        least=1,
    )
    seconds: float | None = option(
        None,
        "CPU time of the controller, s; it may sleep as long.  [default: 10 s and the "
        "simulated time of all steps]",
        least=1,
    )
    start: tuple[float, float] | None = option(
        None,
        "Start, m; for YAW, see --heading.  [default: as in the world file]",
        metavar="X Y [YAW]",
    )
    heading: float | None = option(
        None,
        "Start heading, rad, from +x towards +y.",
        metavar="YAW",
        needs="--start X Y",
    )
    goal: tuple[float, float] | None = option(
        None, "Goal, m.  [default: the world's node GOAL]", metavar="X Y"
    )
    tolerance: float | None = option(
        None, "Distance at which the goal counts as reached, m.  [default: 0.02]"
    )
    ignore: tuple[str, ...] = option(
        (),
        "Name or type of a world node to ignore although it may be solid; repeatable.",
        metavar="NAME",
    )
    webots_sensors: bool = option(
        False,
        "Sensors with Webots' noise and materials; they also see the goal marker.",
    )
    video: Path | None = option(None, f"{VIDEO}.", metavar="FILE")
    speed: float | None = speed_option()
    tier: str = tier_option()
    as_json: bool = json_option()


@webots_app.command(
    "run", epilog="Example: `tdac webots run my_controller.py maze.wbt --steps 4000`"
)
@typed_options("webots:run")
def webots_run(options: WebotsOptions) -> None:
    """Run an unmodified Webots controller, judged by the environment.

    Exits with 0 if it reached the goal (if there is one) and touched nothing.
    """


@dataclass(frozen=True, slots=True)
class ExportWebotsOptions:
    """The flags of `tdac export webots`."""

    run: Path = option(..., "Run folder with a verified controller.", argument=True)
    out: Path = option(..., "Output folder, new or empty.", metavar="DIR")
    tier: str = tier_option()
    as_json: bool = json_option()


@export_app.command(
    "webots", epilog="Example: `tdac export webots runs/epuck-1 --out my_project`"
)
@typed_options("export:run_webots")
def export_webots(options: ExportWebotsOptions) -> None:
    """Write a Webots project with a verified e-puck controller.

    The controller is unchanged; an adapter supplies its observations. The project is
    then run once by tdac, not by Webots itself.
    """


@dataclass(frozen=True, slots=True)
class ExportRos2Options:
    """The flags of `tdac export ros2`."""

    run: Path = option(..., "Run folder with a verified controller.", argument=True)
    out: Path = option(..., "Package folder, new or empty.", metavar="DIR")
    name: str | None = option(
        None, "Name of the package.  [default: `tdac_` and the task]", metavar="NAME"
    )
    unverified: bool = option(
        False, "Export a controller that is not verified; the package says so."
    )
    as_json: bool = json_option()


@export_app.command(
    "ros2", epilog="Example: `tdac export ros2 runs/depot-1 --out depot_drive`"
)
@typed_options("export:run_ros2")
def export_ros2(options: ExportRos2Options) -> None:
    """Write a ROS 2 package with a verified controller, for a robot on a map in metres.

    The controller is unchanged; the package adds frames, limits and safe stops. `tdac
    ros sim` and `tdac ros drive` drive it over DDS, without ROS.
    """


@dataclass(frozen=True, slots=True)
class ExportHarborOptions:
    """The flags of `tdac export harbor`."""

    out: Path = option(..., "Task folder, new or empty.", metavar="DIR")
    worlds: int | None = option(
        None,
        "Number of hidden worlds on which a controller drives.  [default: 20]",
        "-n",
        "--worlds",
        least=1,
        most=100_000,
        panel=SETS,
        scope="set",
    )
    as_json: bool = json_option()


@export_app.command(
    "harbor", epilog="Example: `tdac export harbor --set unknown --out my_task`"
)
@typed_options("export:run_harbor", without=ONLY_FOR_SYNTH)
def export_harbor(flags: TaskFlags, options: ExportHarborOptions) -> None:
    """Write a task or a task set as a task folder of Harbor.

    It has the instruction, the agent's environment, tests that judge with tdac in a
    container of their own, and an oracle. The hidden worlds of a set follow from a salt
    that is drawn now; only the tests have it.
    """
