"""Moving and turning a whole world, and reordering its file."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace

import numpy as np

from tdac_agent.tasks.units import Point
from tdac_envs.worlds.footprint import Disc, Footprint, Polygon, Rectangle
from tdac_envs.worlds.world import Arena, EPuck, Obstacle, Part, World

_FIRST = ("WorldInfo", "Viewpoint")
_POSE = re.compile(
    r"^( +)Pose \{\n +translation (\S+) (\S+) (\S+)\n(?: +rotation 0 0 1 (\S+)\n)?",
    re.MULTILINE,
)


@dataclass(frozen=True, slots=True)
class Motion:
    """A turn about the origin, counter-clockwise, then a shift.

    Attributes:
        angle: Angle of the turn, rad.
        x: Shift along x, m.
        y: Shift along y, m.
    """

    angle: float
    x: float
    y: float

    def point(self, x: float, y: float) -> Point:
        """Moves a point."""
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        return cos * x - sin * y + self.x, sin * x + cos * y + self.y

    def shape(self, shape: Footprint) -> Footprint:
        """Moves a footprint."""
        if isinstance(shape, Polygon):
            return Polygon.around([self.point(x, y) for x, y in shape.points])
        return self.arena_floor(shape)

    def arena_floor(self, shape: Disc | Rectangle) -> Disc | Rectangle:
        """Moves a floor."""
        x, y = self.point(shape.x, shape.y)
        if isinstance(shape, Disc):
            return replace(shape, x=x, y=y)
        return replace(shape, x=x, y=y, yaw=shape.yaw + self.angle)

    def part(self, part: Part) -> Part:
        """Moves a prism."""
        return replace(part, shape=self.shape(part.shape))

    def obstacle(self, thing: Obstacle) -> Obstacle:
        """Moves an obstacle."""
        x, y = self.point(thing.x, thing.y)
        solid = tuple(map(self.part, thing.solid))
        visible = tuple(map(self.part, thing.visible))
        return replace(thing, x=x, y=y, solid=solid, visible=visible)

    def robot(self, robot: EPuck) -> EPuck:
        """Moves an e-puck."""
        x, y = self.point(robot.x, robot.y)
        return replace(robot, x=x, y=y, heading=robot.heading + self.angle)

    def arena(self, arena: Arena) -> Arena:
        """Moves an arena."""
        return replace(arena, inside=self.arena_floor(arena.inside))

    def world(self, world: World) -> World:
        """Moves a whole world."""
        return replace(
            world,
            robots=tuple(map(self.robot, world.robots)),
            goal=None if world.goal is None else self.point(*world.goal),
            arenas=tuple(map(self.arena, world.arenas)),
            obstacles=tuple(map(self.obstacle, world.obstacles)),
        )


def reordered(text: str, random: np.random.Generator) -> str:
    """Returns a world file with nodes in random order and DEF names for its solids.

    Args:
        text: File from `write_world`, in which each node starts a line.
        random: Random number generator.
    """
    head, nodes = text.partition("\n\n")[0], _nodes(text)
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
    """Turns obstacles with several pieces, and turns their pieces back again.

    The world stays the same. `write_world` turns only the pieces; without this, a
    parser that ignores the rotation of an obstacle would pass.

    Args:
        text: File from `write_world`.
        angle: Angle of the turn, rad.
    """
    for node in _nodes(text):
        if "  boundingObject Group {" in node:
            text = text.replace(node, _turned(node, angle), 1)
    return text


def _turned(node: str, angle: float) -> str:
    back = Motion(-angle, 0.0, 0.0)

    def pose(match: re.Match[str]) -> str:
        space, x, y, z, yaw = match.groups()
        u, v = back.point(float(x), float(y))
        turn = float(yaw or 0.0) - angle
        return (
            f"{space}Pose {{\n{space}  translation {u:.9f} {v:.9f} {z}\n"
            f"{space}  rotation 0 0 1 {turn:.9f}\n"
        )

    head, line, rest = _POSE.sub(pose, node).partition("\n  children [")
    return f"{head}\n  rotation 0 0 1 {angle:.9f}{line}{rest}"


def _nodes(text: str) -> list[str]:
    """Returns the top-level nodes of a file from `write_world`."""
    nodes: list[list[str]] = []
    for line in text.splitlines():
        if line.endswith("{") and not line.startswith(" "):
            nodes.append([])
        if nodes:
            nodes[-1].append(line)
    return ["\n".join(node) for node in nodes]
