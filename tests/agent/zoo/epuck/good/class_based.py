# idea: classes for everything; a recursive parser, Dijkstra, turn on the spot or drive
# profile: paper
from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import pairwise

import numpy as np
import sensors

WORLD_FILE = "world.wbt"
TIME_STEP = 32
MAX_WHEEL_SPEED = 6.28
SENSOR_RANGE = 0.07
GOAL_TOLERANCE = 0.02

WHEEL_RADIUS = 0.02
BODY = 0.037
ROOM = 0.012
SIZE = 0.008


@dataclass
class Node:
    """A node of the file: its type, the name after DEF, and its fields."""

    kind: str
    name: str = ""
    fields: dict = field(default_factory=dict)

    def numbers(self, key, default):
        """Numbers of a field."""
        return list(self.fields.get(key, default))

    def nodes(self, key):
        """Nodes of a field."""
        return [node for node in self.fields.get(key, []) if isinstance(node, Node)]


class Parser:
    """Recursive descent over the words of a `.wbt` file."""

    WORDS = re.compile(r'"[^"]*"|#[^\n]*|[{}\[\]]|[^\s,{}\[\]"#]+')

    def __init__(self, text):
        self.words = [w for w in self.WORDS.findall(text) if w[0] != "#"][::-1]

    def nodes(self):
        """All nodes at the top."""
        while self.words:
            word = self.words.pop()
            if word == "EXTERNPROTO":
                self.words.pop()
            else:
                yield self.node(word)

    def node(self, word):
        """The node that begins with a word."""
        name = ""
        if word == "DEF":
            name, word = self.words.pop(), self.words.pop()
        node = Node(word, name)
        self.words.pop()
        while (key := self.words.pop()) != "}":
            node.fields[key] = self.values()
        return node

    def values(self):
        """What follows the name of a field: numbers, texts or nodes, as a list."""
        if self.words[-1] == "[":
            self.words.pop()
            found = []
            while self.words[-1] != "]":
                found += self.values()
            self.words.pop()
            return found
        found = []
        while re.match(r"[-+.\d]", self.words[-1]):
            found.append(float(self.words.pop()))
        if found:
            return found
        word = self.words.pop()
        is_node = self.words[-1] == "{" or word == "DEF"
        return [self.node(word)] if is_node else [word.strip('"')]


class Frame:
    """A place and a turn in the plane."""

    def __init__(self, x=0.0, y=0.0, yaw=0.0):
        self.x, self.y, self.yaw = x, y, yaw
        self.cos, self.sin = math.cos(yaw), math.sin(yaw)

    @classmethod
    def of(cls, node):
        """The frame of a node."""
        x, y, _ = node.numbers("translation", (0.0, 0.0, 0.0))
        *_, up, angle = node.numbers("rotation", (0.0, 0.0, 1.0, 0.0))
        return cls(x, y, angle if up > 0 else -angle)

    def out(self, x, y):
        """A point from inside to outside."""
        return (
            self.x + self.cos * x - self.sin * y,
            self.y + self.sin * x + self.cos * y,
        )

    def into(self, x, y):
        """A point from outside to inside; arrays, too."""
        x, y = x - self.x, y - self.y
        return self.cos * x + self.sin * y, self.cos * y - self.sin * x

    def then(self, other):
        """A frame inside of this one."""
        x, y = self.out(other.x, other.y)
        return Frame(x, y, self.yaw + other.yaw)


def shapes(node, frame):
    """Boxes, discs and hulls of a boundingObject, as plain dicts."""
    if node.kind in ("Group", "Pose"):
        inner = frame.then(Frame.of(node))
        for child in node.nodes("children"):
            yield from shapes(child, inner)
    elif node.kind == "Box":
        length, width, _ = node.numbers("size", (2.0, 2.0, 2.0))
        pose = (frame.x, frame.y, frame.yaw)
        yield {"kind": "box", "pose": pose, "half": (length / 2, width / 2)}
    elif node.kind == "Cylinder":
        (radius,) = node.numbers("radius", (1.0,))
        yield {"kind": "disc", "pose": (frame.x, frame.y, 0.0), "radius": radius}
    elif node.kind == "IndexedFaceSet":
        (coordinates,) = node.nodes("coord")
        points = coordinates.numbers("point", ())
        flat = {frame.out(x, y) for x, y in np.reshape(points, (-1, 3))[:, :2].tolist()}
        mx = sum(x for x, _ in flat) / len(flat)
        my = sum(y for _, y in flat) / len(flat)
        corners = sorted(flat, key=lambda p: math.atan2(p[1] - my, p[0] - mx))
        yield {"kind": "hull", "corners": corners}


def distance(shape, x, y):
    """Distance of points (arrays) to a shape, 0 or less inside."""
    if shape["kind"] == "disc":
        return np.hypot(x - shape["pose"][0], y - shape["pose"][1]) - shape["radius"]
    if shape["kind"] == "box":
        u, v = Frame(*shape["pose"]).into(x, y)
        u, v = abs(u) - shape["half"][0], abs(v) - shape["half"][1]
        out = np.hypot(np.maximum(u, 0.0), np.maximum(v, 0.0))
        return np.where((u < 0) & (v < 0), np.maximum(u, v), out)
    corners = shape["corners"]
    least, deepest = np.inf, -np.inf
    for (ax, ay), (bx, by) in pairwise([*corners, corners[0]]):
        dx, dy = bx - ax, by - ay
        t = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)
        t = np.clip(t, 0.0, 1.0)
        least = np.minimum(least, np.hypot(x - ax - t * dx, y - ay - t * dy))
        side = (dy * (x - ax) - dx * (y - ay)) / math.hypot(dx, dy)
        deepest = np.maximum(deepest, side)
    return np.where(deepest < 0, deepest, least)


def parse_world(text):
    """See the task."""
    world = {"arena": None, "obstacles": []}
    for node in Parser(text).nodes():
        frame = Frame.of(node)
        if node.kind == "E-puck":
            world["start"] = (frame.x, frame.y, frame.yaw)
        elif node.kind == "CircleArena":
            (radius,) = node.numbers("radius", (1.0,))
            world["arena"] = {"kind": "disc", "pose": (frame.x, frame.y, 0.0)}
            world["arena"]["radius"] = radius
        elif node.kind == "RectangleArena":
            a, b = node.numbers("floorSize", (1.0, 1.0))
            world["arena"] = {"kind": "box", "half": (a / 2, b / 2)}
            world["arena"]["pose"] = (frame.x, frame.y, frame.yaw)
        elif node.kind == "Solid":
            if node.name == "GOAL":
                world["goal"] = (frame.x, frame.y)
            for body in node.nodes("boundingObject"):
                world["obstacles"] += shapes(body, frame)
    return world


def build_grid(world, resolution, inflation):
    """See the task."""
    arena = world["arena"]
    middle, reach = world["start"][:2], 2.5
    if arena:
        middle = arena["pose"][:2]
        reach = arena["radius"] if "radius" in arena else math.hypot(*arena["half"])
    x0, y0 = middle[0] - reach, middle[1] - reach
    steps = (np.arange(math.ceil(2 * reach / resolution)) + 0.5) * resolution
    xs, ys = (x0 + steps)[None, :], (y0 + steps)[:, None]
    occ = np.zeros((len(steps), len(steps)), bool)
    if arena:
        occ |= distance(arena, xs, ys) >= -inflation
    for shape in world["obstacles"]:
        occ |= distance(shape, xs, ys) <= inflation
    return occ, (x0, y0)


class Graph:
    """The free cells of a grid and the steps between them."""

    def __init__(self, occ):
        self.occ = occ
        self.rows, self.columns = occ.shape

    def free(self, cell):
        """Whether a cell is free."""
        x, y = cell
        return 0 <= x < self.columns and 0 <= y < self.rows and not self.occ[y, x]

    def steps(self, cell):
        """Where one may go from a cell, and how far that is."""
        x, y = cell
        straight = [(1, 0), (0, 1), (-1, 0), (0, -1)]
        for (a, b), (c, d) in zip(straight, straight[1:] + straight[:1], strict=True):
            one, other = (x + a, y + b), (x + c, y + d)
            if self.free(one):
                yield one, 1.0
                corner = (x + a + c, y + b + d)
                if self.free(other) and self.free(corner):
                    yield corner, math.sqrt(2)

    def path(self, start, goal):
        """The shortest one, or []."""
        if not (self.free(start) and self.free(goal)):
            return []
        length, before, queue = {start: 0.0}, {}, [(0.0, start)]
        while queue:
            so_far, cell = heappop(queue)
            if cell == goal:
                break
            if so_far > length[cell]:
                continue
            for after, step in self.steps(cell):
                if so_far + step < length.get(after, math.inf):
                    length[after], before[after] = so_far + step, cell
                    heappush(queue, (so_far + step, after))
        if goal not in length:
            return []
        path = [goal]
        while path[-1] != start:
            path.append(before[path[-1]])
        return path[::-1]


def astar(occ, start, goal):
    """See the task."""
    return Graph(np.asarray(occ)).path(tuple(map(int, start)), tuple(map(int, goal)))


def compute_wheel_speeds(pose_xy, yaw, waypoint_xy, prox):
    """Turn on the spot, or drive straight on with a little correction."""
    off = complex(*waypoint_xy) - complex(*pose_xy)
    seen = off * complex(math.cos(yaw), -math.sin(yaw))
    error = math.atan2(seen.imag, seen.real) if seen else 0.0
    if abs(error) > 0.3:
        spin = math.copysign(min(4.0, 8.0 * abs(error)), error)
        return -spin, spin
    if prox is not None and max(prox[0], prox[-1]) > 500:
        return 0.0, 0.0
    fast = min(4.9, 60.0 * abs(off) + 0.3)
    return fast * (1 - 0.9 * error), fast * (1 + 0.9 * error)


class Navigator:
    """Plans at the first observation, then goes from corner to corner."""

    def __init__(self, obs):
        world = parse_world((sensors.HERE / WORLD_FILE).read_text(encoding="utf-8"))
        self.occ, self.origin = build_grid(world, SIZE, BODY + ROOM)
        goal = tuple(map(float, obs["goal"]))
        first, last = self.cell(map(float, obs["pose"][:2])), self.cell(goal)
        cells = astar(self.occ, first, last)
        self.way = [*self.corners(cells)[1:], goal]

    def cell(self, point):
        """The free cell nearest to a point."""
        here = [(p - o) / SIZE - 0.5 for p, o in zip(point, self.origin, strict=True)]
        ys, xs = np.nonzero(~self.occ)
        best = int(np.argmin((xs - here[0]) ** 2 + (ys - here[1]) ** 2))
        return int(xs[best]), int(ys[best])

    def corners(self, cells):
        """Points where the path bends."""
        kept = [
            b
            for a, b, c in zip(cells, cells[1:], cells[2:], strict=False)
            if (b[0] - a[0], b[1] - a[1]) != (c[0] - b[0], c[1] - b[1])
        ]
        return [
            tuple(o + (k + 0.5) * SIZE for k, o in zip(cell, self.origin, strict=True))
            for cell in [cells[0], *kept, cells[-1]]
        ]

    def drive(self, obs):
        """Speeds for one step, rad/s."""
        x, y, yaw = (float(v) for v in obs["pose"])
        while len(self.way) > 1 and math.dist((x, y), self.way[0]) < 0.015:
            self.way.pop(0)
        return compute_wheel_speeds((x, y), yaw, self.way[0], None)


NAVIGATORS = []


def reset(obs):
    """A new navigator for a new episode."""
    NAVIGATORS.append(Navigator(obs))


def policy(obs):
    """Fractions of the wheels' limit."""
    if not NAVIGATORS:
        reset(obs)
    left, right = NAVIGATORS[-1].drive(obs)
    return left / MAX_WHEEL_SPEED, right / MAX_WHEEL_SPEED


class Log:
    """What happened in an episode."""

    def __init__(self, obs, info):
        self.positions, self.speeds = [], []
        self.see(obs, info)

    def see(self, obs, info):
        """Notes what the environment said."""
        self.positions.append((float(obs["pose"][0]), float(obs["pose"][1])))
        self.collisions = int(info["collisions"])
        self.goal = (float(obs["goal"][0]), float(obs["goal"][1]))

    def as_dict(self):
        """As `run_episode` returns it."""
        return {
            "positions": self.positions,
            "speeds": self.speeds,
            "collisions": self.collisions,
            "goal": self.goal,
            "dt": TIME_STEP / 1000,
        }


def run_episode(env, max_steps):
    """Drives one episode."""
    obs, info = env.reset()
    reset(obs)
    log, over = Log(obs, info), False
    while not over and len(log.speeds) < max_steps:
        action = policy(obs)
        obs, _, terminated, truncated, info = env.step(action)
        log.speeds.append(sum(action) / 2 * MAX_WHEEL_SPEED * WHEEL_RADIUS)
        log.see(obs, info)
        over = terminated or truncated
    return log.as_dict()


def main():
    """Shows it."""
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
