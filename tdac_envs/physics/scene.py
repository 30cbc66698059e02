"""What a body can touch and see: vertical prisms on a flat ground, in metres."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial

from tdac_envs.core.errors import WorldError
from tdac_envs.worlds.bodies import (
    BODY_BOTTOM,
    bodies,
    floor_under,
    material_under,
)
from tdac_envs.worlds.footprint import Footprint
from tdac_envs.worlds.looks import look_of_kind
from tdac_envs.worlds.materials import MATERIAL, friction_between
from tdac_envs.worlds.world import EPuck, Obstacle, Part, World

FIXED = -1
_MAX_RISE = 0.01
"""Maximum height of the ground above the robot's origin, m."""
Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Prism:
    """A vertical prism.

    Attributes:
        shape: Footprint.
        bottom: Lowest z, m.
        top: Highest z, m.
        solid: Whether bodies collide with it.
        visible: Whether rays hit it, and pictures show it.
        thing: Index of the free thing that it belongs to, or `FIXED`.
        colour: Red, green, blue, from 0 to 1.
        reflectance: What infra-red sensors divide distances by, as in Webots.
    """

    shape: Footprint
    bottom: float
    top: float
    solid: bool = True
    visible: bool = True
    thing: int = FIXED
    colour: tuple[float, float, float] = (0.6, 0.6, 0.62)
    reflectance: float = 1.0


@dataclass(frozen=True, slots=True)
class Thing:
    """A free thing, which the robot can push.

    Attributes:
        x: x of its frame at the reset, m.
        y: y of its frame, m.
        mass: Mass, kg.
        friction: Coulomb friction coefficient on the ground.
    """

    x: float
    y: float
    mass: float
    friction: float


@dataclass(frozen=True, slots=True)
class Scene:
    """A flat ground with prisms on it.

    Attributes:
        prisms: All prisms.
        things: The free things, in the order of their indices.
        floor: Height of the ground, m.
    """

    prisms: tuple[Prism, ...]
    things: tuple[Thing, ...] = ()
    floor: float = 0.0


def scene_of(
    world: World, fence: Iterable[Footprint] = (), centres: Sequence[Point] = ()
) -> Scene:
    """The scene of a Webots world around its driven e-puck.

    What the e-puck can drive over, because it is lower than its body, is not solid.

    Args:
        world: The world.
        fence: Footprints of the invisible fence around the world.
        centres: Centres of the things that have a mass, in the order of the obstacles.

    Raises:
        WorldError: There is no ground under the robot.
    """
    floor = ground_under(world)
    prisms = [Prism(shape, floor, floor + 1.0, visible=False) for shape in fence]
    things: list[Thing] = []
    sliding = partial(friction_between, world.contacts, material_under(world))
    for body in bodies(world):
        number = FIXED
        if body.mass is not None and body.solid:
            number = len(things)
            things.append(Thing(*centres[number], body.mass, sliding(body.material)))
        prisms += _prisms_of(body, floor, number)
    return Scene(tuple(prisms), tuple(things), floor)


def grip_in(world: World) -> float:
    """Coulomb friction coefficient of the e-puck's tyres on the ground."""
    return friction_between(world.contacts, MATERIAL, material_under(world))


def ground_under(world: World) -> float:
    """Height of the ground under the driven robot, m.

    Raises:
        WorldError: The world has no ground: the robot would fall.
    """
    if not _has_ground(world, world.robot):
        where = world.source or "the world"
        raise WorldError(
            f"{where}: there is no ground under the robot at ({world.robot.x:g}, "
            f"{world.robot.y:g}), so it would fall; add a RectangleArena or a Floor"
        )
    return floor_under(world)


def _has_ground(world: World, robot: EPuck) -> bool:
    """Whether a floor or the top of an object is under a robot.

    A Plane is only visible here: it has no footprint that a body could touch.
    """
    parts = (p for thing in world.obstacles for p in (*thing.solid, *thing.visible))
    below = (part.shape for part in parts if part.top <= robot.z + _MAX_RISE)
    floors = (arena.inside for arena in world.arenas)
    return any(area.contains(robot.x, robot.y) for area in (*floors, *below))


def _prisms_of(body: Obstacle, floor: float, number: int) -> list[Prism]:
    """The prisms of an obstacle; a part that is solid and visible is one prism."""
    low = floor + BODY_BOTTOM

    def is_solid(part: Part) -> bool:
        return part in body.solid and (number != FIXED or part.top > low)

    # Sensors do not see a goal marker, through which the robot may drive.
    shown = body.visible if body.solid or not body.is_goal else ()
    looks = dict(zip(body.visible, body.looks, strict=False))
    parts = dict.fromkeys((*body.solid, *body.visible))
    found = []
    for part in parts:
        solid, visible = is_solid(part), part in shown
        if solid or visible:
            found.append(
                Prism(
                    part.shape, part.bottom, part.top, solid, visible, number,
                    looks.get(part, look_of_kind(body.kind)).colour, body.reflectance,
                )
            )  # fmt: skip
    return found
