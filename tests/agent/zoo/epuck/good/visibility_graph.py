# idea: grown outlines of all things, straight lines between their corners, Dijkstra
# profile: policy
import heapq
import json
import math
import re
from itertools import combinations, pairwise

import numpy as np
import sensors

BODY = 0.037
GROWN, KEEP = BODY + 0.012, BODY + 0.006
TEXT = (sensors.HERE / "world.wbt").read_text(encoding="utf-8")
MAX = json.loads((sensors.HERE / "params.json").read_text())["robot"]["max_wheel_speed"]


def values(text, name, default=(0.0, 0.0, 1.0, 0.0)):
    found = re.search(rf"^ *{name} ([-+.e\d ]+)$", text, re.MULTILINE)
    return tuple(map(float, found[1].split())) if found else default


def blocks(kind):
    pattern = rf"^(?:DEF \S+ )?{kind} \{{\n(.*?)^\}}"
    return re.findall(pattern, TEXT, re.MULTILINE | re.DOTALL)


def turned(points, pose):
    x, y, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    return [(x + cos * u - sin * v, y + sin * u + cos * v) for u, v in points]


def pose_in(text):
    head = text.split("children")[0]
    x, y, _ = values(head, "translation", (0.0, 0.0, 0.0))
    return x, y, values(head, "rotation")[3]


def hull(points):
    """Convex hull, counter-clockwise."""
    points, half = sorted(set(points)), []
    for way in (points, points[::-1]):
        chain = []
        for x, y in way:
            while len(chain) > 1:
                (ax, ay), (bx, by) = chain[-2:]
                if (bx - ax) * (y - ay) > (by - ay) * (x - ax):
                    break
                chain.pop()
            chain.append((x, y))
        half.append(chain[:-1])
    return half[0] + half[1]


def circle(radius):
    turns = [k * math.pi / 4 for k in range(8)]
    reach = radius / math.cos(math.pi / 8)
    return [(reach * math.cos(turn), reach * math.sin(turn)) for turn in turns]


def flat_shape(text):
    if "IndexedFaceSet" in text:
        listed = re.search(r"point \[([^]]*)\]", text)[1].split()
        points = list(map(float, listed))
        return list(zip(points[::3], points[1::3], strict=True))
    if "Cylinder" in text:
        return circle(values(text, "radius")[0])
    a, b, _ = (side / 2 for side in values(text, "size"))
    return [(-a, -b), (a, -b), (a, b), (-a, b)]


def things():
    """The hull of each thing; a pipe is as good as full."""
    for body in blocks("Solid"):
        head, solid, shape = body.partition("boundingObject")
        if not solid:
            continue
        parts = shape.split("Pose {")
        points = flat_shape(shape) if len(parts) == 1 else []
        for part in parts[1:]:
            points += turned(flat_shape(part), pose_in(part))
        yield hull(turned(points, pose_in(head)))


def walls():
    """The four sides of the arena as thin things."""
    (arena,) = blocks("RectangleArena")
    a, b = (side / 2 for side in values(arena, "floorSize"))
    corners = turned([(-a, -b), (a, -b), (a, b), (-a, b)], pose_in(arena))
    return [list(pair) for pair in pairwise([*corners, corners[0]])]


THINGS = [*things(), *walls()]
SIDES = np.array(
    [(*begin, *end) for thing in THINGS for begin, end in pairwise([*thing, thing[0]])]
)


def grown(thing):
    """Corners of a thing that has grown by the body and a margin."""
    around = circle(GROWN)
    return hull([(x + u, y + v) for x, y in thing for u, v in around])


def is_clear(begin, end):
    """Whether the body gets straight from one point to another."""
    steps = max(2, math.ceil(math.dist(begin, end) / 0.004))
    xs, ys = np.linspace(begin, end, steps).T[:, :, None]
    ax, ay, bx, by = SIDES.T
    dx, dy = bx - ax, by - ay
    share = ((xs - ax) * dx + (ys - ay) * dy) / np.maximum(dx**2 + dy**2, 1e-12)
    share = np.clip(share, 0.0, 1.0)
    gap = np.hypot(xs - ax - share * dx, ys - ay - share * dy)
    return bool(gap.min() >= KEEP)


def is_room(point):
    """Whether a corner is in no other grown thing."""
    return is_clear(point, point)


CORNERS = [point for thing in THINGS for point in grown(thing) if is_room(point)]
WAY = []


def links():
    """Straight ways between corners, both ways."""
    found = {index: [] for index in range(len(CORNERS))}
    for a, b in combinations(found, 2):
        far = math.dist(CORNERS[a], CORNERS[b])
        if far < 0.5 and is_clear(CORNERS[a], CORNERS[b]):
            found[a].append((b, far))
            found[b].append((a, far))
    return found


LINKS = links()


def shortest(start, goal):
    """Corners of the shortest way from start to goal."""
    first = [(k, math.dist(start, c)) for k, c in enumerate(CORNERS)]
    nearest = sorted(first, key=lambda item: item[1])
    seen = [item for item in nearest if is_clear_start(start, CORNERS[item[0]])]
    queue = [(far, k, (k,)) for k, far in seen[:12]]
    heapq.heapify(queue)
    done = set()
    while queue:
        length, k, way = heapq.heappop(queue)
        if k in done:
            continue
        done.add(k)
        if is_clear(CORNERS[k], goal):
            return [CORNERS[index] for index in way]
        for other, far in LINKS[k]:
            if other not in done:
                heapq.heappush(queue, (length + far, other, (*way, other)))
    return []


def is_clear_start(start, corner):
    """As `is_clear`; a start may be nearer to a thing than the margin."""
    ahead = 0.01 / max(math.dist(start, corner), 0.01)
    moved = [s + ahead * (c - s) for s, c in zip(start, corner, strict=True)]
    return is_clear(moved, corner)


def reset(obs):
    start, goal = obs["pose"][:2].tolist(), tuple(obs["goal"].tolist())
    WAY[:] = [*([] if is_clear(start, goal) else shortest(start, goal)), goal]


def policy(obs):
    if not WAY:
        reset(obs)
    x, y, yaw = obs["pose"].tolist()
    while len(WAY) > 1 and math.dist(WAY[0], (x, y)) < 0.006:
        WAY.pop(0)
    error = math.atan2(WAY[0][1] - y, WAY[0][0] - x) - yaw
    error = (error + math.pi) % (2 * math.pi) - math.pi
    if abs(error) > 0.2:
        spin = math.copysign(0.5, error) * min(1.0, 2 * abs(error))
        return -spin, spin
    fast = min(0.75, 8.0 * math.dist(WAY[0], (x, y)) + 0.05)
    return fast - error, fast + error
