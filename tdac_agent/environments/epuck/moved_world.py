"""A world moved and turned as a whole, and its file in another order."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace

import numpy as np

from tdac_envs.worlds.footprint import Disc, Footprint, Polygon, Rectangle
from tdac_envs.worlds.world import Arena, Obstacle, Part, World

Point = tuple[float, float]
_FIRST = ("WorldInfo", "Viewpoint")
_POSE = re.compile(
    r"^( +)Pose \{\n +translation (\S+) (\S+) (\S+)\n(?: +rotation 0 0 1 (\S+)\n)?",
    re.MULTILINE,
)


@dataclass(frozen=True, slots=True)
class Motion:
    """A turn about the origin, counter-clockwise, then a shift.

    Attributes:
        angle: rad.
        x: m.
        y: m.
    """

    angle: float
    x: float
    y: float

    def point(self, x: float, y: float) -> Point:
        """Where a point gets to."""
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        return cos * x - sin * y + self.x, sin * x + cos * y + self.y

    def shape(self, shape: Footprint) -> Footprint:
        """Where a footprint gets to."""
        if isinstance(shape, Polygon):
            return Polygon.around([self.point(x, y) for x, y in shape.points])
        return self.arena_floor(shape)

    def arena_floor(self, shape: Disc | Rectangle) -> Disc | Rectangle:
        """Where a floor gets to."""
        x, y = self.point(shape.x, shape.y)
        if isinstance(shape, Disc):
            return replace(shape, x=x, y=y)
        return replace(shape, x=x, y=y, yaw=shape.yaw + self.angle)

    def part(self, part: Part) -> Part:
        """Where a prism gets to."""
        return replace(part, shape=self.shape(part.shape))

    def obstacle(self, thing: Obstacle) -> Obstacle:
        """Where a thing gets to."""
        x, y = self.point(thing.x, thing.y)
        solid = tuple(map(self.part, thing.solid))
        visible = tuple(map(self.part, thing.visible))
        return replace(thing, x=x, y=y, solid=solid, visible=visible)

    def arena(self, arena: Arena) -> Arena:
        """Where an arena gets to."""
        return replace(arena, inside=self.arena_floor(arena.inside))

    def world(self, world: World) -> World:
        """A whole world elsewhere."""
        robots = []
        for robot in world.robots:
            x, y = self.point(robot.x, robot.y)
            heading = robot.heading + self.angle
            robots.append(replace(robot, x=x, y=y, heading=heading))
        return replace(
            world,
            robots=tuple(robots),
            goal=None if world.goal is None else self.point(*world.goal),
            arenas=tuple(map(self.arena, world.arenas)),
            obstacles=tuple(map(self.obstacle, world.obstacles)),
        )


def reordered(text: str, random: np.random.Generator) -> str:
    """A world file with its nodes in another order, and names for those without.

    Args:
        text: From `write_world`, which begins each node at the beginning of a line.
        random: Gives the order.
    """
    head, *nodes = text.split("\n\n")[0:1] + _nodes(text)
    first = [node for node in nodes if node.startswith(_FIRST)]
    others = [node for node in nodes if not node.startswith(_FIRST)]
    named = [
        f"DEF THING_{number} {node}" if node.startswith("Solid ") else node
        for number, node in enumerate(others)
    ]
    shuffled = [named[k] for k in random.permutation(len(named))]
    externs = [line for line in text.splitlines() if line.startswith("EXTERNPROTO")]
    return "\n".join([head, "", *externs, "", *first, *shuffled]) + "\n"


def turned_groups(text: str, angle: float) -> str:
    """The same world, but what has several pieces is turned, and these back again.

    `write_world` turns none of it, so that its pieces would be found by who does not
    look at how it is turned.

    Args:
        text: From `write_world`.
        angle: rad.
    """
    for node in _nodes(text):
        if "  boundingObject Group {" in node:
            text = text.replace(node, _turned(node, angle), 1)
    return text


def _turned(node: str, angle: float) -> str:
    back = Motion(-angle, 0.0, 0.0)

    def pose(found: re.Match[str]) -> str:
        space, x, y, z, yaw = found.groups()
        u, v = back.point(float(x), float(y))
        turn = float(yaw or 0.0) - angle
        return (
            f"{space}Pose {{\n{space}  translation {u:.9f} {v:.9f} {z}\n"
            f"{space}  rotation 0 0 1 {turn:.9f}\n"
        )

    head, line, rest = _POSE.sub(pose, node).partition("\n  children [")
    return f"{head}\n  rotation 0 0 1 {angle:.9f}{line}{rest}"


def _nodes(text: str) -> list[str]:
    """The nodes at the top of a file that `write_world` wrote."""
    nodes: list[list[str]] = []
    for line in text.splitlines():
        if line.endswith("{") and not line.startswith(" "):
            nodes.append([])
        if nodes:
            nodes[-1].append(line)
    return ["\n".join(node) for node in nodes]
