"""Projects primitive shapes in any pose to prisms.

All frames are FLU: cylinders, capsules and cones stand along z. A frame may scale and
shear. Lengths below `CLOSE` count as 0: a box that leans by a few micrometres has the
footprint of an upright one.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tdac_envs.core.errors import WorldError
from tdac_envs.worlds.footprint import THINNEST, Disc, Footprint, Polygon, Rectangle
from tdac_envs.worlds.wbt.frames import NodeFrame
from tdac_envs.worlds.world import Part

CLOSE = 1e-5
"""Lengths up to this are ignored, m."""
_ROUND = 40
"""Number of corners of the polygon that replaces an ellipse."""

Vectors = NDArray[np.float64]

_TURNS = 2.0 * np.pi * np.arange(_ROUND) / _ROUND
# Radius at which the polygon has the area of the unit disc.
_OUT = math.sqrt(2.0 * math.pi / (_ROUND * math.sin(2.0 * math.pi / _ROUND)))
_CIRCLE: Vectors = _OUT * np.column_stack([np.cos(_TURNS), np.sin(_TURNS)])


def box(frame: NodeFrame, size: ArrayLike) -> tuple[Part, ...]:
    """A box centred on the frame's origin."""
    halves = (frame.matrix * (np.asarray(size, np.float64) / 2)).T
    low, high = _heights(frame, float(np.abs(halves[:, 2]).sum()))
    return (Part(_zonotope(frame.origin[:2], halves[:, :2]), low, high),)


def sphere(frame: NodeFrame, radius: float) -> tuple[Part, ...]:
    """A sphere centred on the frame's origin; an ellipsoid if the frame scales."""
    rows = frame.matrix * radius
    low, high = _heights(frame, float(np.linalg.norm(rows[2])))
    _, spread, turn = np.linalg.svd(rows[:2])
    if spread[0] - spread[1] <= CLOSE:
        return (Part(_disc(frame.origin[:2], float(spread.mean())), low, high),)
    axes = rows[:2] @ turn[:2].T
    return (Part(_around(frame.origin[:2] + _CIRCLE @ axes.T), low, high),)


def cylinder(frame: NodeFrame, radius: float, height: float) -> tuple[Part, ...]:
    """A cylinder centred on the frame's origin, along its z."""
    axis = frame.matrix[:, 2] * (height / 2)
    rim = frame.matrix[:, :2] * radius
    reach = abs(axis[2]) + math.hypot(*rim[2])
    low, high = _heights(frame, reach)
    middle = frame.origin[:2]
    (_, spread, _), lean = np.linalg.svd(rim[:2]), math.hypot(*axis[:2])
    if lean <= CLOSE and spread[0] - spread[1] <= CLOSE:
        return (Part(_disc(middle, float(spread.mean())), low, high),)
    if spread[1] <= CLOSE:
        edge = np.linalg.svd(rim[:2])[0][:, 0] * spread[0]
        return (Part(_zonotope(middle, np.array([axis[:2], edge])), low, high),)
    ends = _CIRCLE @ rim[:2].T + middle
    return (Part(_around(np.vstack([ends - axis[:2], ends + axis[:2]])), low, high),)


def capsule(frame: NodeFrame, radius: float, height: float) -> tuple[Part, ...]:
    """A cylinder with a hemisphere on each end; `height` excludes these."""
    axis = frame.matrix[:, 2] * (height / 2)
    if math.hypot(*axis[:2]) <= CLOSE:
        ball = sphere(frame, radius)[0]
        low, high = ball.bottom - abs(axis[2]), ball.top + abs(axis[2])
        return (Part(ball.shape, low, high),)
    balls = [
        sphere(NodeFrame(frame.matrix, frame.origin + side * axis, False), radius)[0]
        for side in (-1.0, 1.0)
    ]
    discs = [ball.shape for ball in balls]
    low, high = min(b.bottom for b in balls), max(b.top for b in balls)
    between = _between(discs[0], discs[1])
    return (*balls, Part(between, low, high))


def cone(frame: NodeFrame, radius: float, height: float) -> tuple[Part, ...]:
    """A cone centred on the frame's origin, its apex towards +z."""
    axis = frame.matrix[:, 2] * (height / 2)
    rim = frame.matrix[:, :2] * radius
    spread = np.linalg.svd(rim[:2])[1]
    if math.hypot(*axis[:2]) <= CLOSE and spread[0] - spread[1] <= CLOSE:
        return cylinder(frame, radius, height)
    base = frame.at(np.column_stack([radius * _CIRCLE, np.full(_ROUND, -height / 2)]))
    return hull(np.vstack([base, frame.at((0.0, 0.0, height / 2))]))


def plane(frame: NodeFrame, length: float, width: float) -> tuple[Part, ...]:
    """A flat rectangle perpendicular to the frame's z."""
    return box(frame, (length, width, 0.0))


def hull(points: Vectors) -> tuple[Part, ...]:
    """The prism around points in world coordinates, shape (n, 3)."""
    low, high = float(points[:, 2].min()), float(points[:, 2].max())
    return (Part(_around(points[:, :2]), low, high),)


def _heights(frame: NodeFrame, reach: float) -> tuple[float, float]:
    z = float(frame.origin[2])
    return z - reach, z + reach


def _zonotope(middle: Vectors, halves: Vectors) -> Footprint:
    """The hull of all sums `middle` ± each half edge; a Rectangle if it is one."""
    lengths = np.hypot(*halves.T)
    first = int(lengths.argmax())
    if lengths[first] <= CLOSE:
        return _rectangle(middle, np.array([1.0, 0.0]), 0.0, 0.0)
    along = halves[first] / lengths[first]
    ahead = np.abs(halves @ along)
    aside = np.abs(halves @ np.array([-along[1], along[0]]))
    if (np.minimum(ahead, aside) <= CLOSE).all():
        length = float(ahead[ahead >= aside].sum())
        width = float(aside[aside > ahead].sum())
        return _rectangle(middle, along, length, width)
    signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * len(halves))).reshape(len(halves), -1)
    return _around(middle + signs.T @ halves)


def _rectangle(
    middle: Vectors, along: Vectors, length: float, width: float
) -> Rectangle:
    """A rectangle from half lengths; its sides are at least `THINNEST`."""
    x, y = middle.tolist()
    yaw = math.atan2(along[1], along[0])
    return Rectangle(x, y, yaw, max(2.0 * length, THINNEST), max(2.0 * width, THINNEST))


def _between(one: Footprint, other: Footprint) -> Footprint:
    """The area between two discs (or ellipses) of the same size."""
    if not (isinstance(one, Disc) and isinstance(other, Disc)):
        corners = [s.vertices for s in (one, other) if not isinstance(s, Disc)]
        return _around(np.vstack(corners))
    start, end = np.array([one.x, one.y]), np.array([other.x, other.y])
    step = (end - start) / 2
    length = math.hypot(*step)
    return _rectangle((start + end) / 2, step / length, length, one.radius)


def _around(points: Vectors) -> Footprint:
    """The hull of points, shape (n, 2); a thin rectangle if they lie on a line."""
    try:
        found = Polygon.around(points)
    except WorldError:
        found = None
    if found is not None and found.area >= THINNEST * _extent(points):
        return found
    centre = points.mean(axis=0)
    along = np.linalg.svd(points - centre)[2][0]
    ahead = (points - centre) @ along
    low, high = float(ahead.min()), float(ahead.max())
    return _rectangle(centre + along * (low + high) / 2, along, (high - low) / 2, 0.0)


def _disc(middle: Vectors, radius: float) -> Disc:
    x, y = middle.tolist()
    return Disc(x, y, max(radius, THINNEST / 2))


def _extent(points: Vectors) -> float:
    return float(np.hypot(*(points.max(axis=0) - points.min(axis=0))))
