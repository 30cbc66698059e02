"""Drives an e-puck through a flat Webots world: parse, plan once, follow by the true pose."""

import heapq
import math
import re

import numpy as np

import sensors

WORLD_FILE = "world.wbt"
TIME_STEP = 32
MAX_WHEEL_SPEED = 6.28
SENSOR_RANGE = 0.07
GOAL_TOLERANCE = 0.02

RADIUS = 0.037
MAX_SPEED = 0.1256
DT = 0.032
BODY_LOW = 0.0025
BODY_HIGH = 0.0475
OPEN_MARGIN = 0.35
MAX_CELLS = 300000.0

# (resolution, extra margin), from tight to roomy
LEVELS = ((0.005, 0.0015), (0.01, 0.003), (0.01, 0.01), (0.01, 0.02))
LAST_RESORT = (0.004, 0.0)

PS_READINGS = (67.0, 104.0, 120.0, 158.0, 235.0, 384.0, 601.0, 1466.0, 2133.0, 4095.0)
PS_DISTANCES = (0.07, 0.06, 0.05, 0.04, 0.03, 0.02, 0.015, 0.01, 0.005, 0.0)

TOKEN_PATTERN = r'''#[^\n\r]*|"(?:\\[\s\S]|[^"\\])*"|[\[\]{}]|[^\s,\[\]{}"#]+'''
NUMBER_PATTERN = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"

IGNORED_TYPES = ("WorldInfo", "Viewpoint", "TexturedBackground",
                 "TexturedBackgroundLight", "E-puck", "CircleArena",
                 "RectangleArena", "Floor")

_CACHE = {}
_STATE = {}


# ---------------------------------------------------------------- reading the file

class Reader:
    def __init__(self, tokens):
        self.tokens = tokens
        self.pos = 0

    def peek(self):
        if self.pos < len(self.tokens):
            return self.tokens[self.pos]
        return ""

    def take(self):
        token = self.peek()
        self.pos += 1
        return token


def tokenize(text):
    tokens = []
    for match in re.finditer(TOKEN_PATTERN, text):
        token = match.group(0)
        if not token.startswith("#"):
            tokens.append(token)
    return tokens


def is_number(token):
    return re.fullmatch(NUMBER_PATTERN, token) is not None


def read_item(reader):
    token = reader.take()
    if token.startswith('"'):
        return token[1:-1]
    if is_number(token):
        return float(token)
    def_name = ""
    if token == "DEF":
        def_name = reader.take()
        token = reader.take()
    elif token == "USE":
        reader.take()
        return None
    if reader.peek() == "{":
        return read_node(reader, token, def_name)
    return token


def read_value(reader):
    token = reader.peek()
    if token in ("", "}", "]"):
        return None
    if token == "[":
        reader.take()
        items = []
        while reader.peek() not in ("", "]"):
            items.append(read_item(reader))
        reader.take()
        return items
    if is_number(token):
        numbers = []
        while is_number(reader.peek()):
            numbers.append(float(reader.take()))
        return numbers
    return read_item(reader)


def read_node(reader, type_name, def_name):
    reader.take()
    fields = {}
    while True:
        token = reader.take()
        if token == "" or token == "}":
            break
        if token in ("[", "]", "{", "hidden") or token.startswith('"') or is_number(token):
            continue
        fields[token] = read_value(reader)
    return {"type": type_name, "def": def_name, "fields": fields}


def read_nodes(text):
    reader = Reader(tokenize(text))
    nodes = []
    while True:
        token = reader.take()
        if token == "":
            break
        def_name = ""
        if token == "DEF":
            def_name = reader.take()
            token = reader.take()
        if reader.peek() == "{" and token not in ("{", "}", "[", "]"):
            nodes.append(read_node(reader, token, def_name))
    return nodes


def field_vector(fields, name, default):
    value = fields.get(name)
    result = [float(v) for v in default]
    if isinstance(value, list):
        for i in range(min(len(value), len(result))):
            if isinstance(value[i], float):
                result[i] = value[i]
    return result


def field_number(fields, name, default):
    return field_vector(fields, name, (default,))[0]


def node_pose(fields):
    x, y, z = field_vector(fields, "translation", (0.0, 0.0, 0.0))
    axis = field_vector(fields, "rotation", (0.0, 0.0, 1.0, 0.0))
    yaw = 0.0
    if axis[2] > 0.0:
        yaw = axis[3]
    elif axis[2] < 0.0:
        yaw = -axis[3]
    return (x, y, z, yaw)


def compose(parent, child):
    c = math.cos(parent[3])
    s = math.sin(parent[3])
    return (parent[0] + c * child[0] - s * child[1],
            parent[1] + s * child[0] + c * child[1],
            parent[2] + child[2],
            parent[3] + child[3])


def convex_hull(points):
    pts = sorted(set((float(p[0]), float(p[1])) for p in points))
    if len(pts) <= 2:
        return [[p[0], p[1]] for p in pts]
    lower = []
    for p in pts:
        while len(lower) >= 2 and turn_of(lower[-2], lower[-1], p) <= 0.0:
            lower.pop()
        lower.append(p)
    upper = []
    for p in reversed(pts):
        while len(upper) >= 2 and turn_of(upper[-2], upper[-1], p) <= 0.0:
            upper.pop()
        upper.append(p)
    hull = lower[:-1] + upper[:-1]
    return [[p[0], p[1]] for p in hull]


def turn_of(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def make_polygon(local_points, pose, low, high):
    c = math.cos(pose[3])
    s = math.sin(pose[3])
    points = []
    for p in local_points:
        points.append((pose[0] + c * p[0] - s * p[1], pose[1] + s * p[0] + c * p[1]))
    return {"kind": "poly", "points": convex_hull(points),
            "z0": pose[2] + low, "z1": pose[2] + high}


def collect_shapes(node, pose, parts):
    if not isinstance(node, dict):
        return
    kind = node["type"]
    fields = node["fields"]
    if kind == "Box":
        size = field_vector(fields, "size", (2.0, 2.0, 2.0))
        hx = abs(size[0]) / 2.0
        hy = abs(size[1]) / 2.0
        hz = abs(size[2]) / 2.0
        corners = ((-hx, -hy), (hx, -hy), (hx, hy), (-hx, hy))
        parts.append(make_polygon(corners, pose, -hz, hz))
    elif kind == "Cylinder":
        half = abs(field_number(fields, "height", 2.0)) / 2.0
        parts.append({"kind": "disc", "x": pose[0], "y": pose[1],
                      "r": abs(field_number(fields, "radius", 1.0)),
                      "z0": pose[2] - half, "z1": pose[2] + half})
    elif kind == "IndexedFaceSet":
        coord = fields.get("coord")
        values = []
        if isinstance(coord, dict):
            values = coord["fields"].get("point")
            if not isinstance(values, list):
                values = []
        values = [v for v in values if isinstance(v, float)]
        count = len(values) // 3
        if count > 0:
            points = [(values[3 * i], values[3 * i + 1]) for i in range(count)]
            heights = [values[3 * i + 2] for i in range(count)]
            parts.append(make_polygon(points, pose, min(heights), max(heights)))
    elif kind == "Shape":
        collect_shapes(fields.get("geometry"), pose, parts)
    else:
        here = pose
        if kind != "Group":
            here = compose(pose, node_pose(fields))
        children = fields.get("children")
        if isinstance(children, dict):
            children = [children]
        if isinstance(children, list):
            for child in children:
                collect_shapes(child, here, parts)


# ---------------------------------------------------------------- shapes

def part_outline(part):
    if part["kind"] == "disc":
        points = []
        for k in range(32):
            a = 2.0 * math.pi * k / 32.0
            points.append((part["x"] + part["r"] * math.cos(a),
                           part["y"] + part["r"] * math.sin(a)))
        return points
    return [(float(p[0]), float(p[1])) for p in part["points"]]


def part_bounds(part):
    if part["kind"] == "disc":
        return (part["x"] - part["r"], part["y"] - part["r"],
                part["x"] + part["r"], part["y"] + part["r"])
    xs = [float(p[0]) for p in part["points"]]
    ys = [float(p[1]) for p in part["points"]]
    return (min(xs), min(ys), max(xs), max(ys))


def separated(a, b):
    """True if an edge of a separates the two convex outlines."""
    n = len(a)
    for i in range(n):
        p = a[i]
        q = a[(i + 1) % n]
        nx = q[1] - p[1]
        ny = p[0] - q[0]
        length = math.hypot(nx, ny)
        if length < 1e-12:
            continue
        nx /= length
        ny /= length
        da = [nx * v[0] + ny * v[1] for v in a]
        db = [nx * v[0] + ny * v[1] for v in b]
        if max(da) <= min(db) + 1e-6 or max(db) <= min(da) + 1e-6:
            return True
    return False


def footprints_overlap(part_a, part_b):
    a = part_outline(part_a)
    b = part_outline(part_b)
    return not separated(a, b) and not separated(b, a)


def let_fall(bodies, floor_z):
    """Lowers what can move and hangs in the air, the lowest first."""
    settled = []
    movable = []
    for index, body in enumerate(bodies):
        if body["movable"]:
            movable.append((min(p["z0"] for p in body["parts"]), index))
        else:
            settled.extend(body["parts"])
    movable.sort()
    for low, index in movable:
        parts = bodies[index]["parts"]
        drop = low - floor_z
        if drop > 0.0:
            for part in parts:
                for other in settled:
                    if other["z1"] <= part["z0"] + 0.001:
                        gap = part["z0"] - other["z1"]
                        if gap < drop and footprints_overlap(part, other):
                            drop = gap
            if drop > 0.0:
                for part in parts:
                    part["z0"] -= drop
                    part["z1"] -= drop
        settled.extend(parts)


def part_distance(part, gx, gy):
    """Distance of points to a shape, 0 inside."""
    if part["kind"] == "disc":
        return np.maximum(np.hypot(gx - part["x"], gy - part["y"]) - part["r"], 0.0)
    points = part["points"]
    n = len(points)
    shape = np.broadcast(gx, gy).shape
    best = np.full(shape, np.inf)
    inside = np.full(shape, n >= 3, dtype=bool)
    for i in range(n):
        ax = float(points[i][0])
        ay = float(points[i][1])
        bx = float(points[(i + 1) % n][0])
        by = float(points[(i + 1) % n][1])
        dx = bx - ax
        dy = by - ay
        rx = gx - ax
        ry = gy - ay
        if n >= 3:
            inside &= (dx * ry - dy * rx) >= 0.0
        t = np.clip((rx * dx + ry * dy) / max(dx * dx + dy * dy, 1e-18), 0.0, 1.0)
        best = np.minimum(best, (rx - t * dx) ** 2 + (ry - t * dy) ** 2)
    return np.where(inside, 0.0, np.sqrt(best))


def arena_local(arena, gx, gy):
    c = math.cos(arena["yaw"])
    s = math.sin(arena["yaw"])
    rx = gx - arena["x"]
    ry = gy - arena["y"]
    return c * rx + s * ry, c * ry - s * rx


def arena_depth(arena, gx, gy):
    """How far inside of the wall's inner face points are (negative: outside)."""
    if arena["kind"] == "circle":
        return arena["radius"] - np.hypot(gx - arena["x"], gy - arena["y"])
    lx, ly = arena_local(arena, gx, gy)
    return np.minimum(arena["size"][0] / 2.0 - np.abs(lx),
                      arena["size"][1] / 2.0 - np.abs(ly))


def ring_distance(arena, gx, gy):
    """Distance of points to the wall itself, 0 in it."""
    depth = arena_depth(arena, gx, gy)
    thick = arena["thickness"]
    if arena["kind"] == "circle":
        beyond = np.maximum(-depth - thick, 0.0)
    else:
        lx, ly = arena_local(arena, gx, gy)
        qx = np.maximum(np.abs(lx) - arena["size"][0] / 2.0 - thick, 0.0)
        qy = np.maximum(np.abs(ly) - arena["size"][1] / 2.0 - thick, 0.0)
        beyond = np.hypot(qx, qy)
    return np.where(depth > 0.0, depth, beyond)


def arena_corners(arena, extra):
    """Corners of a rectangular arena, made larger by extra on all sides."""
    c = math.cos(arena["yaw"])
    s = math.sin(arena["yaw"])
    hx = arena["size"][0] / 2.0 + extra
    hy = arena["size"][1] / 2.0 + extra
    corners = []
    for lx, ly in ((-hx, -hy), (hx, -hy), (hx, hy), (-hx, hy)):
        corners.append((arena["x"] + c * lx - s * ly, arena["y"] + s * lx + c * ly))
    return corners


def arena_bounds(arena, extra):
    if arena["kind"] == "circle":
        r = arena["radius"] + extra
        return (arena["x"] - r, arena["y"] - r, arena["x"] + r, arena["y"] + r)
    corners = arena_corners(arena, extra)
    xs = [p[0] for p in corners]
    ys = [p[1] for p in corners]
    return (min(xs), min(ys), max(xs), max(ys))


# ---------------------------------------------------------------- the world

def read_arena(node):
    fields = node["fields"]
    x, y, z, yaw = node_pose(fields)
    arena = {"kind": "rect", "x": x, "y": y, "z": z, "yaw": yaw, "radius": 0.0,
             "size": [1.0, 1.0], "thickness": 0.0, "height": 0.0,
             "wall": False, "encloses": False}
    if node["type"] == "Floor":
        arena["size"] = field_vector(fields, "size", (10.0, 10.0))
        return arena
    arena["thickness"] = max(0.0, field_number(fields, "wallThickness", 0.01))
    arena["height"] = field_number(fields, "wallHeight", 0.1)
    if node["type"] == "CircleArena":
        arena["kind"] = "circle"
        arena["radius"] = field_number(fields, "radius", 1.0)
    else:
        arena["size"] = field_vector(fields, "floorSize", (1.0, 1.0))
    return arena


def goal_rank(node):
    named = node["fields"].get("name") == "GOAL"
    if node["def"] == "GOAL":
        return 3 if named else 2
    return 1 if named else 0


def parse_world(text):
    nodes = read_nodes(text)
    start = (0.0, 0.0, 0.0)
    start_z = 0.0
    goal = (0.0, 0.0)
    best_rank = 0
    arenas = []
    bodies = []
    for node in nodes:
        kind = node["type"]
        fields = node["fields"]
        if kind == "E-puck":
            x, y, z, yaw = node_pose(fields)
            start = (x, y, yaw)
            start_z = z
            continue
        if kind in ("CircleArena", "RectangleArena", "Floor"):
            arenas.append(read_arena(node))
            continue
        if kind in IGNORED_TYPES:
            continue
        pose = node_pose(fields)
        if kind == "Solid" and goal_rank(node) > best_rank:
            best_rank = goal_rank(node)
            goal = (pose[0], pose[1])
        bounding = fields.get("boundingObject")
        if isinstance(bounding, dict):
            parts = []
            collect_shapes(bounding, pose, parts)
            if parts:
                bodies.append({"parts": parts,
                               "movable": isinstance(fields.get("physics"), dict)})

    # the floor that the robot stands on
    floor_z = 0.0
    best_key = None
    for arena in arenas:
        if float(arena_depth(arena, start[0], start[1])) > 0.0:
            key = (0 if arena["height"] > 0.0 else 1, abs(arena["z"] - start_z))
            if best_key is None or key < best_key:
                best_key = key
                floor_z = arena["z"]

    for arena in arenas:
        arena["wall"] = bool(arena["height"] > 0.0
                             and arena["z"] + arena["height"] > floor_z + BODY_LOW
                             and arena["z"] < floor_z + BODY_HIGH)
        arena["encloses"] = bool(arena["wall"] and
                                 float(arena_depth(arena, start[0], start[1])) > 0.0)

    let_fall(bodies, floor_z)
    obstacles = []
    boxes = [(start[0], start[1], start[0], start[1]), (goal[0], goal[1], goal[0], goal[1])]
    for body in bodies:
        for part in body["parts"]:
            boxes.append(part_bounds(part))
            if (part["z1"] > floor_z + BODY_LOW + 1e-9
                    and part["z0"] < floor_z + BODY_HIGH - 1e-9):
                obstacles.append(part)

    bounds = None
    for arena in arenas:
        box = arena_bounds(arena, arena["thickness"])
        boxes.append(box)
        if arena["encloses"]:
            if bounds is None:
                bounds = list(box)
            else:
                bounds = [max(bounds[0], box[0]), max(bounds[1], box[1]),
                          min(bounds[2], box[2]), min(bounds[3], box[3])]
    if bounds is None:
        bounds = [min(b[0] for b in boxes) - OPEN_MARGIN,
                  min(b[1] for b in boxes) - OPEN_MARGIN,
                  max(b[2] for b in boxes) + OPEN_MARGIN,
                  max(b[3] for b in boxes) + OPEN_MARGIN]
    return {"start": start, "goal": goal, "arena": arenas, "obstacles": obstacles,
            "floor_z": floor_z, "bounds": bounds}


def load_world():
    if "world" not in _CACHE:
        text = (sensors.HERE / WORLD_FILE).read_text(encoding="utf-8")
        _CACHE["world"] = parse_world(text)
    return _CACHE["world"]


def build_grid(world, resolution, inflation):
    res = float(resolution)
    grow = max(0.0, float(inflation))
    xmin, ymin, xmax, ymax = [float(v) for v in world["bounds"]]
    x0 = xmin - res
    y0 = ymin - res
    nx = max(1, int(math.ceil((xmax - xmin) / res)) + 2)
    ny = max(1, int(math.ceil((ymax - ymin) / res)) + 2)
    gx = (x0 + (np.arange(nx) + 0.5) * res)[None, :]
    gy = (y0 + (np.arange(ny) + 0.5) * res)[:, None]
    occ = np.zeros((ny, nx), dtype=bool)
    for arena in world["arena"]:
        if not arena["wall"]:
            continue
        if arena["encloses"]:
            dist = arena_depth(arena, gx, gy)
        else:
            dist = ring_distance(arena, gx, gy)
        occ |= (dist <= 0.0) | (dist < grow)
    for part in world["obstacles"]:
        bx0, by0, bx1, by1 = part_bounds(part)
        ix0 = max(0, int(math.floor((bx0 - grow - x0) / res)) - 1)
        ix1 = min(nx, int(math.ceil((bx1 + grow - x0) / res)) + 1)
        iy0 = max(0, int(math.floor((by0 - grow - y0) / res)) - 1)
        iy1 = min(ny, int(math.ceil((by1 + grow - y0) / res)) + 1)
        if ix1 <= ix0 or iy1 <= iy0:
            continue
        dist = part_distance(part, gx[:, ix0:ix1], gy[iy0:iy1, :])
        occ[iy0:iy1, ix0:ix1] |= (dist <= 0.0) | (dist < grow)
    return occ, (x0, y0)


# ---------------------------------------------------------------- search

def astar(occ, start, goal):
    grid = np.asarray(occ, dtype=bool)
    if grid.ndim != 2 or grid.size == 0:
        return []
    ny, nx = grid.shape
    sx = int(start[0])
    sy = int(start[1])
    tx = int(goal[0])
    ty = int(goal[1])
    if not (0 <= sx < nx and 0 <= sy < ny and 0 <= tx < nx and 0 <= ty < ny):
        return []
    if grid[sy, sx] or grid[ty, tx]:
        return []
    if sx == tx and sy == ty:
        return [(sx, sy)]
    width = nx + 2
    padded = np.ones((ny + 2, width), dtype=np.uint8)
    padded[1:-1, 1:-1] = grid
    blocked = padded.tobytes()
    total = len(blocked)
    source = (sy + 1) * width + sx + 1
    target = (ty + 1) * width + tx + 1
    goal_col = tx + 1
    goal_row = ty + 1
    root2 = math.sqrt(2.0)
    saving = 2.0 - root2
    moves = ((1, 0, 0, 1.0), (-1, 0, 0, 1.0), (width, 0, 0, 1.0), (-width, 0, 0, 1.0),
             (width + 1, width, 1, root2), (width - 1, width, -1, root2),
             (-width + 1, -width, 1, root2), (-width - 1, -width, -1, root2))
    best = [math.inf] * total
    parent = {}
    closed = bytearray(total)
    best[source] = 0.0
    heap = [(0.0, 0.0, source)]
    found = False
    while heap:
        node = heapq.heappop(heap)[2]
        if closed[node]:
            continue
        if node == target:
            found = True
            break
        closed[node] = 1
        base = best[node]
        for step, side_a, side_b, cost in moves:
            nxt = node + step
            if blocked[nxt] or closed[nxt]:
                continue
            if side_a and (blocked[node + side_a] or blocked[node + side_b]):
                continue
            g = base + cost
            if g < best[nxt] - 1e-12:
                best[nxt] = g
                parent[nxt] = node
                row, col = divmod(nxt, width)
                dx = abs(col - goal_col)
                dy = abs(row - goal_row)
                h = dx + dy - saving * (dx if dx < dy else dy)
                heapq.heappush(heap, (g + h, h, nxt))
    if not found:
        return []
    path = []
    node = target
    while True:
        path.append((node % width - 1, node // width - 1))
        if node == source:
            break
        node = parent[node]
    path.reverse()
    return path


# ---------------------------------------------------------------- exact room of straight legs

def add_edges(points, first, second):
    n = len(points)
    for i in range(n):
        first.append((float(points[i][0]), float(points[i][1])))
        second.append((float(points[(i + 1) % n][0]), float(points[(i + 1) % n][1])))


def make_geometry(world):
    first = []
    second = []
    discs = []
    bowls = []
    for part in world["obstacles"]:
        if part["kind"] == "disc":
            discs.append((part["x"], part["y"], part["r"]))
        else:
            add_edges(part["points"], first, second)
    for arena in world["arena"]:
        if not arena["wall"]:
            continue
        if arena["kind"] == "circle":
            if arena["encloses"]:
                bowls.append((arena["x"], arena["y"], arena["radius"]))
            else:
                discs.append((arena["x"], arena["y"], arena["radius"] + arena["thickness"]))
        else:
            add_edges(arena_corners(arena, 0.0), first, second)
            if not arena["encloses"]:
                add_edges(arena_corners(arena, arena["thickness"]), first, second)
    a = np.array(first, dtype=float).reshape(-1, 2)
    b = np.array(second, dtype=float).reshape(-1, 2)
    return {"ax": a[:, 0].copy(), "ay": a[:, 1].copy(),
            "bx": b[:, 0].copy(), "by": b[:, 1].copy(),
            "discs": discs, "bowls": bowls}


def to_segments(px, py, ax, ay, bx, by):
    """Distances between points and segments, of which one may be many."""
    dx = bx - ax
    dy = by - ay
    rx = px - ax
    ry = py - ay
    t = (rx * dx + ry * dy) / np.maximum(dx * dx + dy * dy, 1e-18)
    t = np.minimum(np.maximum(t, 0.0), 1.0)
    return np.hypot(rx - t * dx, ry - t * dy)


def segment_room(geo, p, q):
    """Distance from the segment p-q to the nearest solid thing (0 where it crosses one)."""
    px = float(p[0])
    py = float(p[1])
    qx = float(q[0])
    qy = float(q[1])
    room = 10.0
    ax = geo["ax"]
    if ax.size:
        ay = geo["ay"]
        bx = geo["bx"]
        by = geo["by"]
        ux = qx - px
        uy = qy - py
        o1 = ux * (ay - py) - uy * (ax - px)
        o2 = ux * (by - py) - uy * (bx - px)
        ex = bx - ax
        ey = by - ay
        o3 = ex * (py - ay) - ey * (px - ax)
        o4 = ex * (qy - ay) - ey * (qx - ax)
        if bool(np.any((o1 * o2 < 0.0) & (o3 * o4 < 0.0))):
            return 0.0
        room = min(room,
                   float(np.min(to_segments(px, py, ax, ay, bx, by))),
                   float(np.min(to_segments(qx, qy, ax, ay, bx, by))),
                   float(np.min(to_segments(ax, ay, px, py, qx, qy))),
                   float(np.min(to_segments(bx, by, px, py, qx, qy))))
    for cx, cy, r in geo["discs"]:
        room = min(room, float(to_segments(cx, cy, px, py, qx, qy)) - r)
    for cx, cy, r in geo["bowls"]:
        room = min(room, r - max(math.hypot(px - cx, py - cy), math.hypot(qx - cx, qy - cy)))
    return max(room, 0.0)


# ---------------------------------------------------------------- planning

def goal_target(geo, goal):
    """The goal, or where the body fits better within the tolerance."""
    enough = RADIUS + 0.003
    best = goal
    best_room = segment_room(geo, goal, goal)
    if best_room >= enough:
        return best
    for ring in (0.004, 0.008, 0.012, 0.016):
        for k in range(24):
            a = 2.0 * math.pi * k / 24.0
            c = (goal[0] + ring * math.cos(a), goal[1] + ring * math.sin(a))
            if segment_room(geo, goal, c) <= 0.0:
                continue
            room = segment_room(geo, c, c)
            if room > best_room + 1e-9:
                best_room = room
                best = c
        if best_room >= enough:
            break
    return best


def nearest_free(geo, occ, origin, res, p):
    """(cell, whether it is the point's own), or None."""
    x0, y0 = origin
    ny, nx = occ.shape
    ix = int(math.floor((p[0] - x0) / res))
    iy = int(math.floor((p[1] - y0) / res))
    if 0 <= ix < nx and 0 <= iy < ny and not occ[iy, ix]:
        return (ix, iy), True
    ys, xs = np.nonzero(~occ)
    if xs.size == 0:
        return None
    cx = x0 + (xs + 0.5) * res
    cy = y0 + (ys + 0.5) * res
    dist = np.hypot(cx - p[0], cy - p[1])
    order = np.argsort(dist)[:600]
    need = min(RADIUS + 0.001, segment_room(geo, p, p)) - 1e-6
    for k in order:
        if dist[k] > 0.5:
            break
        c = (float(cx[k]), float(cy[k]))
        if segment_room(geo, p, c) >= need:
            return (int(xs[k]), int(ys[k])), False
    return None


def path_length(points):
    total = 0.0
    for i in range(len(points) - 1):
        total += math.hypot(points[i + 1][0] - points[i][0], points[i + 1][1] - points[i][1])
    return total


def plan_level(world, geo, start, target, resolution, margin):
    bounds = world["bounds"]
    area = max(1e-6, (bounds[2] - bounds[0]) * (bounds[3] - bounds[1]))
    res = max(resolution, math.sqrt(area / MAX_CELLS))
    occ, origin = build_grid(world, res, RADIUS + 0.7072 * res + margin)
    first = nearest_free(geo, occ, origin, res, start)
    last = nearest_free(geo, occ, origin, res, target)
    if first is None or last is None:
        return None
    cells = astar(occ, first[0], last[0])
    if not cells:
        return None
    points = [start]
    for ix, iy in cells:
        points.append((origin[0] + (ix + 0.5) * res, origin[1] + (iy + 0.5) * res))
    points.append(target)
    return {"points": points, "length": path_length(points), "margin": margin,
            "tight_start": not first[1], "tight_goal": not last[1]}


def smooth(geo, entry):
    """Leaves out points that a straight line can skip with the same room."""
    points = entry["points"]
    need = RADIUS + entry["margin"] - 1e-6
    last = len(points) - 1
    top = last - 1 if entry["tight_goal"] else last
    result = [points[0]]
    i = 0
    while i < last:
        j = i + 1
        if not (i == 0 and entry["tight_start"]):
            k = top
            while k > i + 1:
                if segment_room(geo, points[i], points[k]) >= need:
                    break
                k -= 1
            if k > j:
                j = k
        result.append(points[j])
        i = j
    return result


def plan(world, geo, start, goal):
    target = goal_target(geo, goal)
    found = []
    for resolution, margin in LEVELS:
        entry = plan_level(world, geo, start, target, resolution, margin)
        if entry is not None:
            found.append(entry)
    if not found:
        entry = plan_level(world, geo, start, target, LAST_RESORT[0], LAST_RESORT[1])
        if entry is not None:
            found.append(entry)
    if not found:
        return [start, target], False
    shortest = min(entry["length"] for entry in found)
    chosen = found[0]
    for entry in found:
        if entry["length"] <= 1.1 * shortest + 0.03:
            chosen = entry
    return smooth(geo, chosen), True


# ---------------------------------------------------------------- driving

def wrap_angle(angle):
    return math.atan2(math.sin(angle), math.cos(angle))


def compute_wheel_speeds(pose_xy, yaw, waypoint_xy, prox):
    dx = float(waypoint_xy[0]) - float(pose_xy[0])
    dy = float(waypoint_xy[1]) - float(pose_xy[1])
    dist = math.hypot(dx, dy)
    if dist < 0.0005:
        return (0.0, 0.0)
    error = wrap_angle(math.atan2(dy, dx) - float(yaw))
    turn = max(-4.0, min(4.0, 10.0 * error))
    gate = max(0.0, min(1.0, (0.15 - abs(error)) / 0.12))
    forward = min(5.6, 0.6 + 70.0 * dist) * gate

    if prox is not None and abs(error) < 0.5:
        near = max(float(prox[0]), float(prox[7]))
        if near >= 1000.0:
            gap = float(np.interp(near, PS_READINGS, PS_DISTANCES))
            if dist > gap:
                right_load = float(prox[0]) + float(prox[1]) + float(prox[2])
                left_load = float(prox[5]) + float(prox[6]) + float(prox[7])
                forward = 0.0
                if right_load > left_load + 1.0:
                    turn = 2.0
                elif left_load > right_load + 1.0:
                    turn = -2.0
                else:
                    turn = 2.0 if error >= 0.0 else -2.0

    forward = max(0.0, min(forward, MAX_WHEEL_SPEED - abs(turn)))
    left = max(-MAX_WHEEL_SPEED, min(MAX_WHEEL_SPEED, forward - turn))
    right = max(-MAX_WHEEL_SPEED, min(MAX_WHEEL_SPEED, forward + turn))
    return (left, right)


def begin(obs):
    """Plans from where the robot is now."""
    pose = obs["pose"]
    start = (float(pose[0]), float(pose[1]))
    goal = (float(obs["goal"][0]), float(obs["goal"][1]))
    world = load_world()
    if "geometry" not in _CACHE:
        _CACHE["geometry"] = make_geometry(world)
    geo = _CACHE["geometry"]
    points, planned = plan(world, geo, start, goal)
    rooms = [10.0]
    for i in range(1, len(points)):
        rooms.append(segment_room(geo, points[i - 1], points[i]))
    tolerances = []
    for i in range(len(points)):
        room = rooms[i]
        if i + 1 < len(points):
            room = min(room, rooms[i + 1])
        tolerances.append(max(0.001, min(0.006, 0.3 * (room - RADIUS))))
    _STATE["points"] = points
    _STATE["planned"] = planned
    _STATE["rooms"] = rooms
    _STATE["tolerances"] = tolerances
    _STATE["index"] = 1
    _STATE["goal"] = goal
    _STATE["last"] = start


def reset(obs):
    _STATE.clear()
    _STATE["plans"] = 0
    begin(obs)


def policy(obs):
    pose = obs["pose"]
    x = float(pose[0])
    y = float(pose[1])
    yaw = float(pose[2])
    if "points" not in _STATE:
        _STATE["plans"] = 0
        begin(obs)
    else:
        last = _STATE["last"]
        goal = _STATE["goal"]
        jumped = math.hypot(x - last[0], y - last[1]) > 0.1
        moved_goal = math.hypot(float(obs["goal"][0]) - goal[0],
                                float(obs["goal"][1]) - goal[1]) > 0.001
        if (jumped or moved_goal) and _STATE["plans"] < 3:
            _STATE["plans"] += 1
            begin(obs)
    _STATE["last"] = (x, y)

    points = _STATE["points"]
    index = _STATE["index"]
    while index < len(points) - 1:
        away = math.hypot(points[index][0] - x, points[index][1] - y)
        if away > _STATE["tolerances"][index]:
            break
        index += 1
    _STATE["index"] = index

    waypoint = points[index]
    room = _STATE["rooms"][index]
    prox = None
    if room >= RADIUS + 0.018 or not _STATE["planned"]:
        prox = [float(v) for v in obs["ps"]]
    left, right = compute_wheel_speeds((x, y), yaw, waypoint, prox)
    if room < RADIUS + 0.012:
        # little room: point exactly along the leg before driving on
        error = wrap_angle(math.atan2(waypoint[1] - y, waypoint[0] - x) - yaw)
        if abs(error) > 0.03:
            half = (right - left) / 2.0
            left = -half
            right = half
    left = max(-1.0, min(1.0, left / MAX_WHEEL_SPEED))
    right = max(-1.0, min(1.0, right / MAX_WHEEL_SPEED))
    return (float(left), float(right))


# ---------------------------------------------------------------- episodes

def run_episode(env, max_steps):
    obs, info = env.reset()
    reset(obs)
    goal = (float(obs["goal"][0]), float(obs["goal"][1]))
    positions = [(float(obs["pose"][0]), float(obs["pose"][1]))]
    speeds = []
    collisions = 0
    if isinstance(info, dict):
        collisions = int(info.get("collisions", 0))
    terminated = False
    truncated = False
    steps = 0
    while steps < max_steps and not terminated and not truncated:
        left, right = policy(obs)
        obs, reward, terminated, truncated, info = env.step((left, right))
        steps += 1
        left = max(-1.0, min(1.0, left))
        right = max(-1.0, min(1.0, right))
        positions.append((float(obs["pose"][0]), float(obs["pose"][1])))
        speeds.append((left + right) / 2.0 * MAX_SPEED)
        collisions = int(info.get("collisions", collisions))
    return {"positions": positions, "speeds": speeds, "collisions": collisions,
            "goal": goal, "dt": DT}


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
