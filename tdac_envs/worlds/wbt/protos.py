"""Converts Webots' obstacle PROTOs to prisms.

The constants are those of the PROTOs of R2023b and R2025a. Each reader takes the node
and the frame of its parent, and returns the prisms in the world.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from tdac_envs.worlds.footprint import THINNEST, ring
from tdac_envs.worlds.wbt.appearance import reflectance
from tdac_envs.worlds.wbt.fields import flag, number, numbers, positive, text
from tdac_envs.worlds.wbt.frames import NodeFrame, flu_size, own_axes
from tdac_envs.worlds.wbt.household import HOUSEHOLD, Body, scale_of
from tdac_envs.worlds.wbt.physics import mass_of
from tdac_envs.worlds.wbt.placing import Point, placed
from tdac_envs.worlds.wbt.prisms import Vectors, box, capsule, cone, cylinder, hull
from tdac_envs.worlds.wbt.tree import WbtNode
from tdac_envs.worlds.world import Part

Size = tuple[float, float, float]

_WOOD = 0.298
"""Reflectance of a WoodenBox, measured on its textures."""
_ROUNDNESS = 0.01
"""Maximum deviation of a faceted pipe from a round one, relative to its thickness."""

_NARROWEST = 1e-3
"""Minimum radius of a pipe, m."""

# Outline, lowest z and highest z of each type of Rock at scale 1, m.
_ROCKS: dict[str, tuple[list[tuple[float, float]], float, float]] = {
    "regular": (
        [
            (-0.0668, -0.0031), (-0.0556, -0.0468), (0.0046, -0.0540),
            (0.0296, -0.0428), (0.0576, -0.0247), (0.0660, 0.0077),
            (0.0608, 0.0574), (0.0346, 0.0554), (-0.0161, 0.0464),
            (-0.0385, 0.0333),
        ],
        -0.056,
        0.049,
    ),
    "flat": (
        [
            (-0.174, 0.004), (-0.095, -0.123), (0.014, -0.128), (0.220, -0.060),
            (0.190, 0.073), (0.119, 0.130), (0.010, 0.130), (-0.131, 0.083),
            (-0.151, 0.072),
        ],
        0.0,
        0.176,
    ),
}  # fmt: skip


def _wooden_box(node: WbtNode, frame: NodeFrame) -> Body:
    size = _clamped(_size(node, frame, (0.6, 0.6, 0.6)), 0.01, 3.0)
    own = placed(node, frame, (0.0, 0.0, 0.3))
    parts = box(own.flu(), size)
    return Body(own, parts, parts, _box_mass(node, size, 1000.0), _WOOD)


def _cardboard_box(node: WbtNode, frame: NodeFrame) -> Body:
    size = _size(node, frame, (0.6, 0.6, 0.6))
    if not 1e-6 <= math.prod(size) <= 1.0:
        size = (0.6, 0.6, 0.6)
    size = _clamped(size, 0.01, 2.5)
    own = placed(node, frame, (0.0, 0.0, 0.3))
    parts = box(own.flu(), size)
    return Body(own, parts, parts, _box_mass(node, size, 100.0))


def _solid_box(node: WbtNode, frame: NodeFrame) -> Body:
    size = _size(node, frame, (2.0, 2.0, 2.0))
    own = placed(node, frame, (0.0, 0.0, 1.0))
    parts = box(own.flu(), size)
    solid = parts if flag(node, "enableBoundingObject", True) else ()
    return Body(own, solid, parts, mass_of(node, math.prod(size)), reflectance(node))


def _plastic_crate(node: WbtNode, frame: NodeFrame) -> Body:
    own, parts = _on_floor(node, frame, (0.6, 0.6, 0.6))
    mass = number(node, "mass", 0.0)
    return Body(own, parts, parts, mass if mass > 1e-6 else None)


def _wooden_pallet(node: WbtNode, frame: NodeFrame) -> Body:
    own, parts = _on_floor(node, frame, (1.2, 0.8, 0.14))
    # Older versions lack this field and always have a boundingObject.
    return Body(own, parts if flag(node, "boundingObject", True) else (), parts)


def _wall(node: WbtNode, frame: NodeFrame) -> Body:
    own, parts = _on_floor(node, frame, (0.2, 1.0, 2.4))
    return Body(own, parts, parts, reflectance=reflectance(node))


def _rock(node: WbtNode, frame: NodeFrame) -> Body:
    kind = text(node, "type", "regular")
    if kind not in _ROCKS:
        raise node.error(
            f"expected type {' or '.join(map(repr, _ROCKS))} for Rock, got {kind!r}",
            "type",
        )
    outline, low, high = _ROCKS[kind]
    scale, own = number(node, "scale", 1.0), placed(node, frame)
    if scale <= 0.0:
        raise node.error(f"expected a scale above 0 for Rock, got {scale:g}", "scale")
    parts = _column(own.flu(), np.array(outline) * scale, low * scale, high * scale)
    volume = parts[0].shape.area * (high - low) * scale / 2
    return Body(own, parts, parts, mass_of(node, volume))


def _oil_barrel(node: WbtNode, frame: NodeFrame) -> Body:
    radius = positive(node, "radius", 0.305)
    height = positive(node, "height", 0.88)
    own = placed(node, frame, (0.0, 0.0, 0.44))
    parts = cylinder(own.flu(), radius, height)
    return Body(own, parts, parts, mass_of(node, math.pi * radius**2 * height))


def _traffic_cone(node: WbtNode, frame: NodeFrame) -> Body:
    own, scale = placed(node, frame), scale_of(node)
    local = own.flu().inside(scale=(scale, scale, scale))
    base = box(local.inside((0.0, 0.0, 0.01125)), (0.5, 0.5, 0.0225))
    solid = base
    for z, height, radius in (
        (0.161, 0.0, 0.157),
        (0.22, 0.17, 0.1),
        (0.27, 0.4, 0.04),
    ):
        solid += capsule(local.inside((-0.01, -0.005, z)), radius, height)
    visible = base + cone(local.inside((0.0, 0.0, 0.27)), 0.222, 0.49)
    return Body(own, solid, visible, mass_of(node, 0.03 * scale**3))


def _solid_pipe(node: WbtNode, frame: NodeFrame) -> Body:
    radius = max(positive(node, "radius", 1.0), _NARROWEST)
    height = positive(node, "height", 2.0)
    thickness = number(node, "thickness", 0.1)
    if not 0.0 < thickness < radius:
        thickness = radius / 2  # as Webots does
    own = placed(node, frame, (0.0, 0.0, 1.0))
    thickness = max(thickness, THINNEST)
    facets = _facets(node, radius, thickness)
    pieces = ring(0.0, 0.0, radius - thickness, radius, facets)
    local = own.flu()
    parts = tuple(
        _column(local, piece.vertices, -height / 2, height / 2)[0] for piece in pieces
    )
    volume = math.pi * thickness * (2.0 * radius - thickness) * height
    solid = parts if flag(node, "enableBoundingObject", True) else ()
    return Body(own, solid, parts, mass_of(node, volume), reflectance(node))


def _facets(node: WbtNode, radius: float, thickness: float) -> int:
    """Webots' number of facets; more if that deviates too much from a round pipe."""
    own = number(node, "subdivision", 24.0)
    smooth = math.pi / math.sqrt(2.0 * _ROUNDNESS * thickness / radius)
    return math.ceil(min(max(own, smooth, 8.0), 200.0))


PROTOS: dict[str, Callable[[WbtNode, NodeFrame], Body]] = {
    "CardboardBox": _cardboard_box,
    "OilBarrel": _oil_barrel,
    "PlasticCrate": _plastic_crate,
    "Rock": _rock,
    "SolidBox": _solid_box,
    "SolidPipe": _solid_pipe,
    "TrafficCone": _traffic_cone,
    "Wall": _wall,
    "WoodenBox": _wooden_box,
    "WoodenPallet": _wooden_pallet,
    **HOUSEHOLD,
}
"""The reader of each type."""


def _on_floor(
    node: WbtNode, frame: NodeFrame, default: Size
) -> tuple[NodeFrame, tuple[Part, ...]]:
    """A box whose origin is the centre of its bottom face."""
    size, own = _size(node, frame, default), placed(node, frame)
    return own, box(own.flu().inside((0.0, 0.0, size[2] / 2)), size)


def _column(
    frame: NodeFrame, outline: Vectors, low: float, high: float
) -> tuple[Part, ...]:
    """A convex outline, extruded along z."""
    ends = [np.column_stack([outline, np.full(len(outline), z)]) for z in (low, high)]
    return hull(frame.at(np.vstack(ends)))


def _size(node: WbtNode, frame: NodeFrame, default: Size) -> Size:
    """Size (forward, left, up), m; the default if any is not above 0, as in Webots."""
    own: Point = default
    if frame.y_up:
        x, y, z = own_axes(default, True)
        own = (abs(x), abs(y), abs(z))
    size = flu_size(numbers(node, "size", own), frame.y_up)
    return size if min(size) > 0.0 else default


def _clamped(size: Size, least: float, most: float) -> Size:
    x, y, z = (min(max(length, least), most) for length in size)
    return x, y, z


def _box_mass(node: WbtNode, size: Size, heaviest: float) -> float | None:
    """The mass of a box, kg, clamped to limits set by its size; None if it is fixed."""
    mass, least = number(node, "mass", 0.0), math.prod(size) ** (2.0 / 3.0)
    return min(max(mass, least), heaviest * least) if mass > 0.0 else None
