"""Drives an e-puck from the start to the goal of a Webots world without touching anything.

The world file is parsed into plain convex shapes, a route is planned once on an inflated
grid, shortened by lines of sight, and followed by the true pose.
"""
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

BODY_RADIUS = 0.037
BODY_LOW = 0.0025
BODY_HIGH = 0.0475
SPEED_FACTOR = 0.1256
OPEN_MARGIN = 0.3

CRUISE = 5.6          # rad/s of both wheels, straight ahead
TURN_GAIN = 6.0       # rad/s of wheel speed for each rad of heading error
TURN_LIMIT = 2.5      # rad/s
DRIVE_CONE = 0.5      # rad; outside of it: turn in place
SLOW_GAIN = 125.0     # rad/s for each metre that is left
SLOW_FLOOR = 0.5      # rad/s

# (resolution, margin), the roomiest first; the fine ones only when nothing else works
LEVELS = (
    (0.01, 0.03),
    (0.01, 0.02),
    (0.01, 0.012),
    (0.01, 0.006),
    (0.01, 0.002),
    (0.005, 0.002),
    (0.004, 0.0008),
)
MAX_PLANS = 6

READINGS = (67.0, 104.0, 120.0, 158.0, 235.0, 384.0, 601.0, 1466.0, 2133.0, 4095.0)
DISTANCES = (0.07, 0.06, 0.05, 0.04, 0.03, 0.02, 0.015, 0.01, 0.005, 0.0)

TOKEN_PATTERN = r'"(?:\\[\s\S]|[^"\\])*"|#[^\n]*|[{}\[\]]|[^\s,{}\[\]"#]+'
NUMBER_PATTERN = r'[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?$'

STATE = {
    "world": None,
    "ready": False,
    "points": [],
    "index": 0,
    "turning": True,
    "switch": 0.005,
    "last": (0.0, 0.0),
    "goal": (0.0, 0.0),
    "plans": 0,
}


# ---------------------------------------------------------------------------
# Reading the world file
# ---------------------------------------------------------------------------

def _tokens(text):
    return [t for t in re.findall(TOKEN_PATTERN, text) if not t.startswith("#")]


def _is_number(token):
    return re.match(NUMBER_PATTERN, token) is not None


def _starts_node(tok, i):
    if tok[i] == "DEF":
        return True
    return i + 1 < len(tok) and tok[i + 1] == "{" and tok[i] not in ("{", "}", "[", "]")


def _read_value(tok, i):
    """One field value that begins at token i; returns (value, next i)."""
    n = len(tok)
    if i >= n:
        return None, i
    t = tok[i]
    if t == "[":
        i += 1
        items = []
        while i < n and tok[i] != "]":
            if tok[i].startswith('"'):
                items.append(tok[i][1:-1])
                i += 1
            elif _is_number(tok[i]):
                items.append(float(tok[i]))
                i += 1
            elif _starts_node(tok, i):
                node, i = _read_node(tok, i)
                items.append(node)
            else:
                items.append(tok[i])
                i += 1
        return items, i + 1
    if t.startswith('"'):
        return t[1:-1], i + 1
    if _is_number(t):
        numbers = []
        while i < n and _is_number(tok[i]):
            numbers.append(float(tok[i]))
            i += 1
        return numbers, i
    if _starts_node(tok, i):
        return _read_node(tok, i)
    if t == "}":
        return None, i
    if t == "NULL":
        return None, i + 1
    return t, i + 1


def _read_node(tok, i):
    """One node that begins at token i (DEF or its type); returns (node, next i)."""
    n = len(tok)
    name = ""
    if tok[i] == "DEF":
        name = tok[i + 1] if i + 1 < n else ""
        i += 2
    kind = tok[i] if i < n else ""
    i += 1
    fields = {}
    if i < n and tok[i] == "{":
        i += 1
        while i < n and tok[i] != "}":
            key = tok[i]
            value, i = _read_value(tok, i + 1)
            fields[key] = value
        i += 1
    return {"type": kind, "def": name, "fields": fields}, i


def _read_nodes(text):
    tok = _tokens(text)
    n = len(tok)
    nodes = []
    i = 0
    while i < n:
        if tok[i] == "EXTERNPROTO":
            i += 2
        elif _starts_node(tok, i):
            node, i = _read_node(tok, i)
            nodes.append(node)
        else:
            i += 1
    return nodes


def _vector(node, key, default):
    value = node["fields"].get(key)
    if isinstance(value, list) and len(value) >= len(default):
        part = value[:len(default)]
        if all(isinstance(v, float) for v in part):
            return [float(v) for v in part]
    return [float(v) for v in default]


def _angle(node):
    r = _vector(node, "rotation", (0.0, 0.0, 1.0, 0.0))
    if r[2] < 0.0:
        return -r[3]
    if r[2] > 0.0:
        return r[3]
    return 0.0


def _wrap(a):
    a = math.atan2(math.sin(a), math.cos(a))
    return math.pi if a <= -math.pi else a


def _move(tx, ty, yaw, x, y):
    c = math.cos(yaw)
    s = math.sin(yaw)
    return tx + c * x - s * y, ty + s * x + c * y


def _rectangle(tx, ty, yaw, xa, xb, ya, yb):
    corners = ((xa, ya), (xb, ya), (xb, yb), (xa, yb))
    return [list(_move(tx, ty, yaw, x, y)) for x, y in corners]


def _turn_of(o, a, b):
    return (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])


def _hull(points):
    """Convex hull, counter-clockwise."""
    pts = sorted(set((float(p[0]), float(p[1])) for p in points))
    if len(pts) < 3:
        return [list(p) for p in pts]
    lower = []
    for p in pts:
        while len(lower) >= 2 and _turn_of(lower[-2], lower[-1], p) <= 0.0:
            lower.pop()
        lower.append(p)
    upper = []
    for p in reversed(pts):
        while len(upper) >= 2 and _turn_of(upper[-2], upper[-1], p) <= 0.0:
            upper.pop()
        upper.append(p)
    return [list(p) for p in lower[:-1] + upper[:-1]]


def _children(node):
    value = node["fields"].get("children")
    if isinstance(value, dict):
        return [value]
    if isinstance(value, list):
        return [c for c in value if isinstance(c, dict)]
    return []


def _collect_shapes(node, tx, ty, tz, yaw, out):
    """Adds the shapes of a boundingObject, seen from the given frame, to out."""
    kind = node["type"]
    if kind == "Group":
        for child in _children(node):
            _collect_shapes(child, tx, ty, tz, yaw, out)
    elif kind in ("Pose", "Transform", "Solid"):
        t = _vector(node, "translation", (0.0, 0.0, 0.0))
        x, y = _move(tx, ty, yaw, t[0], t[1])
        for child in _children(node):
            _collect_shapes(child, x, y, tz + t[2], yaw + _angle(node), out)
    elif kind == "Shape":
        geometry = node["fields"].get("geometry")
        if isinstance(geometry, dict):
            _collect_shapes(geometry, tx, ty, tz, yaw, out)
    elif kind == "Box":
        size = _vector(node, "size", (2.0, 2.0, 2.0))
        hx, hy, hz = size[0] / 2, size[1] / 2, size[2] / 2
        out.append({"kind": "poly", "pts": _rectangle(tx, ty, yaw, -hx, hx, -hy, hy),
                    "z0": tz - hz, "z1": tz + hz})
    elif kind == "Cylinder":
        height = _vector(node, "height", (2.0,))[0]
        radius = _vector(node, "radius", (1.0,))[0]
        out.append({"kind": "circle", "x": tx, "y": ty, "r": radius,
                    "z0": tz - height / 2, "z1": tz + height / 2})
    elif kind == "IndexedFaceSet":
        coord = node["fields"].get("coord")
        values = []
        if isinstance(coord, dict):
            values = coord["fields"].get("point") or []
            values = [v for v in values if isinstance(v, float)]
        count = len(values) // 3
        if count:
            points = [_move(tx, ty, yaw, values[3 * k], values[3 * k + 1]) for k in range(count)]
            heights = [values[3 * k + 2] for k in range(count)]
            out.append({"kind": "poly", "pts": _hull(points),
                        "z0": tz + min(heights), "z1": tz + max(heights)})


def _read_arena(node):
    t = _vector(node, "translation", (0.0, 0.0, 0.0))
    yaw = _angle(node)
    x, y, z = t
    kind = node["type"]
    if kind == "Floor":
        size = _vector(node, "size", (1.0, 1.0))
        hx, hy = size[0] / 2, size[1] / 2
        region = {"kind": "poly", "pts": _rectangle(x, y, yaw, -hx, hx, -hy, hy)}
        return {"z": z, "region": region, "walls": []}
    thick = _vector(node, "wallThickness", (0.01,))[0]
    top = z + _vector(node, "wallHeight", (0.1,))[0]
    if kind == "CircleArena":
        radius = _vector(node, "radius", (1.0,))[0]
        region = {"kind": "circle", "x": x, "y": y, "r": radius}
        walls = [{"kind": "ring", "x": x, "y": y, "r0": radius, "r1": radius + thick,
                  "z0": z, "z1": top}]
        return {"z": z, "region": region, "walls": walls}
    size = _vector(node, "floorSize", (1.0, 1.0))
    hx, hy = size[0] / 2, size[1] / 2
    region = {"kind": "poly", "pts": _rectangle(x, y, yaw, -hx, hx, -hy, hy)}
    spans = (
        (hx, hx + thick, -hy - thick, hy + thick),
        (-hx - thick, -hx, -hy - thick, hy + thick),
        (-hx, hx, hy, hy + thick),
        (-hx, hx, -hy - thick, -hy),
    )
    walls = []
    for xa, xb, ya, yb in spans:
        walls.append({"kind": "poly", "pts": _rectangle(x, y, yaw, xa, xb, ya, yb),
                      "z0": z, "z1": top})
    return {"z": z, "region": region, "walls": walls}


def _blocks(shape, floor):
    return shape["z0"] < floor + BODY_HIGH and shape["z1"] > floor + BODY_LOW


def _settle(bodies, walls, floor):
    """Lets the bodies that can be pushed and hang in the air fall."""
    settled = list(walls)
    loose = []
    for body in bodies:
        if body["loose"]:
            loose.append((min(s["z0"] for s in body["shapes"]), len(loose), body))
        else:
            settled.extend(body["shapes"])
    loose.sort(key=_loose_key)
    for bottom, _, body in loose:
        drop = max(0.0, bottom - floor)
        if drop > 0.0:
            for s in body["shapes"]:
                for t in settled:
                    if t["z0"] < s["z0"] and _overlap(s, t):
                        drop = min(drop, max(0.0, s["z0"] - t["z1"]))
            for s in body["shapes"]:
                s["z0"] -= drop
                s["z1"] -= drop
        settled.extend(body["shapes"])


def _loose_key(item):
    return (item[0], item[1])


def parse_world(text):
    nodes = _read_nodes(text)
    start = (0.0, 0.0, 0.0)
    robot_z = 0.0
    goal = None
    named_goal = None
    arenas = []
    bodies = []
    for node in nodes:
        kind = node["type"]
        if kind == "E-puck":
            t = _vector(node, "translation", (0.0, 0.0, 0.0))
            start = (t[0], t[1], _wrap(_angle(node)))
            robot_z = t[2]
            continue
        if kind in ("CircleArena", "RectangleArena", "Floor"):
            arenas.append(_read_arena(node))
            continue
        if kind in ("WorldInfo", "Viewpoint", "TexturedBackground", "TexturedBackgroundLight"):
            continue
        t = _vector(node, "translation", (0.0, 0.0, 0.0))
        if node["def"] == "GOAL" and goal is None:
            goal = (t[0], t[1])
        elif node["fields"].get("name") == "GOAL" and named_goal is None:
            named_goal = (t[0], t[1])
        bounding = node["fields"].get("boundingObject")
        if isinstance(bounding, dict):
            shapes = []
            _collect_shapes(bounding, t[0], t[1], t[2], _angle(node), shapes)
            if shapes:
                bodies.append({"shapes": shapes,
                               "loose": isinstance(node["fields"].get("physics"), dict)})
    if goal is None:
        goal = named_goal if named_goal is not None else (start[0], start[1])

    # the floor that the robot stands on
    floor = 0.0
    best = None
    for arena in arenas:
        if _point_distance(arena["region"], start[0], start[1]) <= 0.0:
            off = abs(arena["z"] - robot_z)
            if best is None or off < best:
                best = off
                floor = arena["z"]

    all_walls = []
    for arena in arenas:
        all_walls.extend(arena["walls"])
    _settle(bodies, all_walls, floor)

    walls = []
    regions = []
    bounded = False
    for arena in arenas:
        standing = [w for w in arena["walls"] if _blocks(w, floor)]
        if standing:
            walls.extend(standing)
            regions.append(arena["region"])
            if _point_distance(arena["region"], start[0], start[1]) <= 0.0:
                bounded = True

    obstacles = []
    for body in bodies:
        for s in body["shapes"]:
            if _blocks(s, floor):
                obstacles.append(s)

    if bounded:
        boxes = [_bounds(r) for r in regions]
        pad = 0.0
    else:
        boxes = [_bounds(a["region"]) for a in arenas]
        boxes.extend(_bounds(w) for w in all_walls)
        for body in bodies:
            boxes.extend(_bounds(s) for s in body["shapes"])
        boxes.append((start[0] - BODY_RADIUS, start[1] - BODY_RADIUS,
                      start[0] + BODY_RADIUS, start[1] + BODY_RADIUS))
        boxes.append((goal[0], goal[1], goal[0], goal[1]))
        pad = OPEN_MARGIN
    bounds = (
        min(b[0] for b in boxes) - pad,
        min(b[1] for b in boxes) - pad,
        max(b[2] for b in boxes) + pad,
        max(b[3] for b in boxes) + pad,
    )
    return {
        "start": start,
        "goal": goal,
        "arena": {
            "bounded": 1 if bounded else 0,
            "regions": regions,
            "walls": walls,
            "bounds": bounds,
            "floor": floor,
        },
        "obstacles": obstacles,
    }


# ---------------------------------------------------------------------------
# Geometry
# ---------------------------------------------------------------------------

def _bounds(shape):
    if shape["kind"] == "poly":
        xs = [p[0] for p in shape["pts"]]
        ys = [p[1] for p in shape["pts"]]
        return min(xs), min(ys), max(xs), max(ys)
    r = shape["r1"] if shape["kind"] == "ring" else shape["r"]
    return shape["x"] - r, shape["y"] - r, shape["x"] + r, shape["y"] + r


def _shape_distance(shape, px, py):
    """Distance of points from a shape, 0 in it; px and py can be broadcast together."""
    kind = shape["kind"]
    if kind == "circle":
        return np.maximum(np.hypot(px - shape["x"], py - shape["y"]) - shape["r"], 0.0)
    if kind == "ring":
        rho = np.hypot(px - shape["x"], py - shape["y"])
        return np.maximum(np.maximum(shape["r0"] - rho, rho - shape["r1"]), 0.0)
    pts = shape["pts"]
    n = len(pts)
    best = None
    inside = None
    for k in range(n):
        ax, ay = float(pts[k][0]), float(pts[k][1])
        bx, by = float(pts[(k + 1) % n][0]), float(pts[(k + 1) % n][1])
        ex = bx - ax
        ey = by - ay
        qx = px - ax
        qy = py - ay
        length2 = ex * ex + ey * ey
        if length2 > 0.0:
            f = np.clip((qx * ex + qy * ey) / length2, 0.0, 1.0)
            d2 = (qx - f * ex) ** 2 + (qy - f * ey) ** 2
        else:
            d2 = qx ** 2 + qy ** 2
        side = (ex * qy - ey * qx) >= 0.0
        if best is None:
            best = d2
            inside = side
        else:
            best = np.minimum(best, d2)
            inside = np.logical_and(inside, side)
    distance = np.sqrt(best)
    if n < 3:
        return distance
    return np.where(inside, 0.0, distance)


def _point_distance(shape, x, y):
    return float(np.max(_shape_distance(shape, np.array([float(x)]), np.array([float(y)]))))


def _polys_overlap(a, b):
    for first, second in ((a, b), (b, a)):
        n = len(first)
        for k in range(n):
            ex = first[(k + 1) % n][0] - first[k][0]
            ey = first[(k + 1) % n][1] - first[k][1]
            length = math.hypot(ex, ey)
            if length <= 0.0:
                continue
            nx, ny = ey / length, -ex / length
            one = [p[0] * nx + p[1] * ny for p in first]
            two = [p[0] * nx + p[1] * ny for p in second]
            if min(max(one), max(two)) - max(min(one), min(two)) <= 1e-6:
                return False
    return True


def _overlap(a, b):
    """Do two shapes overlap as seen from above?"""
    if a["kind"] == "ring" and b["kind"] == "ring":
        return False
    if a["kind"] == "ring":
        return _overlap(b, a)
    if b["kind"] == "ring":
        if a["kind"] == "circle":
            d = math.hypot(a["x"] - b["x"], a["y"] - b["y"])
            far = d + a["r"]
            near = d - a["r"]
        else:
            far = max(math.hypot(p[0] - b["x"], p[1] - b["y"]) for p in a["pts"])
            near = _point_distance(a, b["x"], b["y"])
        return far > b["r0"] + 1e-6 and near < b["r1"] - 1e-6
    if a["kind"] == "circle" and b["kind"] == "circle":
        return math.hypot(a["x"] - b["x"], a["y"] - b["y"]) < a["r"] + b["r"] - 1e-6
    if a["kind"] == "circle":
        return _point_distance(b, a["x"], a["y"]) < a["r"] - 1e-6
    if b["kind"] == "circle":
        return _point_distance(a, b["x"], b["y"]) < b["r"] - 1e-6
    return _polys_overlap(a["pts"], b["pts"])


def _solid_shapes(world):
    return list(world["arena"]["walls"]) + list(world["obstacles"])


def _clearance(world, px, py):
    """Distance of points (1-d arrays) from all that is solid, 0 outside of the arena."""
    px = np.asarray(px, dtype=float)
    py = np.asarray(py, dtype=float)
    result = np.full(px.shape, 10.0)
    for shape in _solid_shapes(world):
        result = np.minimum(result, _shape_distance(shape, px, py))
    if world["arena"]["bounded"]:
        within = np.zeros(px.shape, dtype=bool)
        for region in world["arena"]["regions"]:
            within |= _shape_distance(region, px, py) <= 0.0
        result = np.where(within, result, 0.0)
    return result


def _segment_clearance(world, a, b):
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    n = int(length / 0.002) + 2
    f = np.linspace(0.0, 1.0, n)
    return float(np.min(_clearance(world, a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1]))))


# ---------------------------------------------------------------------------
# Grid and search
# ---------------------------------------------------------------------------

def build_grid(world, resolution, inflation):
    res = float(resolution)
    grow = max(0.0, float(inflation))
    arena = world["arena"]
    b = [float(v) for v in arena["bounds"]]
    x0, y0 = b[0], b[1]
    nx = max(1, int(math.ceil((b[2] - x0) / res - 1e-9)))
    ny = max(1, int(math.ceil((b[3] - y0) / res - 1e-9)))
    xs = x0 + (np.arange(nx) + 0.5) * res
    ys = y0 + (np.arange(ny) + 0.5) * res
    occ = np.zeros((ny, nx), dtype=bool)
    if arena["bounded"]:
        within = np.zeros((ny, nx), dtype=bool)
        for region in arena["regions"]:
            within |= _shape_distance(region, xs[None, :], ys[:, None]) <= 0.0
        occ = np.logical_not(within)
    for shape in _solid_shapes(world):
        s = _bounds(shape)
        ia = max(0, int(math.floor((s[0] - grow - x0) / res)) - 1)
        ib = min(nx, int(math.ceil((s[2] + grow - x0) / res)) + 1)
        ja = max(0, int(math.floor((s[1] - grow - y0) / res)) - 1)
        jb = min(ny, int(math.ceil((s[3] + grow - y0) / res)) + 1)
        if ia >= ib or ja >= jb:
            continue
        d = _shape_distance(shape, xs[None, ia:ib], ys[ja:jb, None])
        occ[ja:jb, ia:ib] |= np.logical_or(d <= 0.0, d < grow)
    return occ, (x0, y0)


def astar(occ, start, goal):
    grid = np.asarray(occ, dtype=bool)
    rows, cols = grid.shape
    sx, sy = int(start[0]), int(start[1])
    gx, gy = int(goal[0]), int(goal[1])
    if not (0 <= sx < cols and 0 <= sy < rows and 0 <= gx < cols and 0 <= gy < rows):
        return []
    if grid[sy, sx] or grid[gy, gx]:
        return []
    if (sx, sy) == (gx, gy):
        return [(sx, sy)]
    width = cols + 2
    padded = np.ones((rows + 2, width), dtype=bool)
    padded[1:-1, 1:-1] = grid
    blocked = padded.ravel().tolist()
    total = len(blocked)
    source = (sy + 1) * width + sx + 1
    target = (gy + 1) * width + gx + 1
    tx, ty = gx + 1, gy + 1
    diag = math.sqrt(2.0)
    extra = diag - 1.0
    cost = [math.inf] * total
    parent = [-1] * total
    closed = bytearray(total)
    cost[source] = 0.0
    heap = [(0.0, source)]
    straight = (1, -1, width, -width)
    corners = ((1, width), (1, -width), (-1, width), (-1, -width))
    while heap:
        _, k = heapq.heappop(heap)
        if closed[k]:
            continue
        if k == target:
            break
        closed[k] = 1
        base = cost[k]
        steps = []
        for a in straight:
            if not blocked[k + a]:
                steps.append((k + a, base + 1.0))
        for a, c in corners:
            if not (blocked[k + a] or blocked[k + c] or blocked[k + a + c]):
                steps.append((k + a + c, base + diag))
        for m, g in steps:
            if not closed[m] and g < cost[m] - 1e-12:
                cost[m] = g
                parent[m] = k
                dx = abs(m % width - tx)
                dy = abs(m // width - ty)
                if dx > dy:
                    h = dx + extra * dy
                else:
                    h = dy + extra * dx
                heapq.heappush(heap, (g + h, m))
    if cost[target] == math.inf:
        return []
    path = []
    k = target
    while k != -1:
        path.append((int(k % width - 1), int(k // width - 1)))
        k = parent[k]
    path.reverse()
    return path


# ---------------------------------------------------------------------------
# Planning
# ---------------------------------------------------------------------------

def _snap(world, occ, origin, res, p):
    """The cell of p, or the nearest free one that the body gets straight to.

    Returns (cell, point), where point is p itself when its own cell is free, or None.
    """
    rows, cols = occ.shape
    ix = int(math.floor((p[0] - origin[0]) / res))
    iy = int(math.floor((p[1] - origin[1]) / res))
    if 0 <= ix < cols and 0 <= iy < rows and not occ[iy, ix]:
        return (ix, iy), (p[0], p[1])
    here = float(_clearance(world, np.array([p[0]]), np.array([p[1]]))[0])
    need = min(here, BODY_RADIUS + 0.002) - 1e-4
    if need <= 0.0:
        return None
    free_y, free_x = np.nonzero(np.logical_not(occ))
    if free_x.size == 0:
        return None
    cx = origin[0] + (free_x + 0.5) * res
    cy = origin[1] + (free_y + 0.5) * res
    order = np.argsort(np.hypot(cx - p[0], cy - p[1]), kind="stable")[:300]
    for k in order:
        point = (float(cx[k]), float(cy[k]))
        if _segment_clearance(world, p, point) >= need:
            return (int(free_x[k]), int(free_y[k])), point
    return None


def _line_free(occ, origin, res, a, b):
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    n = int(length / (res * 0.2)) + 2
    f = np.linspace(0.0, 1.0, n)
    ix = np.floor((a[0] + f * (b[0] - a[0]) - origin[0]) / res).astype(int)
    iy = np.floor((a[1] + f * (b[1] - a[1]) - origin[1]) / res).astype(int)
    rows, cols = occ.shape
    if ix.min() < 0 or iy.min() < 0 or ix.max() >= cols or iy.max() >= rows:
        return False
    return not bool(occ[iy, ix].any())


def _shorten(occ, origin, res, pts):
    result = [pts[0]]
    i = 0
    last = len(pts) - 1
    while i < last:
        j = last
        while j > i + 1 and not _line_free(occ, origin, res, pts[i], pts[j]):
            j -= 1
        result.append(pts[j])
        i = j
    return result


def _route(world, res, margin, start, target):
    """Waypoints from start (left out) to target on a grid with this margin, or []."""
    occ, origin = build_grid(world, res, BODY_RADIUS + 0.7072 * res + margin)
    first = _snap(world, occ, origin, res, start)
    if first is None:
        return []
    final = _snap(world, occ, origin, res, target)
    if final is None:
        return []
    cells = astar(occ, first[0], final[0])
    if not cells:
        return []
    pts = [first[1]]
    for ix, iy in cells[1:-1]:
        pts.append((origin[0] + (ix + 0.5) * res, origin[1] + (iy + 0.5) * res))
    pts.append(final[1])
    pts = _shorten(occ, origin, res, pts)
    if pts[0] == (start[0], start[1]):
        pts = pts[1:]
    if pts[-1] != (target[0], target[1]):
        pts.append((target[0], target[1]))
    return pts


def _goal_target(world, goal):
    """The goal, or a point near it where the body has room."""
    need = BODY_RADIUS + 0.0015
    if float(_clearance(world, np.array([goal[0]]), np.array([goal[1]]))[0]) >= need:
        return goal
    for k in range(1, 10):
        r = 0.002 * k
        a = np.arange(48) * (2.0 * math.pi / 48)
        px = goal[0] + r * np.cos(a)
        py = goal[1] + r * np.sin(a)
        c = _clearance(world, px, py)
        for m in np.argsort(-c):
            if c[m] < need:
                break
            point = (float(px[m]), float(py[m]))
            if _segment_clearance(world, point, goal) > 0.0:
                return point
    return goal


def _path_length(start, pts):
    length = 0.0
    x, y = start
    for p in pts:
        length += math.hypot(p[0] - x, p[1] - y)
        x, y = p
    return length


def make_plan(world, start, goal):
    """(waypoints, margin): the roomiest route that is not much longer than the shortest."""
    target = _goal_target(world, goal)
    found = []
    for res, margin in LEVELS:
        if found and res < 0.01:
            break
        pts = _route(world, res, margin, start, target)
        if pts:
            found.append((_path_length(start, pts), margin, pts))
    if not found:
        return [], 0.002
    shortest = min(f[0] for f in found)
    for length, margin, pts in found:
        if length <= 1.1 * shortest + 1e-9:
            return pts, margin
    return found[-1][2], found[-1][1]


def _begin(x, y, goal):
    if STATE["world"] is None:
        text = (sensors.HERE / WORLD_FILE).read_text(encoding="utf-8")
        STATE["world"] = parse_world(text)
    pts, margin = make_plan(STATE["world"], (x, y), goal)
    STATE["points"] = pts
    STATE["index"] = 0
    STATE["turning"] = True
    STATE["switch"] = max(0.0015, min(0.006, 0.5 * margin))
    STATE["last"] = (x, y)
    STATE["goal"] = goal
    STATE["ready"] = True
    STATE["plans"] += 1


# ---------------------------------------------------------------------------
# Driving
# ---------------------------------------------------------------------------

def _limit(value, bound):
    return max(-bound, min(bound, value))


def _sensor_distance(reading):
    return float(np.interp(float(reading), READINGS, DISTANCES))


def compute_wheel_speeds(pose_xy, yaw, waypoint_xy, prox):
    dx = float(waypoint_xy[0]) - float(pose_xy[0])
    dy = float(waypoint_xy[1]) - float(pose_xy[1])
    distance = math.hypot(dx, dy)
    if distance < 0.001:
        return 0.0, 0.0
    error = _wrap(math.atan2(dy, dx) - float(yaw))
    if abs(error) > math.pi - 1e-4:
        error = math.pi
    turn = _limit(TURN_GAIN * error, TURN_LIMIT)
    forward = min(CRUISE, max(SLOW_FLOOR, SLOW_GAIN * distance))
    forward *= max(0.0, 1.0 - abs(error) / DRIVE_CONE)
    if prox is not None and len(prox) >= 8 and forward > 0.0:
        p = [float(v) for v in prox]
        gap = min(_sensor_distance(p[0]), _sensor_distance(p[7])) - 0.005
        if gap < 0.012 and gap < distance:
            right_load = p[0] + p[1] + p[2]
            left_load = p[7] + p[6] + p[5]
            forward = 0.0
            if left_load < right_load - 1e-6:
                turn = 2.0
            elif right_load < left_load - 1e-6:
                turn = -2.0
            elif error < -1e-3:
                turn = -2.0
            else:
                turn = 2.0
    left = forward - turn
    right = forward + turn
    top = max(abs(left), abs(right))
    if top > MAX_WHEEL_SPEED:
        left *= MAX_WHEEL_SPEED / top
        right *= MAX_WHEEL_SPEED / top
    return _limit(left, MAX_WHEEL_SPEED), _limit(right, MAX_WHEEL_SPEED)


def reset(obs):
    STATE["plans"] = 0
    STATE["ready"] = False
    x, y = float(obs["pose"][0]), float(obs["pose"][1])
    goal = (float(obs["goal"][0]), float(obs["goal"][1]))
    _begin(x, y, goal)


def policy(obs):
    x, y, yaw = float(obs["pose"][0]), float(obs["pose"][1]), float(obs["pose"][2])
    goal = (float(obs["goal"][0]), float(obs["goal"][1]))
    if not STATE["ready"]:
        _begin(x, y, goal)
    elif STATE["plans"] < MAX_PLANS:
        jump = math.hypot(x - STATE["last"][0], y - STATE["last"][1])
        shift = math.hypot(goal[0] - STATE["goal"][0], goal[1] - STATE["goal"][1])
        if jump > 0.05 or shift > 0.005:
            _begin(x, y, goal)
    STATE["last"] = (x, y)
    pts = STATE["points"]
    if not pts:
        return 0.0, 0.0
    while STATE["index"] < len(pts) - 1:
        p = pts[STATE["index"]]
        if math.hypot(p[0] - x, p[1] - y) > STATE["switch"]:
            break
        STATE["index"] += 1
        STATE["turning"] = True
    p = pts[STATE["index"]]
    error = 0.0
    if math.hypot(p[0] - x, p[1] - y) > 0.001:
        error = _wrap(math.atan2(p[1] - y, p[0] - x) - yaw)
    if STATE["turning"] and abs(error) < 0.05:
        STATE["turning"] = False
    if STATE["turning"]:
        turn = _limit(TURN_GAIN * error, TURN_LIMIT)
        left, right = -turn, turn
    else:
        # the map is exact and the route keeps its room, so the sensors are not asked
        left, right = compute_wheel_speeds((x, y), yaw, p, None)
    return (float(_limit(left / MAX_WHEEL_SPEED, 1.0)),
            float(_limit(right / MAX_WHEEL_SPEED, 1.0)))


def run_episode(env, max_steps):
    obs, info = env.reset()
    reset(obs)
    positions = [(float(obs["pose"][0]), float(obs["pose"][1]))]
    goal = (float(obs["goal"][0]), float(obs["goal"][1]))
    speeds = []
    collisions = 0
    if info and "collisions" in info:
        collisions = int(info["collisions"])
    for _ in range(int(max_steps)):
        left, right = policy(obs)
        obs, reward, terminated, truncated, info = env.step((left, right))
        positions.append((float(obs["pose"][0]), float(obs["pose"][1])))
        speeds.append((_limit(float(left), 1.0) + _limit(float(right), 1.0)) / 2.0 * SPEED_FACTOR)
        if info and "collisions" in info:
            collisions = int(info["collisions"])
        if terminated or truncated:
            break
    return {
        "positions": positions,
        "speeds": speeds,
        "collisions": collisions,
        "goal": goal,
        "dt": TIME_STEP / 1000.0,
    }


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
