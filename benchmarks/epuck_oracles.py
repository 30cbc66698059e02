"""What the functions of an e-puck's controller must answer, computed without ours.

Worlds are drawn and written here, points are tested against outlines that are sampled,
and the wheels turn a robot that is integrated in small steps.
"""

from __future__ import annotations

import ast
import math
import random
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

from benchmarks.independent_oracles import (
    guard_faults,
    octile_length,
    random_map,
    step_fault,
)
from tdac_agent.sandbox import Child
from tdac_agent.task import Task

Point = tuple[float, float]
Array = NDArray[np.float64]
SEED = 20_250_112
WHEEL, AXLE = 0.02, 0.052


def contract_violations(child: Child, task: Task, text: str) -> Iterator[str]:
    """What the file and its functions do against the contract of profile `paper`."""
    yield from guard_faults(ast.parse(text))
    yield from _constants(child, task)
    draw = random.Random(SEED)
    for _ in range(4):
        yield from _world(child, Drawn.at_random(draw), draw)
    for _ in range(40):
        yield from _planning(child, draw)
    yield from _steering(child, task, draw)


def _constants(child: Child, task: Task) -> Iterator[str]:
    wanted = {
        "TIME_STEP": 1000 * task.nominal.dt,
        "MAX_WHEEL_SPEED": 6.28,
        "SENSOR_RANGE": 0.07,
        "GOAL_TOLERANCE": task.nominal.goal_tolerance,
    }
    for name, value in wanted.items():
        found = child.get(name)
        if not isinstance(found, int | float) or abs(found - value) > 1e-6 * value:
            yield f"{name} is {found!r}"
    if not str(child.get("WORLD_FILE")).endswith("world.wbt"):
        yield f"WORLD_FILE is {child.get('WORLD_FILE')!r}"


@dataclass(frozen=True, slots=True)
class Drawn:
    """A world drawn at random.

    Attributes:
        text: Of its file.
        start: x, y, yaw.
        goal: x, y.
        floor: Outline of the arena.
        solids: Outline of each piece that is solid.
    """

    text: str
    start: tuple[float, float, float]
    goal: Point
    floor: Array
    solids: tuple[Array, ...]

    @classmethod
    def at_random(cls, draw: random.Random) -> Drawn:
        """A turned arena with a few things in it."""
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
    return points @ turn + (x, y)


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
    points = [f"{u:.9f} {v:.9f} {z}" for z in (-0.05, 0.05) for u, v in flat]
    rows = "\n        ".join(points)
    return (
        "IndexedFaceSet {\n    coord Coordinate {\n      point [\n"
        f"        {rows}\n      ]\n    }}\n  }}"
    )


def _world(child: Child, drawn: Drawn, draw: random.Random) -> Iterator[str]:
    """`parse_world` and `build_grid` on a world that was drawn."""
    world = child.call("parse_world", (drawn.text,))
    try:
        start, goal = (
            [float(v) for v in world["start"]],
            list(map(float, world["goal"])),
        )
    except (KeyError, TypeError, ValueError) as error:
        yield f"parse_world: {type(error).__name__}"
        return
    if {"arena", "obstacles"} - set(world) or (len(start), len(goal)) != (3, 2):
        yield "parse_world: entries are missing"
        return
    turn = math.remainder(start[2] - drawn.start[2], math.tau)
    off = max(math.dist(start[:2], drawn.start[:2]), math.dist(goal, drawn.goal))
    if not (off < 2e-3 and abs(turn) < 2e-2):
        yield f"parse_world: start {start}, goal {goal}"
    for inflation in (0.0, draw.choice([0.02, 0.05, 0.08])):
        yield from _grid(child, drawn, world, inflation, draw)


def _grid(
    child: Child, drawn: Drawn, world: Any, inflation: float, draw: random.Random
) -> Iterator[str]:
    size = draw.choice([0.012, 0.015, 0.02])
    grid = child.call("build_grid", (world, size, inflation))
    try:
        occ, (x0, y0) = grid
        occ, x0, y0 = np.asarray(occ), float(x0), float(y0)
    except (TypeError, ValueError):
        yield "build_grid: not (occ, (x0, y0))"
        return
    if occ.ndim != 2 or occ.dtype != bool:
        yield f"build_grid: {occ.ndim} dimensions of {occ.dtype}"
        return
    for x, y in _points(drawn, draw):
        room = drawn_room(drawn, x, y) - inflation
        if abs(room) < size + 2e-3:
            continue
        column, row = math.floor((x - x0) / size), math.floor((y - y0) / size)
        inside = 0 <= row < occ.shape[0] and 0 <= column < occ.shape[1]
        if (not inside or occ[row, column]) != (room < 0.0):
            yield f"build_grid: ({x:.3f}, {y:.3f}), inflation {inflation}"
            return


def _points(drawn: Drawn, draw: random.Random) -> Iterator[Point]:
    """All over the floor and around it, and in each thing."""
    low, high = drawn.floor.min(axis=0) - 0.1, drawn.floor.max(axis=0) + 0.1
    for _ in range(250):
        yield draw.uniform(low[0], high[0]), draw.uniform(low[1], high[1])
    for outline in drawn.solids:
        x, y = outline.mean(axis=0)
        yield float(x), float(y)


def drawn_room(drawn: Drawn, x: float, y: float) -> float:
    """Distance to what is solid, negative in it or beyond the floor, m."""
    least = _depth(drawn.floor, x, y)
    for outline in drawn.solids:
        least = min(least, -_depth(outline, x, y))
    return least


def _depth(outline: Array, x: float, y: float) -> float:
    """How deep a point is within an outline; negative outside of it."""
    ends = np.roll(outline, -1, axis=0)
    share = np.linspace(0.0, 1.0, 60 if len(outline) < 50 else 4)[:, None, None]
    dense = (outline + share * (ends - outline)).reshape(-1, 2)
    gap = float(np.hypot(*(dense - (x, y)).T).min())
    return gap if Outline(outline).contains_point((x, y)) else -gap


def _planning(child: Child, draw: random.Random) -> Iterator[str]:
    cells = random_map(draw, draw.choice([0.0, 0.15, 0.3, 0.4]))
    for _ in range(3):
        start, goal = (
            (draw.randrange(len(cells[0])), draw.randrange(len(cells)))
            for _ in range(2)
        )
        path = child.call("astar", (np.array(cells), start, goal))
        best = octile_length(cells, start, goal)
        if not isinstance(path, list) or not all(map(_is_cell, path)):
            yield f"astar: no list of cells: {path!r:.60}"
            return
        reason = step_fault(cells, [tuple(cell) for cell in path], start, goal, best)
        if reason:
            yield f"astar {start} -> {goal}: {reason}"


def _is_cell(value: Any) -> bool:
    whole = isinstance(value, tuple | list) and len(value) == 2
    return whole and all(isinstance(v, int | np.integer) for v in value)


def _steering(child: Child, task: Task, draw: random.Random) -> Iterator[str]:
    """What `compute_wheel_speeds` promises, at random places."""
    for _ in range(12):
        pose = draw.uniform(-2, 2), draw.uniform(-2, 2), draw.uniform(-3.1, 3.1)
        left, right = _wheels(child, pose, 0.3, 0.0, None)
        if not min(left, right) > 0 or abs(left - right) > 0.05 * max(left, right):
            yield f"straight ahead: ({left:.2f}, {right:.2f})"
        angle = draw.uniform(0.35, 2.4)
        one = _wheels(child, pose, 0.25, angle, None)
        other = _wheels(child, pose, 0.25, -angle, None)
        if not (one[1] > one[0] and other[0] > other[1]):
            yield f"{angle:.2f} rad aside: {one}, {other}"
        if not np.allclose(one, other[::-1], atol=0.011):
            yield f"mirrored: {one}, {other}"
        left, right = _wheels(child, pose, 0.3, math.pi - 0.01, None)
        if not abs(left - right) >= 0.5:
            yield f"behind: ({left:.2f}, {right:.2f})"
        near = [2000.0, *[67.19] * 6, 2000.0]
        left, right = _wheels(child, pose, 0.3, 0.0, near)
        forward = (left + right) / 2
        if not (forward <= 0.15 * 6.28 or forward <= abs(right - left) / 2):
            yield f"blocked: ({left:.2f}, {right:.2f})"
    for angle in (-2.7, -0.9, 0.3, 1.9):
        nearest = _drive(child, (-0.7, 0.4, -2.2), angle, task.nominal.dt)
        if nearest > task.nominal.goal_tolerance:
            yield f"a waypoint {angle} rad aside: {nearest:.3f} m from it at best"


def _wheels(
    child: Child,
    pose: tuple[float, float, float],
    far: float,
    angle: float,
    prox: list[float] | None,
) -> tuple[float, float]:
    """Wheel speeds towards a point so far away at an angle; NaN where they are not."""
    x, y, yaw = pose
    target = x + far * math.cos(yaw + angle), y + far * math.sin(yaw + angle)
    found = child.call("compute_wheel_speeds", ((x, y), yaw, target, prox))
    try:
        left, right = map(float, found)
    except (TypeError, ValueError):
        return math.nan, math.nan
    return (left, right) if max(abs(left), abs(right)) <= 6.2801 else (math.nan,) * 2


def _drive(
    child: Child, pose: tuple[float, float, float], angle: float, dt: float
) -> float:
    """How near it gets to a waypoint 0.3 m away in 20 s, m."""
    x, y, yaw = pose
    target = x + 0.3 * math.cos(yaw + angle), y + 0.3 * math.sin(yaw + angle)
    nearest = 0.3
    for _ in range(round(20.0 / dt)):
        off = math.dist((x, y), target)
        bearing = math.atan2(target[1] - y, target[0] - x) - yaw
        left, right = _wheels(child, (x, y, yaw), off, bearing, None)
        if math.isnan(left):
            return math.inf
        for _ in range(8):
            x += (left + right) / 2 * WHEEL * math.cos(yaw) * dt / 8
            y += (left + right) / 2 * WHEEL * math.sin(yaw) * dt / 8
            yaw += (right - left) * WHEEL / AXLE * dt / 8
        nearest = min(nearest, math.dist((x, y), target))
        if nearest <= 0.01:
            break
    return nearest
