"""Independent checks of the functions of an e-puck's controller.

Worlds are random, points are tested against sampled outlines, and the motion of the
robot is integrated in small steps.
"""

from __future__ import annotations

import ast
import math
import random
from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.drawn_worlds import Drawn, points_in, room_at
from benchmarks.independent_oracles import (
    guard_faults,
    octile_length,
    random_map,
    step_fault,
)
from tdac_agent.sandbox import Child
from tdac_agent.tasks.task import Task

SEED = 20_250_112
WHEEL, AXLE = 0.02, 0.057


def contract_violations(child: Child, task: Task, text: str) -> Iterator[str]:
    """Violations of the contract of profile `paper` by a file and its functions."""
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


def _world(child: Child, drawn: Drawn, draw: random.Random) -> Iterator[str]:
    """Checks `parse_world` and `build_grid` on a random world."""
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
    for x, y in points_in(drawn, draw):
        room = room_at(drawn, x, y) - inflation
        if abs(room) < size + 2e-3:
            continue
        column, row = math.floor((x - x0) / size), math.floor((y - y0) / size)
        inside = 0 <= row < occ.shape[0] and 0 <= column < occ.shape[1]
        if (not inside or occ[row, column]) != (room < 0.0):
            yield f"build_grid: ({x:.3f}, {y:.3f}), inflation {inflation}"
            return


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
    """Checks the contract of `compute_wheel_speeds` at random poses."""
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
    """Wheel speeds towards a point at distance `far`; NaN if they are invalid."""
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
    """Nearest distance to a waypoint, which is 0.3 m away, within 20 s, m."""
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
