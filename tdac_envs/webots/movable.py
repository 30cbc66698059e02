"""Objects that a robot can push, and their nodes in the file."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from tdac_envs.epuck.ground import Ground
from tdac_envs.webots.coordinates import FileFrame, Found, walk_frames
from tdac_envs.worlds.wbt.content import name_of
from tdac_envs.worlds.wbt.frames import NodeFrame
from tdac_envs.worlds.wbt.tree import WbtNode

Point = tuple[float, float]
Place = tuple[list[float], list[float]]

# m; numbers of a world are rounded to 1e-9.
_SAME = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Movable:
    """An object that can be pushed.

    Attributes:
        node: Its node.
        frame: Conversion of its pose to the file's coordinates.
        centre: Centre of the object at the start, m.
        origin: Origin of the node relative to the centre at the start, m.
    """

    node: WbtNode
    frame: FileFrame
    centre: Point
    origin: Point

    def place(self, x: float, y: float, turn: float) -> Place | None:
        """Translation and rotation in file coordinates; None if it has not moved.

        Args:
            x: x of its centre, m.
            y: y of its centre, m.
            turn: Rotation since the start, rad.
        """
        if (x, y) == self.centre and turn == 0.0:
            return None
        cos, sin = math.cos(turn), math.sin(turn)
        ahead, left = self.origin
        at = self.frame.point(
            x + cos * ahead - sin * left, y + sin * ahead + cos * left
        )
        return at, self.frame.axis_angle(turn)


def find_movables(
    ground: Ground, nodes: Iterable[WbtNode], top: NodeFrame
) -> tuple[Movable | None, ...]:
    """Finds the nodes of the objects that can be pushed.

    Args:
        ground: Ground of the world.
        nodes: Top-level nodes of the file.
        top: Frame of these nodes.

    Returns:
        One entry per object, in the environment's order; None if its node is not found.
    """
    pushable = [t for t in ground.things if t.mass is not None and t.solid]
    if not pushable:
        return ()
    all_nodes = list(walk_frames(nodes, top))
    found: list[Movable | None] = []
    for thing, middle in zip(pushable, ground.centres.tolist(), strict=True):
        match = _match(all_nodes, thing.name, (thing.x, thing.y))
        if match is None:
            found.append(None)
            continue
        node, own = match
        centre = (middle[0], middle[1])
        origin = (thing.x - centre[0], thing.y - centre[1])
        found.append(Movable(node, FileFrame.of(top, own, 0.0), centre, origin))
    return tuple(found)


def _match(nodes: list[Found], name: str, at: Point) -> Found | None:
    for node, own in nodes:
        x, y, _ = own.origin.tolist()
        near = abs(x - at[0]) < _SAME and abs(y - at[1]) < _SAME
        if near and name_of(node) == name:
            return node, own
    return None
