"""Relaxes the requirements on a world in which a Webots controller runs."""

from __future__ import annotations

import math
from dataclasses import replace

from tdac_envs.core.errors import TaskError
from tdac_envs.epuck.ground import Ground
from tdac_envs.epuck.paths import check_body_fits, route
from tdac_envs.epuck.task import TOLERANCE
from tdac_envs.worlds.bodies import BODY_RADIUS
from tdac_envs.worlds.world import Unmodelled, World

_BEYOND = 0.5
"""Distance from the arena's wall beyond which a node counts as out of reach, m."""
_OVERLAP = 0.003
"""Largest overlap with an obstacle that moving the robot corrects, m."""
_ROOM, _TURNS = 1e-4, 32


def without_far_nodes(world: World) -> tuple[World, tuple[str, ...]]:
    """Removes unmodelled nodes that the robot cannot reach.

    These are the nodes whose origin is well outside the walls of the arena in which
    the robot stands.

    Returns:
        The world without these nodes, and notes that name them.
    """
    far = [n for n in world.unmodelled if n.may_be_solid and _is_far(world, n)]
    if not far:
        return world, ()
    kept = tuple(node for node in world.unmodelled if node not in far)
    names = ", ".join(dict.fromkeys(node.name or node.kind for node in far))
    note = f"not modelled, but outside the arena's walls: {names}"
    return replace(world, unmodelled=kept), (note,)


def _is_far(world: World, node: Unmodelled) -> bool:
    arena = world.arena
    if arena is None or not world.robots:
        return False
    robot = world.robot
    if not arena.inside.contains(robot.x, robot.y):
        return False
    left, low, right, high = arena.inside.bounds
    margin = arena.wall_thickness + _BEYOND
    return not (
        left - margin < node.x < right + margin
        and low - margin < node.y < high + margin
    )


def beside_obstacles(world: World) -> tuple[World, tuple[str, ...]]:
    """Moves a robot that overlaps an obstacle by a few mm to the nearest free place.

    Returns:
        The world, and a note if the robot was moved.
    """
    robot, ground = world.robot, Ground.of(world)
    missing = BODY_RADIUS - ground.gap(robot.x, robot.y)
    if not 0.0 < missing <= _OVERLAP:
        return world, ()
    for step in range(1, 25):
        away = missing + step * _ROOM * 2.0
        for turn in range(_TURNS):
            angle = 2.0 * math.pi * turn / _TURNS
            x = robot.x + away * math.cos(angle)
            y = robot.y + away * math.sin(angle)
            if ground.gap(x, y) >= BODY_RADIUS + _ROOM:
                moved = replace(world, robots=(replace(robot, x=x, y=y),))
                moved = replace(moved, robots=(*moved.robots, *world.robots[1:]))
                note = (
                    f"the robot starts {1e3 * away:.1f} mm from its place in the "
                    f"file, where it overlaps an obstacle by {1e3 * missing:.1f} mm"
                )
                return moved, (note,)
    return world, ()


def why_unreachable(world: World) -> str | None:
    """Why the goal cannot be used: no path, or the robot is at it; None if it can."""
    assert world.goal is not None
    robot, ground = world.robot, Ground.of(world)
    try:
        check_body_fits(ground, "goal", *world.goal)
        check_body_fits(ground, "start", robot.x, robot.y)
        route(ground, (robot.x, robot.y), world.goal)
    except TaskError as error:
        return str(error)
    if math.dist((robot.x, robot.y), world.goal) <= TOLERANCE:
        return "the robot starts at the goal"
    return None
