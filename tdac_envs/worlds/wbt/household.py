"""Converts common small PROTOs of Webots to prisms: balls, drinks, jars, animals.

Their shapes are those of the PROTOs' boundingObjects; of an animal, only the parts that
a robot on the floor can touch. If a file gives no mass, the masses of bottles and jars
are estimates. A ball slides; it does not roll.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from tdac_envs.worlds.wbt.appearance import factor_of_red
from tdac_envs.worlds.wbt.fields import number, numbers, positive
from tdac_envs.worlds.wbt.frames import NodeFrame, flu_size
from tdac_envs.worlds.wbt.placing import Point, placed
from tdac_envs.worlds.wbt.prisms import box, capsule, cylinder, sphere
from tdac_envs.worlds.wbt.tree import WbtNode
from tdac_envs.worlds.world import Part

_LYING: tuple[float, float, float, float] = (0.0, 1.0, 0.0, math.pi / 2)


@dataclass(frozen=True, slots=True)
class Body:
    """A PROTO converted to prisms.

    Attributes:
        frame: Frame of the PROTO.
        solid: Parts for collisions.
        visible: Parts that sensors see.
        mass: Mass, kg; None if the body is fixed.
        reflectance: Reflectance of all parts.
    """

    frame: NodeFrame
    solid: tuple[Part, ...]
    visible: tuple[Part, ...]
    mass: float | None = None
    reflectance: float = 1.0


def _body(
    node: WbtNode,
    own: NodeFrame,
    parts: tuple[Part, ...],
    mass: float | None,
    reflectance: float = 1.0,
) -> Body:
    mass = None if mass is None else number(node, "mass", mass)
    return Body(own, parts, parts, mass if mass else None, reflectance)


Reader = Callable[[WbtNode, NodeFrame], Body]


def _ball(radius: float, mass: float, default: Point = (0.0, 0.0, 0.0)) -> Reader:
    def read(node: WbtNode, frame: NodeFrame) -> Body:
        own = placed(node, frame, default)
        parts = sphere(own.flu(), positive(node, "radius", radius))
        return _body(node, own, parts, mass)

    return read


def _columns(
    *columns: tuple[float, float, float], mass: float, default: Point = (0.0, 0.0, 0.0)
) -> Reader:
    """A reader of upright cylinders.

    Args:
        columns: Radius, lowest and highest z of each, m.
        mass: Mass if the file gives none, kg.
        default: Translation if the file gives none, m.
    """

    def read(node: WbtNode, frame: NodeFrame) -> Body:
        own = placed(node, frame, default)
        local = own.flu()
        parts: tuple[Part, ...] = ()
        for radius, low, high in columns:
            middle = local.inside((0.0, 0.0, (low + high) / 2))
            parts += cylinder(middle, radius, high - low)
        return _body(node, own, parts, mass)

    return read


def _obstacle(node: WbtNode, frame: NodeFrame) -> Body:
    own = placed(node, frame, (0.0, 0.0, 0.025))
    red = numbers(node, "color", (1.0, 0.501961, 0.25098))[0]
    parts = cylinder(own.flu(), 0.04, 0.05)
    return _body(node, own, parts, None, factor_of_red(0.8 * red))


def _maze_block(node: WbtNode, frame: NodeFrame) -> Body:
    own = placed(node, frame)
    size = (0.015, number(node, "length", 0.1), 0.065)
    parts = box(own.flu().inside((0.0, 0.0, size[2] / 2)), size)
    return Body(own, parts, parts, 200.0 * math.prod(size))


def _cereal_box(node: WbtNode, frame: NodeFrame) -> Body:
    usual = (0.08, 0.3, 0.2) if frame.y_up else (0.2, 0.08, 0.3)
    size = flu_size(numbers(node, "size", usual), frame.y_up)
    own = placed(node, frame)
    parts = box(own.flu().inside((0.0, 0.0, size[2] / 2)), size)
    return _body(node, own, parts, 1.0)


def _flag(node: WbtNode, frame: NodeFrame) -> Body:
    own = placed(node, frame)
    local = own.flu()
    parts = cylinder(local.inside((0.0, 0.0, 0.015)), 0.1, 0.03)
    parts += cylinder(local.inside((0.0, 0.0, 0.27)), 0.01, 0.5)
    return Body(own, parts, parts)


def _cat(node: WbtNode, frame: NodeFrame) -> Body:
    own, scale = placed(node, frame), scale_of(node)
    local = own.flu().inside(scale=(scale, scale, scale))
    parts: tuple[Part, ...] = ()
    for side in (0.037, -0.037):
        for paw, ankle, radius in ((-0.094, -0.08, 0.015), (0.118, 0.137, 0.013)):
            parts += cylinder(local.inside((paw, side, 0.01)), 0.02, 0.02)
            parts += cylinder(local.inside((ankle, 0.95 * side, 0.05)), radius, 0.06)
    body = local.inside((-0.002, 0.0, 0.174), _LYING)
    return _body(node, own, parts + capsule(body, 0.055, 0.2), 2.5)


def _dog(node: WbtNode, frame: NodeFrame) -> Body:
    own, scale = placed(node, frame), scale_of(node)
    local = own.flu().inside(scale=(scale, scale, scale))
    parts: tuple[Part, ...] = ()
    for x in (-0.23, 0.23):
        for y in (-0.0775, 0.0775):
            parts += cylinder(local.inside((x, y, 0.15)), 0.05, 0.3)
    body = local.inside((0.036, 0.0, 0.387), _LYING)
    parts += capsule(body, 0.133, 0.37)
    return Body(own, parts, parts)


def scale_of(node: WbtNode) -> float:
    """The field `scale` of a PROTO, if it is above 0; else 1."""
    return positive(node, "scale", 1.0)


HOUSEHOLD: dict[str, Reader] = {
    "Ball": _ball(0.0325, 0.055, (0.0, 0.0, 0.1625)),
    "BeerBottle": _columns((0.031, 0.0, 0.1425), (0.022, 0.13, 0.23), mass=0.6),
    "Can": _columns((0.03175, -0.0611, 0.0611), mass=0.35, default=(0.0, 0.0, 0.06)),
    "Cat": _cat,
    "CerealBox": _cereal_box,
    "Dog": _dog,
    "HoneyJar": _columns((0.045, 0.0005, 0.1155), mass=0.45),
    "JamJar": _columns((0.045, 0.0005, 0.1155), mass=0.45),
    "MazeBlock": _maze_block,
    "Obstacle": _obstacle,
    "PingPongBall": _ball(0.02, 84.0 * 4.0 / 3.0 * math.pi * 0.02**3),
    "SoccerBall": _ball(0.113, 0.6),
    "WaterBottle": _columns((0.044, 0.002, 0.242), (0.012, 0.242, 0.3055), mass=0.6),
    "YoubotFlag": _flag,
}
"""The reader of each PROTO."""
