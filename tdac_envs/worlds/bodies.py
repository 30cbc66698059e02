"""Everything that an e-puck can hit in a world, and the ground under it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from tdac_envs.worlds.footprint import Disc
from tdac_envs.worlds.materials import MATERIAL
from tdac_envs.worlds.world import EPuck, Obstacle, Part, World

BODY_RADIUS = 0.037
BODY_BOTTOM, BODY_TOP = 0.0025, 0.0475
"""Lowest and highest point of an e-puck's body above the ground, m."""

_MAX_RISE = 0.01
"""Maximum height of the ground above the robot's origin, m."""
_NEAR = 0.005
"""Largest gap at which an obstacle still rests on what is below it, m."""


def bodies(world: World) -> tuple[Obstacle, ...]:
    """The obstacles, then the arena walls, then the e-pucks that are not driven.

    The obstacles keep their order. Those that have a mass and hang in the air are
    lowered onto what is below them.
    """
    floor = floor_under(world)
    fallen = [_fallen(thing, world.obstacles, floor) for thing in world.obstacles]
    walls = [arena.wall() for arena in world.arenas if arena.has_wall]
    return (*fallen, *walls, *map(parked_robot, world.robots[1:]))


def floor_under(world: World) -> float:
    """Height of the ground under the driven robot, m.

    The robot stands on an obstacle (a table, a plank), on an arena, or at 0.
    """
    return _under(world)[0]


def material_under(world: World) -> str:
    """Material of the ground under the driven robot."""
    return _under(world)[1]


def _under(world: World) -> tuple[float, str]:
    ground = 0.0, MATERIAL
    if not world.robots:
        return ground
    x, y, reach = world.robot.x, world.robot.y, world.robot.z + _MAX_RISE
    under = [(part, thing) for thing in world.obstacles for part in thing.solid]
    tops = [(p.top, thing.material) for p, thing in under if p.shape.contains(x, y)]
    tops += [(a.z, a.material) for a in world.arenas if a.inside.contains(x, y)]
    below = [top for top in tops if top[0] <= reach]
    return max(below, key=lambda top: top[0], default=ground)


def at_body_height(parts: Iterable[Part], floor: float) -> tuple[Part, ...]:
    """The parts that an e-puck standing at height `floor` (m) can hit."""
    low, high = floor + BODY_BOTTOM, floor + BODY_TOP
    return tuple(part for part in parts if part.top > low and part.bottom < high)


def parked_robot(robot: EPuck) -> Obstacle:
    """An e-puck that is not driven, as an obstacle."""
    disc = Disc(robot.x, robot.y, BODY_RADIUS)
    part = Part(disc, robot.z + BODY_BOTTOM, robot.z + BODY_TOP)
    return Obstacle(robot.name, "E-puck", robot.x, robot.y, (part,), (part,))


def _fallen(thing: Obstacle, others: Iterable[Obstacle], floor: float) -> Obstacle:
    """The obstacle; one with a mass is lowered onto the floor or what is below it."""
    if thing.mass is None or not thing.solid:
        return thing
    bottom = min(part.bottom for part in thing.solid)
    below = [
        p.top for o in others if o is not thing for p in o.solid if _above(thing, p)
    ]
    drop = bottom - max([floor, *(top for top in below if top <= bottom + _NEAR)])
    if drop <= _NEAR:
        return thing
    solid, visible = (
        tuple(replace(p, bottom=p.bottom - drop, top=p.top - drop) for p in parts)
        for parts in (thing.solid, thing.visible)
    )
    return replace(thing, solid=solid, visible=visible)


def _above(thing: Obstacle, part: Part) -> bool:
    """Whether the bounds of a thing and of a part overlap in the ground plane."""
    left, low, right, high = part.shape.bounds
    return any(
        a <= right and left <= c and b <= high and low <= d
        for a, b, c, d in (own.shape.bounds for own in thing.solid)
    )
