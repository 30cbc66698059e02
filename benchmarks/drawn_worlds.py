"""Random worlds, and the distance from a point to their obstacles."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

Point = tuple[float, float]
Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Drawn:
    """A world drawn at random.

    Attributes:
        text: Text of its file.
        start: x, y in m and yaw in rad.
        goal: x, y in m.
        floor: Outline of the arena, shape (n, 2), m.
        solids: Outline of each solid piece, shape (n, 2), m.
    """

    text: str
    start: tuple[float, float, float]
    goal: Point
    floor: Array
    solids: tuple[Array, ...]

    @classmethod
    def at_random(cls, draw: random.Random) -> Drawn:
        """A turned arena with a few obstacles."""
        x, y, yaw = draw.uniform(-2, 2), draw.uniform(-2, 2), draw.uniform(-3, 3)
        a, b = draw.uniform(1.2, 1.8), draw.uniform(0.9, 1.3)
        if draw.random() < 0.5:
            floor = _moved(_rectangle(a, b), x, y, yaw)
            size = f"rotation 0 0 1 {yaw}\n  floorSize {a} {b}"
            arena = f"RectangleArena {{\n  translation {x} {y} 0\n  {size}\n}}"
        else:
            floor = _moved(_circle(a / 2), x, y, 0.0)
            arena = f"CircleArena {{\n  translation {x} {y} 0\n  radius {a / 2}\n}}"
        here = [_within(draw, x, y, yaw, 0.7) for _ in range(7)]
        start, goal = (*here[0], draw.uniform(-3, 3)), here[1]
        nodes = [arena, _robot(start), _mark(goal)]
        solids: list[Array] = []
        for kind, place in zip("BCRGB", here[2:], strict=True):
            node, outlines = _thing(kind, place, draw)
            nodes.append(node)
            solids += outlines
        draw.shuffle(nodes)
        text = "#VRML_SIM R2025a utf8\n\n" + "\n".join(nodes) + "\n"
        return cls(text, start, goal, floor, tuple(solids))


def _within(draw: random.Random, x: float, y: float, yaw: float, span: float) -> Point:
    u, v = draw.uniform(-0.5, 0.5) * span, draw.uniform(-0.5, 0.5) * span
    point = _moved(np.array([(u, v)]), x, y, yaw)[0]
    return round(float(point[0]), 4), round(float(point[1]), 4)


def _rectangle(a: float, b: float) -> Array:
    return np.array([(-a, -b), (a, -b), (a, b), (-a, b)]) / 2


def _circle(radius: float) -> Array:
    turns = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    return radius * np.column_stack([np.cos(turns), np.sin(turns)])


def _moved(points: Array, x: float, y: float, yaw: float) -> Array:
    turn = np.array([(np.cos(yaw), np.sin(yaw)), (-np.sin(yaw), np.cos(yaw))])
    return np.asarray(points @ turn + (x, y))


def _robot(start: tuple[float, float, float]) -> str:
    x, y, yaw = start
    return f"E-puck {{\n  translation {x} {y} 0\n  rotation 0 0 1 {yaw}\n}}"


def _mark(goal: Point) -> str:
    x, y = goal
    return f'DEF GOAL Solid {{\n  translation {x} {y} 0.001\n  name "GOAL"\n}}'


def _thing(kind: str, place: Point, draw: random.Random) -> tuple[str, list[Array]]:
    """Node and outlines of a box, a cylinder, a rock or a group of boxes."""
    (x, y), yaw = place, draw.uniform(-3, 3)
    a, b = draw.uniform(0.08, 0.3), draw.uniform(0.03, 0.08)
    if kind == "C":
        body = f"Cylinder {{\n    height 0.1\n    radius {b}\n  }}"
        return _solid(x, y, 0.0, body), [_moved(_circle(b), x, y, 0.0)]
    if kind == "R":
        turns = np.sort(np.arange(7) + np.array([draw.random() for _ in range(7)]) / 2)
        flat = a / 2 * np.column_stack([np.cos(turns * 0.89), np.sin(turns * 0.89)])
        return _solid(x, y, yaw, _prism(flat)), [_moved(flat, x, y, yaw)]
    if kind == "G":
        poses = [(0.1, 0.02, 0.4), (-0.08, 0.05, -1.0)]
        parts = "".join(_pose(*pose, _box(a, b)) for pose in poses)
        body = f"Group {{\n    children [\n{parts}    ]\n  }}"
        inner = [_moved(_rectangle(a, b), *pose) for pose in poses]
        return _solid(x, y, yaw, body), [_moved(part, x, y, yaw) for part in inner]
    return _solid(x, y, yaw, _box(a, b)), [_moved(_rectangle(a, b), x, y, yaw)]


def _solid(x: float, y: float, yaw: float, body: str) -> str:
    return (
        f"Solid {{\n  translation {x} {y} 0.05\n  rotation 0 0 1 {yaw}\n"
        f'  name "a thing"\n  boundingObject {body}\n}}'
    )


def _box(a: float, b: float) -> str:
    return f"Box {{\n    size {a} {b} 0.1\n  }}"


def _pose(x: float, y: float, yaw: float, body: str) -> str:
    return (
        f"      Pose {{\n        translation {x} {y} 0\n        rotation 0 0 1 {yaw}\n"
        f"        children [\n          {body}\n        ]\n      }}\n"
    )


def _prism(flat: Array) -> str:
    count = len(flat)
    points = [f"{u:.9f} {v:.9f} {z}" for z in (-0.05, 0.05) for u, v in flat]
    faces = [list(range(count))[::-1], list(range(count, 2 * count))]
    for k in range(count):
        after = (k + 1) % count
        faces.append([k, after, count + after, count + k])
    rows = "\n        ".join(points)
    sides = "\n      ".join(" ".join(map(str, [*face, -1])) for face in faces)
    return (
        "IndexedFaceSet {\n    coord Coordinate {\n      point [\n"
        f"        {rows}\n      ]\n    }}\n    coordIndex [\n      {sides}\n    ]\n  }}"
    )


def points_in(drawn: Drawn, draw: random.Random) -> Iterator[Point]:
    """Points on the floor and around it, and the centre of each solid piece."""
    low, high = drawn.floor.min(axis=0) - 0.1, drawn.floor.max(axis=0) + 0.1
    for _ in range(250):
        yield draw.uniform(low[0], high[0]), draw.uniform(low[1], high[1])
    for outline in drawn.solids:
        x, y = outline.mean(axis=0)
        yield float(x), float(y)


def room_at(drawn: Drawn, x: float, y: float) -> float:
    """Distance to the nearest solid, negative inside it or beyond the floor, m."""
    least = _depth(drawn.floor, x, y)
    for outline in drawn.solids:
        least = min(least, -_depth(outline, x, y))
    return least


def _depth(outline: Array, x: float, y: float) -> float:
    """Distance from a point to an outline, positive inside and negative outside, m."""
    ends = np.roll(outline, -1, axis=0)
    share = np.linspace(0.0, 1.0, 600 if len(outline) < 50 else 4)[:, None, None]
    dense = (outline + share * (ends - outline)).reshape(-1, 2)
    gap = float(np.hypot(*(dense - (x, y)).T).min())
    return gap if Outline(outline).contains_point((x, y)) else -gap
