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

DT = 0.032
WHEEL_RADIUS = 0.02
AXLE_LENGTH = 0.052
FULL_SPEED = 0.1256
BODY_RADIUS = 0.037
BODY_LOW = 0.0025
BODY_HIGH = 0.0475
OPEN_BORDER = 0.4

CRUISE = 5.2          # rad/s
TURN_GAIN = 6.0       # rad/s per rad
TURN_MAX = 2.5        # rad/s
TURN_ONLY = 0.30      # rad: above this the robot turns in place

PLANS = ((0.01, 0.03), (0.01, 0.016), (0.01, 0.006))
FALLBACK_PLANS = ((0.005, 0.002), (0.005, 0.0005))
MAX_PLANS = 4
SAMPLE_STEP = 0.005

PS_READINGS = (67.0, 104.0, 120.0, 158.0, 235.0, 384.0, 601.0, 1466.0, 2133.0, 4095.0)
PS_DISTANCES = (0.07, 0.06, 0.05, 0.04, 0.03, 0.02, 0.015, 0.01, 0.005, 0.0)

TOKEN_PATTERN = r'"(?:\\.|[^"\\])*"|#[^\n]*|[{}\[\]]|[^\s,{}\[\]"#]+'
NUMBER_PATTERN = r'[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?'

SQRT2 = math.sqrt(2.0)

_STATE = {
    "world": {},
    "geo": {},
    "path": [],
    "index": 1,
    "goal": (0.0, 0.0),
    "tol": 0.005,
    "plans": 0,
    "blocked": 0,
}


# ---------------------------------------------------------------- parsing

def _wrap(angle):
    return math.atan2(math.sin(angle), math.cos(angle))


def _is_number(token):
    return re.fullmatch(NUMBER_PATTERN, token) is not None


def _parse_node(tok, i, name):
    node = {"type": tok[i], "def": name, "fields": {}}
    i += 2
    n = len(tok)
    while i < n and tok[i] != "}":
        key = tok[i]
        i += 1
        if key in ("{", "[", "]") or key[0] == '"' or _is_number(key):
            continue
        value, i = _parse_value(tok, i)
        node["fields"][key] = value
    return node, i + 1


def _parse_item(tok, i):
    n = len(tok)
    t = tok[i]
    if t == "DEF" and i + 3 < n and tok[i + 3] == "{":
        return _parse_node(tok, i + 2, tok[i + 1])
    if t[0] == '"':
        return t[1:-1].replace('\\"', '"').replace("\\\\", "\\"), i + 1
    if _is_number(t):
        return float(t), i + 1
    if t in ("{", "[", "]"):
        return "", i + 1
    if i + 1 < n and tok[i + 1] == "{":
        return _parse_node(tok, i, "")
    return t, i + 1


def _parse_value(tok, i):
    n = len(tok)
    if i >= n or tok[i] == "}":
        return "", i
    if tok[i] == "[":
        items = []
        i += 1
        while i < n and tok[i] not in ("]", "}"):
            value, i = _parse_item(tok, i)
            items.append(value)
        if i < n and tok[i] == "]":
            i += 1
        return items, i
    if _is_number(tok[i]):
        numbers = []
        while i < n and _is_number(tok[i]):
            numbers.append(float(tok[i]))
            i += 1
        return numbers, i
    return _parse_item(tok, i)


def _parse_top(text):
    tok = [t for t in re.findall(TOKEN_PATTERN, text, re.S) if not t.startswith("#")]
    nodes = []
    n = len(tok)
    i = 0
    while i < n:
        if tok[i] == "DEF" and i + 3 < n and tok[i + 3] == "{":
            node, i = _parse_node(tok, i + 2, tok[i + 1])
            nodes.append(node)
        elif (i + 1 < n and tok[i + 1] == "{" and tok[i][0] != '"'
              and tok[i] not in ("{", "}", "[", "]")):
            node, i = _parse_node(tok, i, "")
            nodes.append(node)
        else:
            i += 1
    return nodes


def _nums(node, key, default):
    value = node["fields"].get(key)
    if isinstance(value, list) and len(value) >= len(default):
        head = value[:len(default)]
        if all(isinstance(v, float) for v in head):
            return head
    return list(default)


def _angle(node):
    r = _nums(node, "rotation", (0.0, 0.0, 1.0, 0.0))
    if r[2] < 0.0:
        return -r[3]
    return r[3]


def _child_nodes(value):
    if isinstance(value, dict):
        return [value]
    if isinstance(value, list):
        return [v for v in value if isinstance(v, dict)]
    return []


def _hull(points):
    pts = sorted(set((float(p[0]), float(p[1])) for p in points))
    if len(pts) <= 2:
        return [list(p) for p in pts]
    lower = []
    for p in pts:
        while len(lower) >= 2 and _cross(lower[-2], lower[-1], p) <= 0.0:
            lower.pop()
        lower.append(p)
    upper = []
    for p in reversed(pts):
        while len(upper) >= 2 and _cross(upper[-2], upper[-1], p) <= 0.0:
            upper.pop()
        upper.append(p)
    return [list(p) for p in lower[:-1] + upper[:-1]]


def _cross(o, a, b):
    return (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])


def _collect_parts(node, x, y, z, yaw, out):
    kind = node["type"]
    c = math.cos(yaw)
    s = math.sin(yaw)
    if kind == "Box":
        sx, sy, sz = _nums(node, "size", (0.1, 0.1, 0.1))
        pts = []
        for u, v in ((-sx / 2, -sy / 2), (sx / 2, -sy / 2), (sx / 2, sy / 2), (-sx / 2, sy / 2)):
            pts.append([x + c * u - s * v, y + s * u + c * v])
        out.append({"kind": "poly", "pts": pts, "z0": z - sz / 2, "z1": z + sz / 2})
    elif kind == "Cylinder":
        h = _nums(node, "height", (0.1,))[0]
        r = _nums(node, "radius", (0.05,))[0]
        out.append({"kind": "circle", "x": x, "y": y, "r": r, "z0": z - h / 2, "z1": z + h / 2})
    elif kind == "IndexedFaceSet":
        coord = node["fields"].get("coord")
        if isinstance(coord, dict):
            value = coord["fields"].get("point")
            flat = []
            if isinstance(value, list):
                flat = [v for v in value if isinstance(v, float)]
            pts = []
            zs = []
            for k in range(0, len(flat) - 2, 3):
                u, v, w = flat[k], flat[k + 1], flat[k + 2]
                pts.append((x + c * u - s * v, y + s * u + c * v))
                zs.append(z + w)
            if pts:
                out.append({"kind": "poly", "pts": _hull(pts), "z0": min(zs), "z1": max(zs)})
    elif kind == "Shape":
        for child in _child_nodes(node["fields"].get("geometry")):
            _collect_parts(child, x, y, z, yaw, out)
    elif kind == "Group":
        for child in _child_nodes(node["fields"].get("children")):
            _collect_parts(child, x, y, z, yaw, out)
    elif kind in ("Pose", "Transform"):
        t = _nums(node, "translation", (0.0, 0.0, 0.0))
        a = _angle(node)
        nx = x + c * t[0] - s * t[1]
        ny = y + s * t[0] + c * t[1]
        for child in _child_nodes(node["fields"].get("children")):
            _collect_parts(child, nx, ny, z + t[2], yaw + a, out)


def _outline(part):
    if part["kind"] == "poly":
        return part["pts"]
    pts = []
    for k in range(32):
        a = 2.0 * math.pi * k / 32.0
        pts.append([part["x"] + part["r"] * math.cos(a), part["y"] + part["r"] * math.sin(a)])
    return pts


def _separated(p, q):
    n = len(p)
    for k in range(n):
        a = p[k]
        b = p[(k + 1) % n]
        nx = b[1] - a[1]
        ny = a[0] - b[0]
        length = math.hypot(nx, ny)
        if length < 1e-12:
            continue
        nx /= length
        ny /= length
        dp = [nx * v[0] + ny * v[1] for v in p]
        dq = [nx * v[0] + ny * v[1] for v in q]
        if max(dp) <= min(dq) + 1e-6 or max(dq) <= min(dp) + 1e-6:
            return True
    return False


def _overlap(part, other):
    p = _outline(part)
    q = _outline(other)
    return not (_separated(p, q) or _separated(q, p))


def _bottom(body):
    return min(p["z0"] for p in body["parts"])


def _settle(bodies, floor_z):
    loose = [b for b in bodies if b["physics"]]
    loose.sort(key=_bottom)
    for body in loose:
        drop = float("inf")
        for p in body["parts"]:
            gap = p["z0"] - floor_z
            for other in bodies:
                if other is body:
                    continue
                for q in other["parts"]:
                    if q["z0"] < p["z0"] and p["z0"] - q["z1"] < gap and _overlap(p, q):
                        gap = min(gap, max(0.0, p["z0"] - q["z1"]))
            drop = min(drop, gap)
        if 1e-9 < drop < float("inf"):
            for p in body["parts"]:
                p["z0"] -= drop
                p["z1"] -= drop


def _contains(area, x, y):
    dx = x - area["x"]
    dy = y - area["y"]
    if area["kind"] == "circle":
        return math.hypot(dx, dy) < area["r"]
    c = math.cos(area["yaw"])
    s = math.sin(area["yaw"])
    return abs(c * dx + s * dy) < area["hx"] and abs(-s * dx + c * dy) < area["hy"]


def _area_size(area):
    if area["kind"] == "circle":
        return math.pi * area["r"] ** 2
    return 4.0 * area["hx"] * area["hy"]


def _rect_corners(area, extra):
    c = math.cos(area["yaw"])
    s = math.sin(area["yaw"])
    hx = area["hx"] + extra
    hy = area["hy"] + extra
    pts = []
    for u, v in ((-hx, -hy), (hx, -hy), (hx, hy), (-hx, hy)):
        pts.append([area["x"] + c * u - s * v, area["y"] + s * u + c * v])
    return pts


def _area_box(area, extra):
    if area["kind"] == "circle":
        r = area["r"] + extra
        return [[area["x"] - r, area["y"] - r], [area["x"] + r, area["y"] + r]]
    return _rect_corners(area, extra)


def parse_world(text):
    start = (0.0, 0.0, 0.0)
    goal = (0.0, 0.0)
    goal_score = 0
    arenas = []
    floors = []
    bodies = []
    for node in _parse_top(text):
        kind = node["type"]
        fields = node["fields"]
        t = _nums(node, "translation", (0.0, 0.0, 0.0))
        yaw = _angle(node)
        if kind == "E-puck":
            start = (t[0], t[1], _wrap(yaw))
            continue
        if kind == "CircleArena":
            arenas.append({
                "kind": "circle", "x": t[0], "y": t[1], "z": t[2], "yaw": yaw,
                "r": _nums(node, "radius", (1.0,))[0],
                "t": _nums(node, "wallThickness", (0.001,))[0],
                "h": _nums(node, "wallHeight", (0.1,))[0],
            })
            continue
        if kind == "RectangleArena":
            size = _nums(node, "floorSize", (1.0, 1.0))
            arenas.append({
                "kind": "rect", "x": t[0], "y": t[1], "z": t[2], "yaw": yaw,
                "hx": size[0] / 2.0, "hy": size[1] / 2.0,
                "t": _nums(node, "wallThickness", (0.01,))[0],
                "h": _nums(node, "wallHeight", (0.1,))[0],
            })
            continue
        if kind == "Floor":
            size = _nums(node, "size", (10.0, 10.0))
            floors.append({
                "kind": "rect", "x": t[0], "y": t[1], "z": t[2], "yaw": yaw,
                "hx": size[0] / 2.0, "hy": size[1] / 2.0, "t": 0.0, "h": 0.0,
            })
            continue
        if kind in ("WorldInfo", "Viewpoint", "TexturedBackground", "TexturedBackgroundLight"):
            continue
        score = 0
        if node["def"] == "GOAL":
            score += 2
        if fields.get("name") == "GOAL":
            score += 1
        if score > goal_score:
            goal_score = score
            goal = (t[0], t[1])
        bounding = fields.get("boundingObject")
        if isinstance(bounding, dict):
            parts = []
            _collect_parts(bounding, t[0], t[1], t[2], yaw, parts)
            if parts:
                bodies.append({"parts": parts, "physics": isinstance(fields.get("physics"), dict)})

    floor_z = 0.0
    around = [a for a in arenas if _contains(a, start[0], start[1])]
    if not around:
        around = [a for a in floors if _contains(a, start[0], start[1])]
    if around:
        around.sort(key=_area_size)
        floor_z = around[0]["z"]

    _settle(bodies, floor_z)

    obstacles = []
    extent = [[start[0], start[1]], [goal[0], goal[1]]]
    for body in bodies:
        for p in body["parts"]:
            extent.extend(_outline(p))
            if p["z0"] < floor_z + BODY_HIGH and p["z1"] > floor_z + BODY_LOW:
                if p["kind"] == "poly":
                    obstacles.append({"kind": "poly", "pts": [[float(a), float(b)] for a, b in p["pts"]]})
                else:
                    obstacles.append({"kind": "circle", "x": p["x"], "y": p["y"], "r": p["r"]})

    walls = []
    for a in arenas:
        if a["z"] < floor_z + BODY_HIGH and a["z"] + a["h"] > floor_z + BODY_LOW:
            walls.append(a)
    enclosed = 0
    for a in walls:
        if _contains(a, start[0], start[1]):
            enclosed = 1
    border = 0.0
    if enclosed:
        extent = []
        for a in walls:
            extent.extend(_area_box(a, 0.0))
    else:
        border = OPEN_BORDER
        for a in arenas + floors:
            extent.extend(_area_box(a, a["t"]))
    bounds = [
        min(p[0] for p in extent) - border,
        min(p[1] for p in extent) - border,
        max(p[0] for p in extent) + border,
        max(p[1] for p in extent) + border,
    ]
    return {
        "start": start,
        "goal": goal,
        "arena": {"floor_z": floor_z, "enclosed": enclosed, "walls": walls, "bounds": bounds},
        "obstacles": obstacles,
    }


# ---------------------------------------------------------------- grid

def _span(values, low, high):
    i0 = int(np.searchsorted(values, low - 1e-9, side="left"))
    i1 = int(np.searchsorted(values, high + 1e-9, side="right"))
    return i0, i1


def _mark_poly(occ, xs, ys, pts, inflation):
    poly = np.asarray(pts, dtype=float).reshape(-1, 2)
    n = len(poly)
    if n == 0:
        return
    i0, i1 = _span(xs, poly[:, 0].min() - inflation, poly[:, 0].max() + inflation)
    j0, j1 = _span(ys, poly[:, 1].min() - inflation, poly[:, 1].max() + inflation)
    if i0 >= i1 or j0 >= j1:
        return
    gx = xs[None, i0:i1]
    gy = ys[j0:j1, None]
    inside = np.full((j1 - j0, i1 - i0), n >= 3)
    near = np.zeros((j1 - j0, i1 - i0), dtype=bool)
    limit = inflation * inflation
    for k in range(n):
        ax, ay = float(poly[k, 0]), float(poly[k, 1])
        bx, by = float(poly[(k + 1) % n, 0]), float(poly[(k + 1) % n, 1])
        ex = bx - ax
        ey = by - ay
        rx = gx - ax
        ry = gy - ay
        inside &= (ex * ry - ey * rx) >= 0.0
        if inflation > 0.0:
            length2 = ex * ex + ey * ey
            if length2 > 0.0:
                t = np.clip((rx * ex + ry * ey) / length2, 0.0, 1.0)
            else:
                t = 0.0
            dx = rx - t * ex
            dy = ry - t * ey
            near |= (dx * dx + dy * dy) < limit
    occ[j0:j1, i0:i1] |= inside | near


def _mark_circle(occ, xs, ys, cx, cy, r, inflation):
    i0, i1 = _span(xs, cx - r - inflation, cx + r + inflation)
    j0, j1 = _span(ys, cy - r - inflation, cy + r + inflation)
    if i0 >= i1 or j0 >= j1:
        return
    d = np.hypot(xs[None, i0:i1] - cx, ys[j0:j1, None] - cy)
    occ[j0:j1, i0:i1] |= (d <= r) | (d < r + inflation)


def _mark_ring(occ, xs, ys, cx, cy, r, thickness, inflation):
    outer = r + thickness
    i0, i1 = _span(xs, cx - outer - inflation, cx + outer + inflation)
    j0, j1 = _span(ys, cy - outer - inflation, cy + outer + inflation)
    if i0 >= i1 or j0 >= j1:
        return
    d = np.hypot(xs[None, i0:i1] - cx, ys[j0:j1, None] - cy)
    solid = (d >= r) & (d <= outer)
    near = (d > r - inflation) & (d < outer + inflation)
    occ[j0:j1, i0:i1] |= solid | near


def _wall_boxes(wall):
    c = math.cos(wall["yaw"])
    s = math.sin(wall["yaw"])
    hx, hy, t = wall["hx"], wall["hy"], wall["t"]
    boxes = []
    for u0, u1, v0, v1 in (
        (-hx - t, hx + t, hy, hy + t),
        (-hx - t, hx + t, -hy - t, -hy),
        (hx, hx + t, -hy - t, hy + t),
        (-hx - t, -hx, -hy - t, hy + t),
    ):
        pts = []
        for u, v in ((u0, v0), (u1, v0), (u1, v1), (u0, v1)):
            pts.append([wall["x"] + c * u - s * v, wall["y"] + s * u + c * v])
        boxes.append(pts)
    return boxes


def build_grid(world, resolution, inflation):
    res = float(resolution)
    inflation = max(0.0, float(inflation))
    arena = world["arena"]
    bx0, by0, bx1, by1 = [float(v) for v in arena["bounds"]]
    x0 = bx0 - res
    y0 = by0 - res
    nx = int(math.ceil((bx1 - bx0) / res)) + 2
    ny = int(math.ceil((by1 - by0) / res)) + 2
    xs = x0 + (np.arange(nx) + 0.5) * res
    ys = y0 + (np.arange(ny) + 0.5) * res
    occ = np.zeros((ny, nx), dtype=bool)
    if int(arena["enclosed"]):
        inside = np.zeros((ny, nx), dtype=bool)
        for wall in arena["walls"]:
            dx = xs[None, :] - wall["x"]
            dy = ys[:, None] - wall["y"]
            if wall["kind"] == "circle":
                inside |= np.hypot(dx, dy) < wall["r"]
            else:
                c = math.cos(wall["yaw"])
                s = math.sin(wall["yaw"])
                inside |= (np.abs(c * dx + s * dy) < wall["hx"]) & (np.abs(c * dy - s * dx) < wall["hy"])
        occ |= ~inside
    for wall in arena["walls"]:
        if wall["kind"] == "circle":
            _mark_ring(occ, xs, ys, wall["x"], wall["y"], wall["r"], wall["t"], inflation)
        else:
            for pts in _wall_boxes(wall):
                _mark_poly(occ, xs, ys, pts, inflation)
    for ob in world["obstacles"]:
        if ob["kind"] == "poly":
            _mark_poly(occ, xs, ys, ob["pts"], inflation)
        else:
            _mark_circle(occ, xs, ys, ob["x"], ob["y"], ob["r"], inflation)
    return occ, (x0, y0)


# ---------------------------------------------------------------- search

def astar(occ, start, goal):
    grid = np.asarray(occ, dtype=bool)
    if grid.ndim != 2 or grid.size == 0:
        return []
    ny, nx = grid.shape
    sx, sy = int(start[0]), int(start[1])
    gx, gy = int(goal[0]), int(goal[1])
    if not (0 <= sx < nx and 0 <= sy < ny and 0 <= gx < nx and 0 <= gy < ny):
        return []
    if grid[sy, sx] or grid[gy, gx]:
        return []
    if sx == gx and sy == gy:
        return [(sx, sy)]
    w = nx + 2
    padded = np.ones((ny + 2, w), dtype=np.uint8)
    padded[1:-1, 1:-1] = grid
    blocked = padded.tobytes()
    total = (ny + 2) * w
    first = (sy + 1) * w + sx + 1
    last = (gy + 1) * w + gx + 1
    tx = gx + 1
    ty = gy + 1
    diag = SQRT2 - 1.0
    cost = [float("inf")] * total
    parent = [-1] * total
    closed = bytearray(total)
    cost[first] = 0.0
    heap = [(0.0, first)]
    straight = (1, -1, w, -w)
    diagonal = ((1 + w, 1, w), (1 - w, 1, -w), (-1 + w, -1, w), (-1 - w, -1, -w))
    found = False
    while heap:
        _, cell = heapq.heappop(heap)
        if closed[cell]:
            continue
        closed[cell] = 1
        if cell == last:
            found = True
            break
        base = cost[cell]
        steps = []
        for d in straight:
            if not blocked[cell + d]:
                steps.append((cell + d, base + 1.0))
        for d, a, b in diagonal:
            if not (blocked[cell + d] or blocked[cell + a] or blocked[cell + b]):
                steps.append((cell + d, base + SQRT2))
        for nb, g in steps:
            if not closed[nb] and g < cost[nb] - 1e-12:
                cost[nb] = g
                parent[nb] = cell
                dx = abs(nb % w - tx)
                dy = abs(nb // w - ty)
                if dx > dy:
                    h = dx + diag * dy
                else:
                    h = dy + diag * dx
                heapq.heappush(heap, (g + h, nb))
    if not found:
        return []
    path = []
    cell = last
    while cell != -1:
        path.append((cell % w - 1, cell // w - 1))
        cell = parent[cell]
    path.reverse()
    return path


# ---------------------------------------------------------------- exact room

def _geometry(world):
    edges = []
    rings = []
    polys = []
    for ob in world["obstacles"]:
        if ob["kind"] == "poly":
            polys.append(ob["pts"])
        else:
            rings.append((ob["x"], ob["y"], ob["r"]))
    for wall in world["arena"]["walls"]:
        if wall["kind"] == "circle":
            rings.append((wall["x"], wall["y"], wall["r"]))
            rings.append((wall["x"], wall["y"], wall["r"] + wall["t"]))
        else:
            polys.append(_rect_corners(wall, 0.0))
            polys.append(_rect_corners(wall, wall["t"]))
    for pts in polys:
        n = len(pts)
        for k in range(n):
            a = pts[k]
            b = pts[(k + 1) % n]
            edges.append((a[0], a[1], b[0] - a[0], b[1] - a[1]))
    e = np.asarray(edges, dtype=float).reshape(-1, 4)
    r = np.asarray(rings, dtype=float).reshape(-1, 3)
    inverse = 1.0 / np.maximum(e[:, 2] ** 2 + e[:, 3] ** 2, 1e-18)
    return {"edges": e, "inverse": inverse, "rings": r}


def _clearance(geo, px, py):
    """Distance of points to the nearest outline of anything solid."""
    px = np.asarray(px, dtype=float)
    py = np.asarray(py, dtype=float)
    best = np.full(px.shape, 1000.0)
    e = geo["edges"]
    if len(e):
        rx = px[:, None] - e[None, :, 0]
        ry = py[:, None] - e[None, :, 1]
        ex = e[None, :, 2]
        ey = e[None, :, 3]
        t = np.clip((rx * ex + ry * ey) * geo["inverse"][None, :], 0.0, 1.0)
        rx = rx - t * ex
        ry = ry - t * ey
        best = np.minimum(best, np.sqrt((rx * rx + ry * ry).min(axis=1)))
    r = geo["rings"]
    if len(r):
        d = np.hypot(px[:, None] - r[None, :, 0], py[:, None] - r[None, :, 1])
        best = np.minimum(best, np.abs(d - r[None, :, 2]).min(axis=1))
    return best


def _line_ok(geo, a, b, need):
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    n = int(length / SAMPLE_STEP) + 2
    t = np.linspace(0.0, 1.0, n)
    px = a[0] + (b[0] - a[0]) * t
    py = a[1] + (b[1] - a[1]) * t
    return bool(_clearance(geo, px, py).min() >= need)


def _nearest_cell(occ, origin, cell, geo, point, need, reach):
    iy, ix = np.nonzero(~occ)
    if len(ix) == 0:
        return ()
    cx = origin[0] + (ix + 0.5) * cell
    cy = origin[1] + (iy + 0.5) * cell
    d = np.hypot(cx - point[0], cy - point[1])
    order = np.argsort(d, kind="stable")[:500]
    for k in order:
        if d[k] > reach:
            break
        if _line_ok(geo, point, (float(cx[k]), float(cy[k])), need):
            return (int(ix[k]), int(iy[k]))
    return ()


def _shorten(geo, pts, need):
    out = [pts[0]]
    last = len(pts) - 1
    i = 0
    while i < last:
        j = last
        while j > i + 1 and not _line_ok(geo, pts[i], pts[j], need):
            j -= 1
        out.append(pts[j])
        i = j
    return out


def _length(pts):
    total = 0.0
    for k in range(1, len(pts)):
        total += math.hypot(pts[k][0] - pts[k - 1][0], pts[k][1] - pts[k - 1][1])
    return total


def _raw_path(world, geo, start, goal, cell, margin):
    occ, origin = build_grid(world, cell, BODY_RADIUS + 0.7072 * cell + margin)
    floor_need = BODY_RADIUS + 0.001
    here = float(_clearance(geo, [start[0]], [start[1]])[0])
    first = _nearest_cell(occ, origin, cell, geo, start, min(floor_need, here - 0.0001), 0.25)
    there = float(_clearance(geo, [goal[0]], [goal[1]])[0])
    exact = there >= floor_need
    if exact:
        last = _nearest_cell(occ, origin, cell, geo, goal, floor_need, 0.25)
    else:
        last = _nearest_cell(occ, origin, cell, geo, goal, 0.003, 0.9 * GOAL_TOLERANCE)
    if not first or not last:
        return []
    cells = astar(occ, first, last)
    if not cells:
        return []
    centres = [(origin[0] + (c[0] + 0.5) * cell, origin[1] + (c[1] + 0.5) * cell) for c in cells]
    kept = centres[::2]
    if kept[-1] != centres[-1]:
        kept.append(centres[-1])
    pts = [start] + kept
    if exact:
        pts.append(goal)
    return pts


def _find_path(world, geo, start, goal):
    options = []
    for cell, margin in PLANS:
        pts = _raw_path(world, geo, start, goal, cell, margin)
        if pts:
            options.append((_length(pts), margin, pts))
    if not options:
        for cell, margin in FALLBACK_PLANS:
            pts = _raw_path(world, geo, start, goal, cell, margin)
            if pts:
                options.append((_length(pts), margin, pts))
                break
    if not options:
        return [start, goal], 0.002
    shortest = min(o[0] for o in options)
    for length, margin, pts in options:
        if length <= 1.08 * shortest + 0.03:
            return _shorten(geo, pts, BODY_RADIUS + margin + 0.5 * SAMPLE_STEP), margin
    return [start, goal], 0.002


def _make_plan(x, y, gx, gy):
    st = _STATE
    if not st["world"]:
        text = (sensors.HERE / WORLD_FILE).read_text(encoding="utf-8")
        st["world"] = parse_world(text)
        st["geo"] = _geometry(st["world"])
    st["plans"] += 1
    if st["plans"] > MAX_PLANS:
        path, margin = [(x, y), (gx, gy)], 0.002
    else:
        path, margin = _find_path(st["world"], st["geo"], (x, y), (gx, gy))
    st["path"] = path
    st["index"] = 1
    st["goal"] = (gx, gy)
    st["tol"] = min(0.01, 0.5 * margin + 0.001)
    st["blocked"] = 0


# ---------------------------------------------------------------- driving

def _limit(value, bound):
    return max(-bound, min(bound, value))


def compute_wheel_speeds(pose_xy, yaw, waypoint_xy, prox):
    dx = float(waypoint_xy[0]) - float(pose_xy[0])
    dy = float(waypoint_xy[1]) - float(pose_xy[1])
    dist = math.hypot(dx, dy)
    if dist < 0.001:
        return (0.0, 0.0)
    err = _wrap(math.atan2(dy, dx) - float(yaw))
    if err < -(math.pi - 1e-6):
        err = math.pi
    size = abs(err)
    turn = _limit(TURN_GAIN * err, TURN_MAX)
    forward = 0.0
    if size < TURN_ONLY:
        forward = min(CRUISE, 0.8 + 40.0 * dist) * (1.0 - size / TURN_ONLY)
    if prox is not None and len(prox) >= 8:
        ps = [float(v) for v in prox]
        seen = float(np.interp(max(ps[0], ps[7]), PS_READINGS, PS_DISTANCES))
        gap = max(0.0, seen - 0.005)
        if gap < 0.02 and gap < dist:
            forward = 0.0
            if size < TURN_ONLY:
                left_sum = ps[5] + ps[6] + ps[7]
                right_sum = ps[0] + ps[1] + ps[2]
                if right_sum > left_sum + 1.0:
                    turn = 2.0
                elif left_sum > right_sum + 1.0:
                    turn = -2.0
                elif err >= 0.0:
                    turn = 2.0
                else:
                    turn = -2.0
    left = forward - turn
    right = forward + turn
    top = max(abs(left), abs(right))
    if top > MAX_WHEEL_SPEED:
        left *= MAX_WHEEL_SPEED / top
        right *= MAX_WHEEL_SPEED / top
    return (_limit(left, MAX_WHEEL_SPEED), _limit(right, MAX_WHEEL_SPEED))


def _segment_distance(x, y, a, b):
    ex = b[0] - a[0]
    ey = b[1] - a[1]
    length2 = ex * ex + ey * ey
    t = 0.0
    if length2 > 0.0:
        t = max(0.0, min(1.0, ((x - a[0]) * ex + (y - a[1]) * ey) / length2))
    return math.hypot(x - a[0] - t * ex, y - a[1] - t * ey)


def reset(obs):
    _STATE["plans"] = 0
    pose = obs["pose"]
    goal = obs["goal"]
    _make_plan(float(pose[0]), float(pose[1]), float(goal[0]), float(goal[1]))


def policy(obs):
    st = _STATE
    x = float(obs["pose"][0])
    y = float(obs["pose"][1])
    yaw = float(obs["pose"][2])
    gx = float(obs["goal"][0])
    gy = float(obs["goal"][1])
    if not st["path"] or math.hypot(gx - st["goal"][0], gy - st["goal"][1]) > 0.001:
        _make_plan(x, y, gx, gy)

    path = st["path"]
    i = st["index"]
    while i < len(path) - 1 and math.hypot(path[i][0] - x, path[i][1] - y) < st["tol"]:
        i += 1
    st["index"] = i
    off = _segment_distance(x, y, path[i - 1], path[i])
    if (off > 0.06 or st["blocked"] > 30) and st["plans"] < MAX_PLANS:
        _make_plan(x, y, gx, gy)
        path = st["path"]
        i = st["index"]

    # The map is exact, so the way is decided by it; the sensors only slow the robot.
    left, right = compute_wheel_speeds((x, y), yaw, path[i], None)
    forward = 0.5 * (left + right)
    turn = 0.5 * (right - left)
    if "ps" in obs:
        ps = obs["ps"]
        if max(float(ps[0]), float(ps[1]), float(ps[6]), float(ps[7])) > 900.0:
            forward *= 0.5

    # Look one step ahead in the exact map.
    if forward > 0.0:
        scale = 1.0
        mid = yaw + turn * WHEEL_RADIUS * 2.0 / AXLE_LENGTH * DT * 0.5
        step = forward * WHEEL_RADIUS * DT
        fractions = np.array([0.0, 0.25, 0.5, 1.0])
        room = _clearance(st["geo"], x + fractions * step * math.cos(mid),
                          y + fractions * step * math.sin(mid))
        if room[3] < BODY_RADIUS + 0.0008 and room[3] < room[0]:
            scale = 0.0
            for k in (2, 1):
                if room[k] >= BODY_RADIUS + 0.0008:
                    scale = float(fractions[k])
                    break
        if scale == 0.0:
            st["blocked"] += 1
        else:
            st["blocked"] = 0
        forward *= scale

    out_left = _limit((forward - turn) / MAX_WHEEL_SPEED, 1.0)
    out_right = _limit((forward + turn) / MAX_WHEEL_SPEED, 1.0)
    return (float(out_left), float(out_right))


# ---------------------------------------------------------------- episode

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
        speeds.append((_limit(left, 1.0) + _limit(right, 1.0)) / 2.0 * FULL_SPEED)
        if info and "collisions" in info:
            collisions = int(info["collisions"])
        if terminated or truncated:
            break
    return {
        "positions": positions,
        "speeds": speeds,
        "collisions": collisions,
        "goal": goal,
        "dt": DT,
    }


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
