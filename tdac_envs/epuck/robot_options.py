"""The named robot of a world: an e-puck of some version."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from tdac_envs.core.errors import TaskError
from tdac_envs.epuck.kernels import WHEEL_RADIUS
from tdac_envs.robots.bundled import load_robot
from tdac_envs.robots.robot_file import RobotFile
from tdac_envs.worlds.bodies import BODY_RADIUS
from tdac_envs.worlds.world import AXLE_LENGTH, MAX_WHEEL_SPEED, World

RobotSource = str | Path | None
_OWN = {
    *("radius", "axle_length", "limits.max_wheel_speed", "pose.source"),
    *("wheels.slip", "wheels.radius_error", "control_rate", "stopping_distance"),
}
"""Figures of a robot in a world."""
_ROUNDED = 1e-3


def e_puck_of(robot: str | Path) -> RobotFile:
    """The robot file of an e-puck.

    Args:
        robot: Bundled name or path.

    Raises:
        TaskError: There is none, or it is no e-puck as Webots simulates it.
    """
    file = load_robot(robot)
    if file.drives != "e-puck":
        raise TaskError(
            f"robot: {file.name} drives on maps, not in Webots worlds "
            "(TDAC-Map2D-v0); e-puck and e-puck2 drive here"
        )
    version = file.version or "1"
    fixed = {
        "radius": (file.radius, BODY_RADIUS),
        "axle_length": (file.axle_length, AXLE_LENGTH),
        "limits.max_wheel_speed": (
            file.limits.max_wheel_speed,
            MAX_WHEEL_SPEED[version] * WHEEL_RADIUS,
        ),
    }
    for key, (given, own) in fixed.items():
        if not math.isclose(given, own, rel_tol=_ROUNDED):
            raise TaskError(
                f"robot: {file.name} has {key} {given:g}; an e-puck of version "
                f"{version} has {own:g}"
            )
    for key, figure in file.figures().items():
        if key not in _OWN and not key.startswith("body.") and figure:
            raise TaskError(
                f"robot: {file.name} has {key}, which only robots on maps have: "
                "leave it out"
            )
    return file


def with_version(world: World, file: RobotFile) -> World:
    """The world whose first e-puck is that of a robot file: its mass and speed."""
    robot = replace(world.robot, version=file.version or "1")
    return replace(world, robots=(robot, *world.robots[1:]))


def with_robot(
    file: RobotFile | None, given: dict[str, float | None], *, disturbed: bool
) -> dict[str, float]:
    """Arguments of `EPuckEnv`: as given, or else those of a robot, or else 0.

    Args:
        file: From `e_puck_of`; None for no robot.
        given: Arguments; None for those that are not given.
        disturbed: Whether the robot's errors are on.
    """
    own: dict[str, float] = {}
    if file is not None:
        own = {"stopping_distance": file.stopping_distance}
        own |= file.disturbances() if disturbed else {}
    return {
        name: own.get(name, 0.0) if value is None else value
        for name, value in given.items()
    }
