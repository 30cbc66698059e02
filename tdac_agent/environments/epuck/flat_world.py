"""The world of a task as its controller reads it: one e-puck and one goal mark."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from tdac_envs.worlds.bodies import floor_under, parked_robot
from tdac_envs.worlds.footprint import Disc
from tdac_envs.worlds.world import Obstacle, Part, World

GOAL = "GOAL"
_MARK_RADIUS, _MARK_HEIGHT = 0.02, 0.002


def flat_world(world: World, dt: float) -> World:
    """Returns an equivalent world that is simpler to read.

    Other e-pucks and solid marks of other goals become ordinary obstacles; other marks
    and nodes that are not modelled are removed.

    Args:
        world: World from `open_world`, with a robot and a goal.
        dt: Duration of a step, s.
    """
    others = tuple(map(parked_robot, world.robots[1:]))
    return replace(
        world,
        robots=(world.robot,),
        obstacles=(_mark(world), *_without_marks(world), *others),
        time_step=1e3 * dt,
        unmodelled=(),
    )


def _is_mark(thing: Obstacle, world: World) -> bool:
    return thing.is_goal and (thing.x, thing.y) == world.goal


def _mark(world: World) -> Obstacle:
    """Returns the goal mark of the file, or else a flat disc."""
    own = [thing for thing in world.obstacles if _is_mark(thing, world)]
    if own:
        return replace(own[0], name=GOAL)
    assert world.goal is not None
    floor = floor_under(world)
    part = Part(Disc(*world.goal, _MARK_RADIUS), floor, floor + _MARK_HEIGHT)
    return Obstacle(GOAL, "Solid", *world.goal, visible=(part,), is_goal=True)


def _without_marks(world: World) -> Iterator[Obstacle]:
    """Yields the obstacles; goal marks only if they are solid, with another name."""
    seen = False
    for thing in world.obstacles:
        if not thing.is_goal:
            yield thing
        elif _is_mark(thing, world) and not seen:
            seen = True
        elif thing.solid:
            yield replace(thing, name="former mark", is_goal=False)
