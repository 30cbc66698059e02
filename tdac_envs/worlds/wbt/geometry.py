"""Converts geometry nodes and boundingObjects to prisms."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tdac_envs.worlds.wbt.fields import (
    child,
    children,
    number_list,
    numbers,
    positive,
)
from tdac_envs.worlds.wbt.frames import NodeFrame, flu_size
from tdac_envs.worlds.wbt.meshes import mesh
from tdac_envs.worlds.wbt.placing import placed
from tdac_envs.worlds.wbt.prisms import box, capsule, cone, cylinder, plane, sphere
from tdac_envs.worlds.wbt.tree import WbtNode
from tdac_envs.worlds.world import Part

GROUPS = {"Group", "Transform", "Pose"}
_FLAT = 0.02
"""Largest tilt at which a Plane counts as the ground, rad."""


@dataclass(frozen=True, slots=True)
class Pieces:
    """Geometry converted to prisms.

    Attributes:
        parts: Prisms.
        volume: Volume from which Webots computes a mass by density, m³; overlaps count
            twice.
        missing: Descriptions of the geometry that cannot be converted.
    """

    parts: tuple[Part, ...] = ()
    volume: float = 0.0
    missing: tuple[str, ...] = ()

    def __add__(self, other: Pieces) -> Pieces:
        return Pieces(
            self.parts + other.parts,
            self.volume + other.volume,
            self.missing + other.missing,
        )


def bounds(node: WbtNode, frame: NodeFrame) -> Pieces:
    """Converts a boundingObject: a geometry, or a Shape, Group, Transform or Pose.

    Args:
        node: The node.
        frame: Frame of the Solid.

    Raises:
        WorldError: A field is invalid.
    """
    if node.kind in GROUPS:
        inner = frame if node.kind == "Group" else placed(node, frame, scaled=True)
        return sum((bounds(part, inner) for part in children(node)), Pieces())
    if node.kind == "Shape":
        shape = child(node, "geometry")
        return Pieces() if shape is None else bounds(shape, frame)
    if not _is_plane(node):
        return geometry(node, frame)
    level = abs(frame.flu().tilt) < _FLAT
    return Pieces(missing=() if level else ("a Plane that is not the ground",))


def _is_plane(node: WbtNode) -> bool:
    """Whether the geometry is a Plane, or an ElevationGrid of one height."""
    if node.kind == "ElevationGrid":
        return len(set(number_list(node, "height"))) <= 1
    return node.kind == "Plane"


def geometry(node: WbtNode, frame: NodeFrame) -> Pieces:
    """Converts a geometry node.

    Args:
        node: The node.
        frame: Frame of the node, in the file's object axes (FLU or RUB).

    Raises:
        WorldError: A field is invalid.
    """
    if node.kind == "IndexedFaceSet":
        found = mesh(node, frame)
        if isinstance(found, str):
            return Pieces(missing=(found,))
        # An upper bound, which is good enough: meshes are rarely pushed.
        volume = sum(p.shape.area * (p.top - p.bottom) for p in found)
        return Pieces(found, volume)
    if node.kind not in _PRIMITIVES:
        return Pieces(missing=(node.kind,))
    parts, volume = _PRIMITIVES[node.kind](node, frame.flu(), frame.y_up)
    return Pieces(parts, volume * abs(float(np.linalg.det(frame.matrix))))


_Made = tuple[tuple[Part, ...], float]


def _box(node: WbtNode, frame: NodeFrame, y_up: bool) -> _Made:
    size = flu_size(numbers(node, "size", (2.0, 2.0, 2.0)), y_up)
    if min(size) <= 0.0:
        size = (1.0, 1.0, 1.0)  # as Webots does
    return box(frame, size), math.prod(size)


def _sphere(node: WbtNode, frame: NodeFrame, _: bool) -> _Made:
    radius = positive(node, "radius", 1.0, 1.0)
    return sphere(frame, radius), 4.0 / 3.0 * math.pi * radius**3


def _cylinder(node: WbtNode, frame: NodeFrame, _: bool) -> _Made:
    radius, height = (
        positive(node, "radius", 1.0, 1.0),
        positive(node, "height", 2.0, 1.0),
    )
    return cylinder(frame, radius, height), math.pi * radius**2 * height


def _capsule(node: WbtNode, frame: NodeFrame, _: bool) -> _Made:
    radius, height = (
        positive(node, "radius", 1.0, 1.0),
        positive(node, "height", 2.0, 1.0),
    )
    volume = math.pi * radius**2 * (height + 4.0 / 3.0 * radius)
    return capsule(frame, radius, height), volume


def _sizes(node: WbtNode) -> tuple[float, float]:
    """Radius and height; 1 if one is not above 0, as in Webots."""
    return positive(node, "radius", 1.0, 1.0), positive(node, "height", 2.0, 1.0)


def _cone(node: WbtNode, frame: NodeFrame, _: bool) -> _Made:
    radius = positive(node, "bottomRadius", 1.0, 1.0)
    height = positive(node, "height", 2.0, 1.0)
    return cone(frame, radius, height), math.pi * radius**2 * height / 3.0


def _plane(node: WbtNode, frame: NodeFrame, y_up: bool) -> _Made:
    size = numbers(node, "size", (1.0, 1.0))
    length, width = size[::-1] if y_up else size
    return plane(frame, abs(length), abs(width)), 0.0


_PRIMITIVES: dict[str, Callable[[WbtNode, NodeFrame, bool], _Made]] = {
    "Box": _box,
    "Capsule": _capsule,
    "Cone": _cone,
    "Cylinder": _cylinder,
    "Plane": _plane,
    "Sphere": _sphere,
}
