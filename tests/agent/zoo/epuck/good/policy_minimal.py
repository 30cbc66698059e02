# idea: as little as will do: a wave from the goal over 15 mm cells, steering downwards
# profile: policy
import math
import re
from collections import deque

import sensors

PARAMS = sensors.load_params()
WORLD = (sensors.HERE / "world.wbt").read_text(encoding="utf-8")
CELL = 0.015
KEEP_OFF = PARAMS["robot"]["radius"] + 0.009


def numbers(text, name):
    """Numbers after a field, zeros where it is missing."""
    found = re.search(rf"\b{name}((?: [-+.e\d]+)+)", text)
    return [float(word) for word in found[1].split()] if found else [0.0] * 4


def place(text):
    """Of a node in the plane."""
    head = text.partition("children")[0]
    return *numbers(head, "translation")[:2], numbers(head, "rotation")[3]


def pieces():
    """Each obstacle: pose, and half sides of a box or corners or a radius."""
    for body in re.findall(r"^Solid \{\n(.*?)^\}", WORLD, re.M | re.S):
        head, found, shape = body.partition("boundingObject")
        x, y, yaw = place(head)
        parts = shape.split("Pose {")[1:] or [shape]
        for part in parts if found else []:
            u, v, turn = place(part) if "children" in part else (0.0, 0.0, 0.0)
            at_x = x + u * math.cos(yaw) - v * math.sin(yaw)
            at_y = y + u * math.sin(yaw) + v * math.cos(yaw)
            yield (at_x, at_y, yaw + turn), outline(part)


def outline(part):
    """Corners of a shape, or its radius."""
    if "Box" in part:
        a, b = (v / 2 for v in numbers(part, "size")[:2])
        return [(-a, -b), (a, -b), (a, b), (-a, b)]
    if "Cylinder" in part:
        return numbers(part, "radius")[0]
    words = re.search(r"point \[([^]]*)", part)[1].split()
    points = sorted(
        {(float(x), float(y)) for x, y in zip(words[::3], words[1::3], strict=True)}
    )
    middle = [sum(axis) / len(points) for axis in zip(*points, strict=True)]
    return sorted(points, key=lambda p: math.atan2(p[1] - middle[1], p[0] - middle[0]))


def gap(pose, shape, x, y):
    """Distance from a point to a piece."""
    x, y = x - pose[0], y - pose[1]
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x, y = cos * x + sin * y, cos * y - sin * x
    if isinstance(shape, float):
        return math.hypot(x, y) - shape
    least, inside = math.inf, True
    for (ax, ay), (bx, by) in zip(shape, shape[1:] + shape[:1], strict=True):
        dx, dy = bx - ax, by - ay
        share = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy or 1.0)
        share = min(max(share, 0.0), 1.0)
        least = min(least, math.hypot(x - ax - share * dx, y - ay - share * dy))
        inside = inside and dx * (y - ay) - dy * (x - ax) >= 0.0
    return 0.0 if inside else least


PIECES = list(pieces())
ARENA = re.search(r"^RectangleArena \{\n(.*?)^\}", WORLD, re.M | re.S)[1]
ARENA_X, ARENA_Y, ARENA_YAW = place(ARENA)
HALF = [v / 2 for v in numbers(ARENA, "floorSize")]


def is_free(cell):
    """Whether the body has room in the middle of a cell."""
    x, y = cell[0] * CELL, cell[1] * CELL
    dx, dy = x - ARENA_X, y - ARENA_Y
    cos, sin = math.cos(ARENA_YAW), math.sin(ARENA_YAW)
    room = min(HALF[0] - abs(cos * dx + sin * dy), HALF[1] - abs(cos * dy - sin * dx))
    return room > KEEP_OFF and all(gap(*p, x, y) > KEEP_OFF for p in PIECES)


def cell_of(point):
    return round(float(point[0]) / CELL), round(float(point[1]) / CELL)


def wave(goal):
    """Number of cells to the goal, breadth first."""
    steps, queue, free = {goal: 0}, deque([goal]), {}
    while queue:
        here = queue.popleft()
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            there = here[0] + dx, here[1] + dy
            if there not in steps and free.setdefault(there, is_free(there)):
                steps[there] = steps[here] + 1
                queue.append(there)
    return steps


STEPS = wave(cell_of(PARAMS["goal"]))


def target(x, y):
    """The cell to drive to: the lowest within two cells."""
    i, j = cell_of((x, y))
    around = [(a, b) for a in range(i - 2, i + 3) for b in range(j - 2, j + 3)]
    known = [cell for cell in around if cell in STEPS]
    best = min(known, key=lambda c: (STEPS[c], math.dist(c, (i, j))))
    return best[0] * CELL, best[1] * CELL


def policy(obs):
    x, y, heading = map(float, obs["pose"])
    goal = tuple(map(float, obs["goal"]))
    aim = goal if math.dist(goal, (x, y)) < 3 * CELL else target(x, y)
    error = math.remainder(math.atan2(aim[1] - y, aim[0] - x) - heading, math.tau)
    turn = max(-0.4, min(0.4, 0.8 * error))
    forward = 0.6 if abs(error) < 0.4 else 0.0
    return forward - turn, forward + turn
