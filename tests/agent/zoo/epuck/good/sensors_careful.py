# idea: string pulled over a lattice of points; heeds the infra-red sensors on its way
# profile: policy
import heapq
import math
import random
import re

import numpy as np
import sensors

RADIUS = sensors.load_params()["robot"]["radius"]
CLEAR = RADIUS + 0.007
TEXT = (sensors.HERE / "world.wbt").read_text(encoding="utf-8")
NODES = re.findall(r"^(?:DEF (\w+) )?(\S+) \{\n(.*?)\n\}", TEXT, re.M | re.S)
SOFT = 600.0


def row(key, text, fallback):
    match = re.search(rf"^\s*{key}\s+(.+)$", text, re.M)
    return np.array(match[1].split(), float) if match else np.array(fallback, float)


def frame(text):
    """Rotation and translation in the plane as a 3 x 3 matrix."""
    head = text.split("children")[0].split("boundingObject")[0]
    x, y = row("translation", head, (0, 0, 0))[:2]
    cos, sin = (f(row("rotation", head, (0, 0, 1, 0))[3]) for f in (np.cos, np.sin))
    return np.array([(cos, -sin, x), (sin, cos, y), (0, 0, 1)])


def sides_of(text, matrix):
    """Sides (ax, ay, bx, by) of one shape, and by how much it is round."""
    grown = 0.0
    if "Box {" in text:
        a, b = row("size", text, (2, 2, 2))[:2] / 2
        points = np.array([(-a, -b), (a, -b), (a, b), (-a, b)])
    elif "Cylinder {" in text:
        points, grown = np.zeros((1, 2)), float(row("radius", text, [1])[0])
    else:
        words = re.search(r"point \[([^]]*)\]", text)[1].split()
        points = np.unique(np.array(words, float).reshape(-1, 3)[:, :2], axis=0)
        off = points - points.mean(axis=0)
        points = points[np.argsort(np.arctan2(off[:, 1], off[:, 0]))]
    out = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    ends = np.roll(out, -1, axis=0)
    radii = np.full(len(out), grown)
    return np.column_stack([out[:, :2], ends[:, :2], radii])


def all_sides():
    for _, kind, body in NODES:
        if kind == "RectangleArena":
            a, b = row("floorSize", body, (1, 1)) / 2
            text = f"Box {{\nsize {2 * a} {2 * b} 1\n"
            yield sides_of(text, frame(body))
        if kind == "Solid" and "boundingObject" in body:
            solid = body.split("boundingObject")[1]
            for part in solid.split("Pose {")[1:]:
                yield sides_of(part, frame(body) @ frame(part))
            if "Pose {" not in solid:
                yield sides_of(solid, frame(body))


SIDES = np.concatenate(list(all_sides()))


def gaps(points):
    """Distance of points (n, 2) to the nearest side."""
    a, d = SIDES[:, :2], SIDES[:, 2:4] - SIDES[:, :2]
    off = points[:, None, :] - a
    share = (off * d).sum(-1) / np.maximum((d * d).sum(-1), 1e-12)
    near = off - np.clip(share, 0, 1)[..., None] * d
    return (np.hypot(near[..., 0], near[..., 1]) - SIDES[:, 4]).min(axis=1)


def open_between(a, b):
    count = max(2, math.ceil(math.dist(a, b) / 0.005))
    return bool((gaps(np.linspace(a, b, count)) > CLEAR).all())


WAY, SEEN = [], {"blocked": 0}


def reset(obs):
    """Points on a lattice, searched from the goal, then pulled taut."""
    start, goal = obs["pose"][:2].astype(float), obs["goal"].astype(float)
    pitch, parents, known = 0.015, {}, {(0, 0): 0.0}
    queue = [(0.0, (0, 0))]
    steps = [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b]
    random.Random(3).shuffle(steps)
    end = None
    while queue and end is None:
        length, here = heapq.heappop(queue)
        if length > known[here]:
            continue
        cells = [(here[0] + a, here[1] + b) for a, b in steps]
        clear = gaps(goal + pitch * np.array(cells)) > CLEAR + 0.003
        for cell, step, ok in zip(cells, steps, clear, strict=True):
            far = length + math.hypot(*step)
            if ok and far < known.get(cell, math.inf):
                known[cell], parents[cell] = far, here
                heapq.heappush(queue, (far, cell))
        if np.hypot(*(goal + pitch * np.array(here) - start)) < 1.2 * pitch:
            end = here
    way = [tuple(start)]
    while end:
        way.append(tuple(goal + pitch * np.array(end)))
        end = parents.get(end)
    WAY[:] = taut([*way, tuple(goal)])


def taut(way):
    kept = [way[0]]
    while way[1:]:
        last = next((k for k in range(len(way) - 1, 1, -1) if leap(way, k)), 1)
        kept.append(way[last])
        way = way[last:]
    return kept[1:]


def leap(way, k):
    return math.dist(way[0], way[k]) < 0.6 and open_between(way[0], way[k])


def policy(obs):
    if not WAY:
        reset(obs)
    x, y, yaw = obs["pose"].tolist()
    while len(WAY) > 1 and math.dist(WAY[0], (x, y)) < 0.008:
        WAY.pop(0)
    dx, dy = WAY[0][0] - x, WAY[0][1] - y
    error = math.remainder(math.atan2(dy, dx) - yaw, 2 * math.pi)
    if abs(error) > 0.15:
        turn = math.copysign(min(0.6, abs(error)), error)
        return -turn, turn
    fast = min(0.85, 10 * math.hypot(dx, dy) + 0.05)
    front = float(max(obs["ps"][0], obs["ps"][7]))
    left, right = float(obs["ps"][5:7].max()), float(obs["ps"][1:3].max())
    if front > SOFT:
        fast *= 0.5
    # Off a wall that is near on one side only.
    lean = 0.1 * ((right > SOFT) - (left > SOFT))
    return fast - error - lean, fast + error + lean
