"""`tdac robots` and `tdac robots show`: robots, their figures and the sources."""

from __future__ import annotations

from typing import Any

import typer
from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.robots_flags import ShowRobotOptions
from tdac_agent.cli.sentences import print_sentences
from tdac_envs.robots.bundled import bundled_robots, load_robot
from tdac_envs.robots.robot_file import RobotFile

_UNITS = {
    **dict.fromkeys(("radius", "axle_length", "stopping_distance"), "{}"),
    **dict.fromkeys(("limits.max_wheel_speed", "limits.max_speed"), "{}/s"),
    "limits.max_turn_rate": "rad/s",
    "limits.max_acceleration": "{}/s²",
    "limits.max_turn_acceleration": "rad/s²",
    **dict.fromkeys(("scanner.range_min", "scanner.range_max", "pose.noise"), "{}"),
    **dict.fromkeys(("scanner.field_of_view", "scanner.first_angle"), "°"),
    "scanner.offset": "{}",
    **dict.fromkeys(("scanner.rate", "pose.rate", "control_rate"), "Hz"),
    "pose.heading_noise": "rad",
    **dict.fromkeys(("pose.correlation", "pose.latency"), "s"),
    "pose.jumps": "per minute",
}
"""Units of the figures, where they have one; `{}` is that of lengths."""


def list_robots(context: typer.Context, as_json: bool) -> None:
    """Prints the bundled robots, unless one is to be shown."""
    if context.invoked_subcommand is not None:
        return
    robots = [load_robot(name) for name in bundled_robots()]
    if as_json:
        print_json([_record(robot) for robot in robots])
        return
    console, table = Console(), Table(box=SIMPLE, padding=(0, 1, 0, 0))
    for column in ("robot", "drives in", "radius", "full speed", "what it is"):
        table.add_column(column)
    for robot in robots:
        where = "maps" if robot.drives == "disc" else "Webots worlds"
        speed = robot.limits.max_speed or robot.limits.max_wheel_speed
        size = f"{robot.radius:g} {robot.unit}", f"{speed:g} {robot.unit}/s"
        about = escape(robot.description)
        table.add_row(f"[bold]{robot.name}[/]", where, *size, about)
    console.print(table)
    print_sentences(
        console,
        "tdac robots show NAME shows its figures and their sources; tdac synth --map "
        "map.yaml --robot NAME drives it on a map with a resolution",
    )


def show(options: ShowRobotOptions) -> None:
    """Prints the figures of a robot and the source of each.

    Raises:
        TaskError: There is no such robot, or its file is not valid.
    """
    robot = load_robot(options.name)
    if options.as_json:
        print_json(_record(robot))
        return
    console, table = Console(), Table(box=SIMPLE, padding=(0, 1, 0, 0))
    console.print(f"[bold]{robot.name}[/]: {escape(robot.description)}")
    for column in ("figure", "value", "source"):
        table.add_column(column)
    for key, value in robot.figures().items():
        unit = _UNITS.get(key, "").format(robot.unit)
        told = _told(value), unit
        table.add_row(key, " ".join(told).strip(), escape(robot.sources[key]))
    console.print(table)


def _told(value: Any) -> str:
    if isinstance(value, tuple):
        return ", ".join(map(_told, value))
    return f"{value:g}" if isinstance(value, int | float) else escape(str(value))


def _record(robot: RobotFile) -> dict[str, Any]:
    return robot.model_dump(mode="json", by_alias=True, exclude_unset=True)
