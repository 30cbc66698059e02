"""The arguments of `Map2DEnv` that a named robot gives, and those typed beside it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tdac_envs.core.errors import TaskError
from tdac_envs.grid.map_units import MapUnits
from tdac_envs.robots.bundled import load_robot
from tdac_envs.robots.robot_file import RobotFile

RobotSource = str | Path | None
LENGTHS = (
    *("robot_radius", "axle_length", "max_wheel_speed", "range_max", "range_min"),
    *("max_speed", "max_acceleration", "stopping_distance", "pose_noise"),
)
"""Arguments that a robot file gives as lengths, per second or per second squared."""
RAYS = "ray_angles", "n_rays", "field_of_view"


def with_robot(
    robot: RobotSource,
    disturbed: bool,
    metric: MapUnits | None,
    in_metres: bool,
    typed: dict[str, Any],
) -> dict[str, Any]:
    """The arguments of an environment: those of a robot, and those typed instead.

    Args:
        robot: Bundled name or path of a robot file; None for no robot.
        disturbed: Whether the robot's own disturbances are on.
        metric: Metres of the map; None for a map without a resolution.
        in_metres: Whether arguments are in metres.
        typed: Arguments; None for those that are not typed.

    Raises:
        TaskError: There is no such robot, or its units are not those of the map.
    """
    if robot is None:
        return typed
    file = load_robot(robot)
    own = options_of(file, metric, in_metres, disturbed=disturbed)
    given = {name: value for name, value in typed.items() if value is not None}
    if any(name in given for name in RAYS):  # another scanner
        own = {name: value for name, value in own.items() if name not in RAYS}
    return {**typed, **own, **given}


def options_of(
    file: RobotFile, metric: MapUnits | None, in_metres: bool, *, disturbed: bool
) -> dict[str, Any]:
    """A robot's arguments in the units of an environment; see `with_robot`.

    Raises:
        TaskError: The robot drives in Webots worlds, or its units are not those of the
            map.
    """
    if file.drives != "disc":
        raise TaskError(
            f"robot: {file.name} drives in Webots worlds, not on maps (TDAC-EPuck-v0)"
        )
    own = {name: value for name, value in file.options().items() if value is not None}
    if disturbed:
        own |= file.disturbances()
    if file.units == "pixels":
        if in_metres:
            raise TaskError(
                f"robot: {file.name} is in pixels, and the task in metres: leave out "
                "the metres, or give a robot in metres (`tdac robots`)"
            )
        return _clockwise(own)
    if metric is None:
        raise TaskError(
            f"robot: {file.name} is in metres, and the map has no resolution: give a "
            "map with one (map.yaml, `resolution`), or a robot in pixels"
        )
    if in_metres:
        return own
    lengths = {n: metric.length_in_pixels(own[n]) for n in LENGTHS if n in own}
    return _clockwise({**own, **lengths}, metric)


def _clockwise(own: dict[str, Any], metric: MapUnits | None = None) -> dict[str, Any]:
    """The same where y points down: angles are clockwise, places to the right."""
    turned = dict(own)
    angles: Sequence[float] | None = own.get("ray_angles")
    if angles is not None:
        turned["ray_angles"] = tuple(0.0 - angle for angle in angles)
    if "scanner_offset" in own:
        scale = 1.0 if metric is None else metric.length_in_pixels(1.0)
        ahead, left = own["scanner_offset"]
        turned["scanner_offset"] = (ahead * scale, 0.0 - left * scale)
    return turned
