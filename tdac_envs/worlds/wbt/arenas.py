"""Reads floors and arenas."""

from __future__ import annotations

import numpy as np

from tdac_envs.worlds.footprint import THINNEST, Disc, Rectangle
from tdac_envs.worlds.wbt.colours import floor_look, wall_look
from tdac_envs.worlds.wbt.content import material_of
from tdac_envs.worlds.wbt.fields import number, numbers, positive
from tdac_envs.worlds.wbt.frames import NodeFrame
from tdac_envs.worlds.wbt.placing import placed
from tdac_envs.worlds.wbt.tree import WbtNode
from tdac_envs.worlds.world import Arena

ARENAS = {"CircleArena", "RectangleArena", "Floor"}
_LEVEL = 0.02
"""Largest tilt at which a floor counts as level, rad."""


def arena(node: WbtNode, frame: NodeFrame) -> Arena | str:
    """Reads a CircleArena, RectangleArena or Floor.

    Returns:
        The arena, or the reason why it cannot be modelled.

    Raises:
        WorldError: A field is invalid.
    """
    own = placed(node, frame).flu()
    if not abs(own.tilt) < _LEVEL:
        return "it is not level"
    x, y, z = own.origin.tolist()
    stretch = np.linalg.norm(own.matrix, axis=0).tolist()
    if node.kind == "CircleArena":
        radius = positive(node, "radius", 1.0) * stretch[0]
        inside: Disc | Rectangle = Disc(x, y, max(radius, THINNEST))
    else:
        name, default = ("size", 10.0) if node.kind == "Floor" else ("floorSize", 1.0)
        size = numbers(node, name, (default, default))
        length, width = size if min(size) > 0.0 else (default, default)
        if frame.y_up:
            length, width = width, length
        length, width = length * stretch[0], width * stretch[1]
        inside = Rectangle(
            x, y, own.heading, max(length, THINNEST), max(width, THINNEST)
        )
    if node.kind == "Floor":
        return Arena(
            inside, z=z, floor_look=floor_look(node), material=material_of(node)
        )
    thickness = positive(node, "wallThickness", 0.01) * stretch[0]
    height = positive(node, "wallHeight", 0.1) * stretch[2]
    facets = int(min(max(number(node, "subdivision", 48.0), 8.0), 200.0))
    return Arena(
        inside, max(thickness, THINNEST), max(height, THINNEST), z, facets,
        floor_look(node), wall_look(node), material_of(node),
    )  # fmt: skip
