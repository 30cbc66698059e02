"""Loads the world, start and goal of an e-puck task."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from tdac_envs.core.arguments import finite_numbers, finite_point
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.task import Pose
from tdac_envs.worlds.bundled import world_file
from tdac_envs.worlds.wbt.reader import load_world
from tdac_envs.worlds.world import EPuck, World, check_modelled

WorldSource = str | Path | World


def open_world(
    source: WorldSource,
    start: Sequence[float] | None = None,
    goal: Sequence[float] | None = None,
    ignore: Iterable[str] = (),
) -> World:
    """Loads a world and sets the pose of its first e-puck and its goal.

    The file's goal marker never becomes an obstacle, even if `goal` is given.

    Args:
        source: Name of a bundled world, path of a `.wbt` file, or a world.
        start: (x, y) or (x, y, heading), m and rad; by default the file's e-puck.
        goal: (x, y), m; by default the file's goal.
        ignore: Names or types of unmodelled nodes to leave out; see `check_modelled`.

    Raises:
        WorldError: The world cannot be used.
        TaskError: Start or goal is missing or not made of numbers.
    """
    if isinstance(ignore, str):
        raise TaskError(f"expected ignore to be a list of names, got {ignore!r}")
    world = source if isinstance(source, World) else load_world(world_file(source))
    check_modelled(world, ignore)
    if goal is not None:
        world = replace(world, goal=finite_point("goal", goal))
    if world.goal is None:
        raise TaskError(f"{_name(world)} has no goal; give goal=(x, y) in metres")
    if start is None and not world.robots:
        raise TaskError(f"{_name(world)} has no e-puck; give start=(x, y, heading)")
    return world if start is None else with_start(world, start)


def with_start(world: World, start: Sequence[float]) -> World:
    """The world with its first e-puck at (x, y) or (x, y, heading).

    Raises:
        TaskError: `start` is not made of finite numbers.
    """
    there = world.robots[0] if world.robots else EPuck("e-puck", 0.0, 0.0, 0.0)
    given = tuple(start) if isinstance(start, Iterable) else (start,)
    if len(given) == 2:
        given = (*given, there.heading)
    pose = Pose(*finite_numbers("start", given, 3))
    robot = replace(there, x=pose.x, y=pose.y, heading=pose.heading)
    return replace(world, robots=(robot, *world.robots[1:]))


def _name(world: World) -> str:
    return world.source or "the world"
