"""Modified copies of a world, which a controller cannot have memorised."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from tdac_agent.environments.epuck.moved_world import Motion, reordered, turned_groups
from tdac_agent.environments.epuck.oracle import WorldCase, gap_to, prisms_of
from tdac_agent.tasks.units import Point
from tdac_agent.verification.suite.oracle import Oracle
from tdac_envs.worlds.bodies import bodies
from tdac_envs.worlds.footprint import Disc, Polygon, Rectangle, ring
from tdac_envs.worlds.wbt.writer import write_world
from tdac_envs.worlds.world import Obstacle, Part, World

# Angles, in addition to the original one, at which nothing is parallel to an axis.
ANGLES = (2.3, -0.7, 1.1)
_APART, _KEEP_OFF = 0.05, 0.12
_TRIES = 400


class WorldOracle(Oracle):
    """An oracle for grids and worlds."""

    def world_cases(
        self, world: World, random: np.random.Generator | None = None
    ) -> list[WorldCase]:
        """See the function `world_cases`."""
        return world_cases(world, random)


def world_cases(
    world: World, random: np.random.Generator | None = None
) -> list[WorldCase]:
    """Returns a world, and copies: moved, turned, renamed, reordered, with additions.

    Args:
        world: Flat world of a task.
        random: Random number generator for another copy and for sample points.
    """
    cases = [WorldCase("this world", write_world(world), world)]
    if random is not None:
        cases[0] = replace(cases[0], seed=int(random.integers(1 << 32)))
        angle = round(float(random.uniform(-math.pi, math.pi)), 3)
        cases.append(_copy(world, angle, random))
    for number, angle in enumerate(ANGLES):
        cases.append(_copy(world, angle, np.random.default_rng(100 + number)))
    return cases


def _copy(world: World, angle: float, random: np.random.Generator) -> WorldCase:
    shift = random.uniform(-1.5, 1.5, 2).tolist()
    copy = Motion(angle, *shift).world(_renamed(_fuller(world, random)))
    turned = turned_groups(write_world(copy), random.uniform(0.4, 2.4))
    text = reordered(turned, random)
    return WorldCase(f"a copy turned by {angle} rad", text, copy)


def _renamed(world: World) -> World:
    """Renames the robot and everything except the goal."""
    robots = tuple(replace(robot, name="driver") for robot in world.robots)
    things = tuple(
        thing if thing.is_goal else replace(thing, name=f"thing {number}")
        for number, thing in enumerate(world.obstacles)
    )
    return replace(world, robots=robots, obstacles=things)


def _fuller(world: World, random: np.random.Generator) -> World:
    """Adds an obstacle of each kind of shape, away from start and goal."""
    more: list[Obstacle] = []
    for kind, parts in _shapes(random):
        place = _free_place(world, more, parts, random)
        if place is not None:
            moved = Motion(0.0, *place)
            solid = tuple(map(moved.part, parts))
            more.append(Obstacle("", kind, *place, solid=solid, visible=solid))
    return replace(world, obstacles=(*world.obstacles, *more))


def _shapes(random: np.random.Generator) -> Iterator[tuple[str, list[Part]]]:
    """Yields kinds of obstacles, each around the origin."""
    yaw = random.uniform(-1.5, 1.5, 4)
    wide, long = random.uniform(0.06, 0.12, 2)
    corners = np.sort(random.uniform(0.0, 2.0 * math.pi, 9))
    unit = np.column_stack([np.cos(corners), np.sin(corners)])
    high = 0.12
    # This obstacle has several pieces and is not symmetric; it is placed first, while
    # there is room for it.
    ell = Rectangle(0.03, 0.0, 0.0, 0.03, 0.12), Rectangle(-0.02, 0.045, 0.3, 0.1, 0.03)
    yield "WoodenPallet", [Part(piece, 0.0, high) for piece in ell]
    for kind, shape in (
        ("WoodenBox", Rectangle(0.0, 0.0, yaw[0], 2 * long, wide)),
        ("CardboardBox", Rectangle(0.0, 0.0, yaw[1], long, long)),
        ("SolidBox", Rectangle(0.0, 0.0, yaw[2], 0.3, 0.05)),
        ("Wall", Rectangle(0.0, 0.0, yaw[3], 0.25, 0.02)),
        ("OilBarrel", Disc(0.0, 0.0, 0.07)),
        ("Rock", Polygon.around(0.09 * unit)),
    ):
        yield kind, [Part(shape, 0.0, high)]
    pipe = ring(0.0, 0.0, 0.04, 0.09, 8)
    yield "SolidPipe", [Part(piece, 0.0, high) for piece in pipe]


def _free_place(
    world: World,
    more: Iterable[Obstacle],
    parts: Iterable[Part],
    random: np.random.Generator,
) -> Point | None:
    """Returns a place for parts in the arena, away from start, goal and obstacles."""
    reach = float(prisms_of(parts).extent[:, :3].max()) + _APART
    taken = prisms_of(p for t in (*bodies(world), *more) for p in t.solid)
    ends = [world.robot.pose[:2], world.goal or (0.0, 0.0)]
    floors = [arena.inside.bounds for arena in world.arenas]
    left, low, right, high = floors[0] if floors else (-1.0, -1.0, 1.0, 1.0)
    for _ in range(_TRIES):
        x, y = random.uniform((left, low), (right, high)).tolist()
        inside = world.arena is None or world.arena.inside.contains(x, y)
        far = all(math.dist((x, y), end) > reach + _KEEP_OFF for end in ends)
        if inside and far and gap_to(taken, x, y) > 0.5 * reach:
            return x, y
    return None
