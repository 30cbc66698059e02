# idea: straight lines in steps of 15 mm to a lattice turned like the arena, bang-bang
# profile: policy
import itertools
import math
import re
from collections import deque

import numpy as np
import sensors

STEP = 0.015
ROOM = 0.037 + 0.008
WORLD = (sensors.HERE / "world.wbt").read_text(encoding="utf-8")
ROUTE = []


def after(word, text, count, default):
    rest = text.partition(f" {word} ")[2].split()[:count]
    return [float(value) for value in rest] if rest else list(default)


def frame(text):
    text = text.split("children")[0].split("boundingObject")[0]
    x, y, _ = after("translation", text, 3, (0, 0, 0))
    return x, y, after("rotation", text, 4, (0, 0, 1, 0))[3]


def rotation(yaw):
    return np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])


def dense(corners, radius):
    """Points on an outline, 4 mm apart."""
    if len(corners) == 1:
        turns = np.arange(0, 2 * math.pi, 0.004 / radius)
        return corners + radius * np.column_stack([np.cos(turns), np.sin(turns)])
    sides = []
    for a, b in itertools.pairwise([*corners, corners[0]]):
        count = max(2, math.ceil(math.dist(a, b) / 0.004))
        sides.append(np.linspace(a, b, count))
    return np.concatenate(sides)


def shape(text):
    if " Box " in text or text.startswith("Box"):
        a, b, _ = np.array(after("size", text, 3, ())) / 2
        return np.array([(a, b), (-a, b), (-a, -b), (a, -b)]), 0.0
    if "Cylinder" in text:
        return np.zeros((1, 2)), after("radius", text, 1, ())[0]
    points = np.array(re.search(r"point \[([^]]+)", text)[1].split(), float)
    flat = np.unique(points.reshape(-1, 3)[:, :2], axis=0)
    off = flat - flat.mean(axis=0)
    return flat[np.argsort(np.arctan2(*off.T))], 0.0


def outlines():
    for node in re.split(r"\n(?=\S)", WORLD):
        if " boundingObject " not in node:
            continue
        x, y, yaw = frame(node)
        text = node.partition(" boundingObject ")[2]
        for part in text.split("Pose {")[1:] or [text]:
            u, v, turn = frame(part) if "Pose {" in text else (0.0, 0.0, 0.0)
            corners, radius = shape(part)
            own = dense(corners, radius) @ rotation(turn).T + (u, v)
            yield own @ rotation(yaw).T + (x, y)


ARENA = re.search(r"^RectangleArena \{.*?^\}", WORLD, re.MULTILINE | re.DOTALL)[0]
AT_X, AT_Y, YAW = frame(ARENA)
TURN = rotation(YAW)
SIDES = np.array(after("floorSize", ARENA, 2, (1, 1))) / 2 - ROOM
SHORE = np.concatenate(list(outlines()))


def to_world(i, j):
    return TURN @ (i * STEP, j * STEP) + (AT_X, AT_Y)


def to_lattice(point):
    own = TURN.T @ (np.asarray(point, float) - (AT_X, AT_Y)) / STEP
    return round(float(own[0])), round(float(own[1]))


def free(i, j):
    if abs(i) * STEP > SIDES[0] or abs(j) * STEP > SIDES[1]:
        return False
    return bool(np.hypot(*(SHORE - to_world(i, j)).T).min() > ROOM)


FREE = {
    (i, j)
    for i in range(-100, 101)
    for j in range(-100, 101)
    if abs(i) * STEP <= SIDES[0] and abs(j) * STEP <= SIDES[1] and free(i, j)
}


def nearest(point):
    i, j = to_lattice(point)
    return min(FREE, key=lambda c: (c[0] - i) ** 2 + (c[1] - j) ** 2)


def reset(obs):
    """Straight runs of the way with the fewest steps, and in these the fewest turns."""
    first, last = nearest(obs["pose"][:2]), nearest(obs["goal"])
    ways = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]
    queue, before = deque([last]), {last: last}
    while queue and first not in before:
        i, j = queue.popleft()
        for di, dj in ways:
            there = (i + di, j + dj)
            beside = {there, (i + di, j), (i, j + dj)}
            if beside <= FREE and there not in before:
                before[there] = (i, j)
                queue.append(there)
    way = [first]
    while way[-1] != last:
        way.append(before[way[-1]])
    ROUTE[:] = [tuple(to_world(*cell)) for cell in runs(way)]
    ROUTE.append(tuple(map(float, obs["goal"])))


def runs(way):
    """The first cell, and each where the direction changes."""
    yield way[0]
    for a, b, c in zip(way, way[1:], way[2:], strict=False):
        if (b[0] - a[0], b[1] - a[1]) != (c[0] - b[0], c[1] - b[1]):
            yield b
    yield way[-1]


def policy(obs):
    if not ROUTE:
        reset(obs)
    x, y, yaw = map(float, obs["pose"])
    while len(ROUTE) > 1 and math.dist(ROUTE[0], (x, y)) < 0.007:
        del ROUTE[0]
    dx, dy = ROUTE[0][0] - x, ROUTE[0][1] - y
    ahead = dx * math.cos(yaw) + dy * math.sin(yaw)
    aside = dy * math.cos(yaw) - dx * math.sin(yaw)
    if ahead < 0 or abs(aside) > max(0.3 * ahead, 0.004):
        fast = 0.5 if ahead < 0 or abs(aside) > ahead else 0.15
        return (-fast, fast) if aside > 0 else (fast, -fast)
    if math.hypot(dx, dy) < 0.02:
        return 0.35, 0.35
    return (0.85, 1.0) if aside > 0.001 else (1.0, 0.85) if aside < -0.001 else (1, 1)
