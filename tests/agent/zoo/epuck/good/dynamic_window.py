# idea: a dynamic window: arcs are tried in the map, the best by length to go is driven
# profile: policy
import math
import re
from collections import deque
from functools import partial

import numpy as np
import sensors

P = sensors.load_params()
DT, GOAL = P["dt"], P["goal"]
BODY, AXLE = P["robot"]["radius"], P["robot"]["axle_length"]
FULL = P["robot"]["max_wheel_speed"] * P["robot"]["wheel_radius"]
RES = 0.005
FLOAT = r"[-+]?\d*\.?\d+(?:e[-+]?\d+)?"


def get(name, text, count):
    found = re.search(rf"\b{name}" + rf"\s+({FLOAT})" * count, text)
    return tuple(map(float, found.groups())) if found else (0.0,) * count


def top_nodes(text):
    """(first line, rest) of each node at the top of the file."""
    node = None
    for line in text.splitlines():
        if line.endswith("{") and line[0] not in " #":
            node = (line, [])
        elif line == "}" and node:
            yield node[0], "\n".join(node[1])
            node = None
        elif node:
            node[1].append(line)


def chain(outer, inner):
    x, y, yaw = outer
    u, v, turn = inner
    cos, sin = math.cos(yaw), math.sin(yaw)
    return x + cos * u - sin * v, y + sin * u + cos * v, yaw + turn


def pose(text):
    head = text.partition("children")[0]
    return *get("translation", head, 2), get("rotation", head, 4)[3]


class Canvas:
    """A picture of the world: distance of each cell to what is solid."""

    def __init__(self, text):
        nodes = list(top_nodes(text))
        (arena,) = (body for head, body in nodes if head.startswith("RectangleArena"))
        self.arena, self.half = pose(arena), np.array(get("floorSize", arena, 2)) / 2
        reach = float(np.hypot(*self.half))
        self.x0, self.y0 = self.arena[0] - reach, self.arena[1] - reach
        axis = np.arange(0.0, 2.0 * reach, RES)
        self.x, self.y = self.x0 + axis[None, :], self.y0 + axis[:, None]
        u, v = self.own(self.arena)
        self.room = np.minimum(self.half[0] - abs(u), self.half[1] - abs(v))
        for head, body in nodes:
            if "Solid" in head and "boundingObject" in body:
                self.solid(pose(body), body.partition("boundingObject")[2])

    def own(self, frame):
        """The cells as seen from a pose."""
        x, y, yaw = frame
        dx, dy = self.x - x, self.y - y
        cos, sin = math.cos(yaw), math.sin(yaw)
        return cos * dx + sin * dy, cos * dy - sin * dx

    def solid(self, frame, body):
        for part in body.split("Pose {")[1:]:
            self.shape(chain(frame, pose(part)), part)
        if "Pose {" not in body:
            self.shape(frame, body)

    def shape(self, frame, text):
        u, v = self.own(frame)
        if "Box" in text:
            a, b = (side / 2 for side in get("size", text, 2))
            gap = np.hypot(np.maximum(abs(u) - a, 0), np.maximum(abs(v) - b, 0))
        elif "Cylinder" in text:
            gap = np.hypot(u, v) - get("radius", text, 1)[0]
        else:
            gap = self.hull(text, u, v)
        self.room = np.minimum(self.room, gap)

    def hull(self, text, u, v):
        listed = text.partition("point [")[2].partition("]")[0].split()
        corners = {(float(a), float(b)) for a, b, _ in np.reshape(listed, (-1, 3))}
        mu, mv = np.mean(list(corners), axis=0)
        around = sorted(corners, key=lambda c: math.atan2(c[1] - mv, c[0] - mu))
        least, inside = np.inf, True
        for k, (au, av) in enumerate(around):
            du, dv = around[k - 1][0] - au, around[k - 1][1] - av
            share = ((u - au) * du + (v - av) * dv) / (du * du + dv * dv)
            share = np.clip(share, 0, 1)
            least = np.minimum(
                least, np.hypot(u - au - share * du, v - av - share * dv)
            )
            inside = inside & (du * (v - av) - dv * (u - au) <= 0)
        return np.where(inside, 0.0, least)

    def cell(self, x, y):
        return round((y - self.y0) / RES), round((x - self.x0) / RES)


MAP = Canvas((sensors.HERE / "world.wbt").read_text(encoding="utf-8"))
WIDE = MAP.room[::2, ::2] > BODY + 0.008


def to_go(goal):
    """Steps to the goal on every second cell."""
    row, column = (k // 2 for k in MAP.cell(*goal))
    found, queue = np.full(WIDE.shape, 1e6), deque([(row, column)])
    found[row, column] = 0.0
    while queue:
        j, i = queue.popleft()
        for b, a in ((j - 1, i), (j, i - 1), (j + 1, i), (j, i + 1)):
            if WIDE[b, a] and found[b, a] > 1e5:
                found[b, a] = found[j, i] + 1.0
                queue.append((b, a))
    return found


FIELD = np.kron(to_go(GOAL), np.ones((2, 2)))
WHEELS = [
    (0.6, 0.6),
    (0.6, 0.45),
    (0.45, 0.6),
    (0.6, 0.3),
    (0.3, 0.6),
    (0.4, 0.0),
    (0.0, 0.4),
    (0.2, 0.2),
    (0.3, -0.3),
    (0.1, -0.1),
    (-0.1, 0.1),
    (-0.3, 0.3),
]
STEPS = 10
PLAN = []


def arc(x, y, yaw, left, right):
    """Poses on the way of constant wheel speeds."""
    for _ in range(STEPS):
        way, turn = (left + right) / 2 * FULL * DT, (right - left) * FULL * DT / AXLE
        yaw += turn / 2
        x, y = x + way * math.cos(yaw), y + way * math.sin(yaw)
        yaw += turn / 2
        yield x, y, yaw


def price(start, wheels):
    """Length to go at the end, and how far off the way down it then looks."""
    poses = list(arc(*start, *wheels))
    cells = [MAP.cell(x, y) for x, y, _ in poses]
    tight = min(MAP.room[cell] for cell in cells) - BODY
    _x, _y, yaw = poses[-1]
    row, column = cells[-1]
    around = FIELD[row - 6 : row + 7, column - 6 : column + 7]
    b, a = np.unravel_index(np.argmin(around), around.shape)
    off = math.remainder(math.atan2(b - 6, a - 6) - yaw, math.tau)
    rest = around[3:10, 3:10].min() + 1.5 * abs(off)
    return rest + (1e4 if tight < 0.002 else 0.0) + 40.0 * max(0.0, 0.008 - tight)


def home(x, y, yaw):
    """The last centimetres."""
    off = math.remainder(math.atan2(GOAL[1] - y, GOAL[0] - x) - yaw, math.tau)
    return (0.4 - off, 0.4 + off) if abs(off) < 0.4 else (-0.3 * off, 0.3 * off)


def policy(obs):
    pose_now = tuple(map(float, obs["pose"]))
    if math.dist(pose_now[:2], GOAL) < 0.06:
        return home(*pose_now)
    if not PLAN:
        best = min(WHEELS, key=partial(price, pose_now))
        PLAN.extend([best] * 4)
    return PLAN.pop()
