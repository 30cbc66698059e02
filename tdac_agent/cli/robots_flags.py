"""The commands `tdac robots` and `tdac robots show`."""

from __future__ import annotations

from dataclasses import dataclass

import typer

from tdac_agent.cli.shared_options import Json, json_option
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.option_fields import option

robots_app = typer.Typer(help="List and show robots: body, limits, sensors, sources.")
app = typer.Typer()
app.add_typer(robots_app, name="robots")


@dataclass(frozen=True, slots=True)
class ShowRobotOptions:
    """The flags of `tdac robots show`."""

    name: str = option(
        ..., "Robot (`tdac robots` lists them), or robot file.", argument=True
    )
    as_json: bool = json_option()


@robots_app.callback(
    invoke_without_command=True,
    epilog="Examples: `tdac robots`; `tdac robots show turtlebot3-burger`",
)
@typed_options("robots:list_robots")
def robots_command(context: typer.Context, as_json: Json = False) -> None:
    """List robots, or show the figures of one and their sources."""


@robots_app.command(
    "show",
    epilog="Examples: `tdac robots show jackal`; `tdac robots show my_robot.yaml`",
)
@typed_options("robots:show")
def show_command(options: ShowRobotOptions) -> None:
    """Show the figures of a robot, and the source of each of them."""
