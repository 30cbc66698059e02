"""e-puck: parse the world, plan on an inflated grid, follow the waypoints by the true pose."""
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
FULL_SPEED = 0.1256
STEP_SECONDS = 0.032
GRID_STEP = 0.01
HALF_DIAGONAL = 0.7072
MARGINS = (0.022, 0.014, 0.008, 0.004, 0.001)
MAX_CELLS = 6000000
OPEN_BORDER = 0.3
SWITCH_DISTANCE = 0.006
CRUISE = 5.9
MAX_REPLANS = 5

TOKEN_PATTERN = r'"(?:\\.|[^"\\])*"|#[^\r\n]*|[{}\[\]]|[^\s,{}\[\]"#]+'
NUMBER_PATTERN = r'[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?'

PS_TABLE_READING = (67.0, 104.0, 120.0, 158.0, 235.0, 384.0, 601.0, 1466.0, 2133.0, 4095.0)
PS_TABLE_DISTANCE = (0.07, 0.06, 0.05, 0.04, 0.03, 0.02, 0.015, 0.01, 0.005, 0.0)

_STATE = {"world": None, "path": None, "index": 0, "last": None, "replans": 0}


# --------------------------------------------------------------------------
# reading the world file
# --------------------------------------------------------------------------

def _tokens(text):
    out = []
    for match in re.finditer(TOKEN_PATTERN, text, re.S):
        token = match.group(0)
        if token[0] != "#":
            out.append(token)
    return out


def _is_number(token):
    return re.fullmatch(NUMBER_PATTERN, token) is not None


def _is_word(token):
    return token not in ("{", "}", "[", "]") and token[0] != '"'


def _parse_node(tok, i, label):
    """tok[i] is the type of the node, tok[i + 1] its opening brace."""
    node = {"type": tok[i], "def": label, "fields": {}}
    i += 2
    n = len(tok)
    while i < n and tok[i] != "}":
        key = tok[i]
        i += 1
        if key == "hidden" or not _is_word(key) or _is_number(key):
            continue
        value, i = _parse_value(tok, i)
        node["fields"][key] = value
    return node, i + 1


def _parse_value(tok, i):
    n = len(tok)
    if i >= n:
        return None, i
    t = tok[i]
    if t == "}" or t == "]":
        return None, i
    if t == "[":
        items = []
        i += 1
        while i < n and tok[i] != "]":
            if tok[i] == "}":
                break
            if _is_number(tok[i]):
                items.append(float(tok[i]))
                i += 1
            else:
                before = i
                value, i = _parse_value(tok, i)
                items.append(value)
                if i == before:
                    i += 1
        return items, i + 1
    if t == "{":
        return None, i + 1
    if t[0] == '"':
        return t[1:-1], i + 1
    if _is_number(t):
        items = []
        while i < n and _is_number(tok[i]):
            items.append(float(tok[i]))
            i += 1
        return items, i
    if t == "DEF" and i + 3 < n and tok[i + 3] == "{":
        return _parse_node(tok, i + 2, tok[i + 1])
    if i + 1 < n and tok[i + 1] == "{":
        return _parse_node(tok, i, "")
    return t, i + 1


def _top_nodes(text):
    tok = _tokens(text)
    nodes = []
    n = len(tok)
    i = 0
    while i < n:
        if tok[i] == "DEF" and i + 3 < n and tok[i + 3] == "{":
            node, i = _parse_node(tok, i + 2, tok[i + 1])
            nodes.append(node)
        elif i + 1 < n and tok[i + 1] == "{" and _is_word(tok[i]):
            node, i = _parse_node(tok, i, "")
            nodes.append(node)
        else:
            i += 1
    return nodes


def _vec(node, key, default):
    value = node["fields"].get(key)
    if isinstance(value, list) and len(value) >= len(default):
        good = True
        for v in value[:len(default)]:
            if not isinstance(v, float):
                good = False
        if good:
            return tuple(value[:len(default)])
    return tuple(float(v) for v in default)


def _yaw_of(node):
    r = _vec(node, "rotation", (0.0, 0.0, 1.0, 0.0))
    return r[3] if r[2] >= 0.0 else -r[3]


def _wrap(angle):
    a = math.fmod(angle, 2.0 * math.pi)
    if a > math.pi:
        a -= 2.0 * math.pi
    elif a <= -math.pi:
        a += 2.0 * math.pi
    return a


def _child_nodes(value):
    if isinstance(value, dict):
        return [value]
    if isinstance(value, list):
        return [v for v in value if isinstance(v, dict)]
    return []


def _hull(points):
    """Convex hull, counter-clockwise."""
    pts = sorted(set((float(p[0]), float(p[1])) for p in points))
    if len(pts) <= 2:
        return [list(p) for p in pts]
    halves = []
    for sequence in (pts, pts[::-1]):
        chain = []
        for p in sequence:
            while len(chain) >= 2:
                ax, ay = chain[-2]
                bx, by = chain[-1]
                if (bx - ax) * (p[1] - ay) - (by - ay) * (p[0] - ax) <= 0.0:
                    chain.pop()
                else:
                    break
            chain.append(p)
        halves.append(chain[:-1])
    return [list(p) for p in halves[0] + halves[1]]


def _prism(local, x, y, yaw, z0, z1):
    c = math.cos(yaw)
    s = math.sin(yaw)
    points = [(x + c * px - s * py, y + s * px + c * py) for px, py in local]
    return {"kind": "poly", "points": _hull(points), "z0": z0, "z1": z1}


def _collect_shapes(node, x, y, z, yaw, out):
    """All shapes of a bounding object, in world coordinates."""
    kind = node["type"]
    fields = node["fields"]
    if kind == "Box":
        sx, sy, sz = _vec(node, "size", (2.0, 2.0, 2.0))
        hx = 0.5 * sx
        hy = 0.5 * sy
        out.append(_prism([(-hx, -hy), (hx, -hy), (hx, hy), (-hx, hy)],
                          x, y, yaw, z - 0.5 * sz, z + 0.5 * sz))
    elif kind == "Cylinder":
        h = _vec(node, "height", (2.0,))[0]
        r = _vec(node, "radius", (1.0,))[0]
        out.append({"kind": "disc", "center": [x, y], "radius": r,
                    "z0": z - 0.5 * h, "z1": z + 0.5 * h})
    elif kind == "IndexedFaceSet":
        coord = fields.get("coord")
        if isinstance(coord, dict):
            raw = coord["fields"].get("point")
            if isinstance(raw, list):
                values = [v for v in raw if isinstance(v, float)]
                count = len(values) // 3
                if count > 0:
                    local = [(values[3 * k], values[3 * k + 1]) for k in range(count)]
                    zs = [values[3 * k + 2] for k in range(count)]
                    out.append(_prism(local, x, y, yaw, z + min(zs), z + max(zs)))
    elif kind == "Shape":
        for child in _child_nodes(fields.get("geometry")):
            _collect_shapes(child, x, y, z, yaw, out)
    elif kind == "Group":
        for child in _child_nodes(fields.get("children")):
            _collect_shapes(child, x, y, z, yaw, out)
    elif kind in ("Pose", "Transform"):
        tx, ty, tz = _vec(node, "translation", (0.0, 0.0, 0.0))
        c = math.cos(yaw)
        s = math.sin(yaw)
        turned = yaw + _yaw_of(node)
        for child in _child_nodes(fields.get("children")):
            _collect_shapes(child, x + c * tx - s * ty, y + s * tx + c * ty, z + tz,
                            turned, out)


def _poly_distance(points, X, Y):
    """Distance of points to a convex polygon, 0 inside."""
    n = len(points)
    best = np.full(X.shape, np.inf)
    inside = np.ones(X.shape, dtype=bool)
    for k in range(n):
        ax, ay = points[k][0], points[k][1]
        bx, by = points[(k + 1) % n][0], points[(k + 1) % n][1]
        dx = bx - ax
        dy = by - ay
        rx = X - ax
        ry = Y - ay
        length2 = dx * dx + dy * dy
        if length2 > 0.0:
            t = np.clip((rx * dx + ry * dy) / length2, 0.0, 1.0)
            d = np.hypot(rx - t * dx, ry - t * dy)
        else:
            d = np.hypot(rx, ry)
        best = np.minimum(best, d)
        inside &= (dx * ry - dy * rx) >= 0.0
    if n >= 3:
        best = np.where(inside, 0.0, best)
    return best


def _shape_distance(shape, X, Y):
    if shape["kind"] == "disc":
        cx, cy = shape["center"][0], shape["center"][1]
        return np.maximum(np.hypot(X - cx, Y - cy) - shape["radius"], 0.0)
    return _poly_distance(shape["points"], X, Y)


def _shape_box(shape):
    if shape["kind"] == "disc":
        cx, cy = shape["center"][0], shape["center"][1]
        r = shape["radius"]
        return cx - r, cy - r, cx + r, cy + r
    xs = [p[0] for p in shape["points"]]
    ys = [p[1] for p in shape["points"]]
    return min(xs), min(ys), max(xs), max(ys)


def _separated(p, q):
    """True if an edge normal of polygon p separates p and q."""
    n = len(p)
    for k in range(n):
        dx = p[(k + 1) % n][0] - p[k][0]
        dy = p[(k + 1) % n][1] - p[k][1]
        length = math.hypot(dx, dy)
        if length <= 0.0:
            continue
        ux = dy / length
        uy = -dx / length
        a = [v[0] * ux + v[1] * uy for v in p]
        b = [v[0] * ux + v[1] * uy for v in q]
        if max(a) <= min(b) + 1e-6 or max(b) <= min(a) + 1e-6:
            return True
    return False


def _overlap(a, b):
    """Do two shapes overlap, seen from above?"""
    if a["kind"] == "disc" and b["kind"] == "disc":
        gap = math.hypot(a["center"][0] - b["center"][0], a["center"][1] - b["center"][1])
        return gap < a["radius"] + b["radius"] - 1e-6
    if a["kind"] == "disc":
        d = _poly_distance(b["points"], np.array([a["center"][0]]), np.array([a["center"][1]]))
        return float(d[0]) < a["radius"] - 1e-6
    if b["kind"] == "disc":
        return _overlap(b, a)
    return not _separated(a["points"], b["points"]) and not _separated(b["points"], a["points"])


def _arena_local(arena, X, Y):
    c = math.cos(arena["yaw"])
    s = math.sin(arena["yaw"])
    dx = X - arena["x"]
    dy = Y - arena["y"]
    return c * dx + s * dy, c * dy - s * dx


def _arena_depth(arena, X, Y):
    """Below 0 inside the arena (minus the distance to its wall), above 0 outside."""
    u, v = _arena_local(arena, X, Y)
    if arena["kind"] == "circle":
        return np.hypot(u, v) - arena["radius"]
    return np.maximum(np.abs(u) - arena["hx"], np.abs(v) - arena["hy"])


def _wall_distance(arena, X, Y):
    """Distance to the wall of an arena, from inside and from outside; 0 in the wall."""
    u, v = _arena_local(arena, X, Y)
    t = arena["thickness"]
    if arena["kind"] == "circle":
        e = np.hypot(u, v) - arena["radius"]
        return np.where(e < 0.0, -e, np.maximum(e - t, 0.0))
    ax = np.abs(u) - arena["hx"]
    ay = np.abs(v) - arena["hy"]
    e = np.maximum(ax, ay)
    outer = np.hypot(np.maximum(ax - t, 0.0), np.maximum(ay - t, 0.0))
    return np.where(e < 0.0, -e, outer)


def _arena_box(arena):
    if arena["kind"] == "circle":
        ex = arena["radius"] + arena["thickness"]
        ey = ex
    else:
        c = abs(math.cos(arena["yaw"]))
        s = abs(math.sin(arena["yaw"]))
        hx = arena["hx"] + arena["thickness"]
        hy = arena["hy"] + arena["thickness"]
        ex = hx * c + hy * s
        ey = hx * s + hy * c
    return arena["x"] - ex, arena["y"] - ey, arena["x"] + ex, arena["y"] + ey


def _arena_contains(arena, x, y):
    return float(_arena_depth(arena, np.float64(x), np.float64(y))) < 0.0


def _floor_at(arenas, floors, x, y, default):
    heights = [a["z"] for a in arenas if _arena_contains(a, x, y)]
    if not heights:
        heights = [f["z"] for f in floors if _arena_contains(f, x, y)]
    return max(heights) if heights else default


def _make_arena(node):
    x, y, z = _vec(node, "translation", (0.0, 0.0, 0.0))
    arena = {"x": x, "y": y, "z": z, "yaw": _yaw_of(node), "thickness": 0.0, "height": 0.0}
    if node["type"] == "Floor":
        size = _vec(node, "size", (10.0, 10.0))
        arena["kind"] = "rect"
        arena["hx"] = 0.5 * size[0]
        arena["hy"] = 0.5 * size[1]
        return arena
    arena["thickness"] = _vec(node, "wallThickness", (0.01,))[0]
    arena["height"] = _vec(node, "wallHeight", (0.1,))[0]
    if node["type"] == "CircleArena":
        arena["kind"] = "circle"
        arena["radius"] = _vec(node, "radius", (1.0,))[0]
    else:
        size = _vec(node, "floorSize", (1.0, 1.0))
        arena["kind"] = "rect"
        arena["hx"] = 0.5 * size[0]
        arena["hy"] = 0.5 * size[1]
    return arena


def _settle(objects):
    """Let things with physics that hang in the air fall."""
    order = []
    supports = []
    for k, thing in enumerate(objects):
        if thing["pushable"]:
            order.append((min(s["z0"] for s in thing["shapes"]), k))
        else:
            supports.append(thing)
    order.sort()
    for bottom, k in order:
        thing = objects[k]
        gap = bottom - thing["ground"]
        if gap > 1e-6:
            for s in thing["shapes"]:
                for other in supports:
                    for q in other["shapes"]:
                        if q["z1"] <= s["z0"] + 1e-6 and s["z0"] - q["z1"] < gap:
                            if _overlap(s, q):
                                gap = s["z0"] - q["z1"]
            if gap > 0.0:
                for s in thing["shapes"]:
                    s["z0"] -= gap
                    s["z1"] -= gap
        supports.append(thing)


def _union_box(boxes):
    return [min(b[0] for b in boxes), min(b[1] for b in boxes),
            max(b[2] for b in boxes), max(b[3] for b in boxes)]


def parse_world(text):
    nodes = _top_nodes(text)
    start = (0.0, 0.0, 0.0)
    goal = None
    goal_rank = 0
    arenas = []
    floors = []
    solids = []
    for node in nodes:
        kind = node["type"]
        if kind == "E-puck":
            x, y, z = _vec(node, "translation", (0.0, 0.0, 0.0))
            start = (x, y, _wrap(_yaw_of(node)))
        elif kind in ("CircleArena", "RectangleArena"):
            arenas.append(_make_arena(node))
        elif kind == "Floor":
            floors.append(_make_arena(node))
        elif kind == "Solid":
            rank = 0
            if node["def"] == "GOAL":
                rank += 2
            if node["fields"].get("name") == "GOAL":
                rank += 1
            if rank > goal_rank:
                goal_rank = rank
                x, y, z = _vec(node, "translation", (0.0, 0.0, 0.0))
                goal = (x, y)
            solids.append(node)
    if goal is None:
        goal = (start[0], start[1])

    floor_z = _floor_at(arenas, floors, start[0], start[1], 0.0)

    objects = []
    for node in solids:
        bound = node["fields"].get("boundingObject")
        if not isinstance(bound, dict):
            continue
        x, y, z = _vec(node, "translation", (0.0, 0.0, 0.0))
        shapes = []
        _collect_shapes(bound, x, y, z, _yaw_of(node), shapes)
        if not shapes:
            continue
        name = node["fields"].get("name")
        objects.append({
            "name": name if isinstance(name, str) else "",
            "pushable": isinstance(node["fields"].get("physics"), dict),
            "ground": _floor_at(arenas, floors, x, y, floor_z),
            "shapes": shapes,
        })
    _settle(objects)

    low = floor_z + BODY_LOW
    high = floor_z + BODY_HIGH
    obstacles = []
    boxes_all = [(start[0], start[1], start[0], start[1]), (goal[0], goal[1], goal[0], goal[1])]
    boxes_block = list(boxes_all)
    for thing in objects:
        for s in thing["shapes"]:
            box = _shape_box(s)
            boxes_all.append(box)
            if s["z1"] > low + 1e-9 and s["z0"] < high - 1e-9:
                item = dict(s)
                item["name"] = thing["name"]
                item["pushable"] = thing["pushable"]
                obstacles.append(item)
                boxes_block.append(box)

    walls = []
    closed = False
    for a in arenas:
        if a["z"] + a["height"] > low + 1e-9 and a["z"] < high - 1e-9:
            a["home"] = _arena_contains(a, start[0], start[1])
            if a["home"]:
                closed = True
            walls.append(a)
            boxes_all.append(_arena_box(a))
            boxes_block.append(_arena_box(a))
        else:
            floors.append(a)
    boxes_floor = boxes_all + [_arena_box(f) for f in floors]

    return {
        "start": start,
        "goal": goal,
        "arena": {"walls": walls, "floors": floors, "closed": closed, "floor_z": floor_z},
        "obstacles": obstacles,
        "extents": [_union_box(boxes_floor), _union_box(boxes_all), _union_box(boxes_block)],
    }


# --------------------------------------------------------------------------
# grid
# --------------------------------------------------------------------------

def _cells_in(box, resolution):
    return ((box[2] - box[0]) / resolution + 1.0) * ((box[3] - box[1]) / resolution + 1.0)


def _grid_box(world, resolution):
    arena = world["arena"]
    if arena["closed"]:
        border = 2.0 * resolution
        choices = [_union_box([_arena_box(a) for a in arena["walls"]]),
                   _union_box([_arena_box(a) for a in arena["walls"] if a["home"]])]
    else:
        border = OPEN_BORDER + 2.0 * resolution
        choices = list(world["extents"])
    chosen = None
    for box in choices:
        chosen = [float(box[0]) - border, float(box[1]) - border,
                  float(box[2]) + border, float(box[3]) + border]
        if _cells_in(chosen, resolution) <= MAX_CELLS:
            break
    return chosen


def build_grid(world, resolution, inflation):
    res = float(resolution)
    room = float(inflation)
    box = _grid_box(world, res)
    x0 = box[0]
    y0 = box[1]
    nx = max(1, int(math.ceil((box[2] - x0) / res)))
    ny = max(1, int(math.ceil((box[3] - y0) / res)))
    xs = x0 + (np.arange(nx) + 0.5) * res
    ys = y0 + (np.arange(ny) + 0.5) * res
    occ = np.zeros((ny, nx), dtype=bool)
    walls = world["arena"]["walls"]
    if len(walls) > 0:
        X, Y = np.meshgrid(xs, ys)
        if world["arena"]["closed"]:
            inside = np.zeros((ny, nx), dtype=bool)
            for a in walls:
                inside |= _arena_depth(a, X, Y) < 0.0
            occ |= ~inside
        for a in walls:
            d = _wall_distance(a, X, Y)
            occ |= (d < room) | (d <= 0.0)
    for shape in world["obstacles"]:
        bx0, by0, bx1, by1 = _shape_box(shape)
        i0 = max(0, int(math.floor((bx0 - room - x0) / res)) - 1)
        i1 = min(nx, int(math.ceil((bx1 + room - x0) / res)) + 2)
        j0 = max(0, int(math.floor((by0 - room - y0) / res)) - 1)
        j1 = min(ny, int(math.ceil((by1 + room - y0) / res)) + 2)
        if i0 >= i1 or j0 >= j1:
            continue
        X, Y = np.meshgrid(xs[i0:i1], ys[j0:j1])
        d = _shape_distance(shape, X, Y)
        occ[j0:j1, i0:i1] |= (d < room) | (d <= 0.0)
    return occ, (x0, y0)


def _clearance(world, X, Y):
    """Distance of points to the nearest solid thing or wall, 0 inside or outside the arena."""
    best = np.full(X.shape, np.inf)
    walls = world["arena"]["walls"]
    if world["arena"]["closed"]:
        inside = np.zeros(X.shape, dtype=bool)
        for a in walls:
            inside |= _arena_depth(a, X, Y) < 0.0
        best = np.where(inside, best, 0.0)
    for a in walls:
        best = np.minimum(best, _wall_distance(a, X, Y))
    for shape in world["obstacles"]:
        best = np.minimum(best, _shape_distance(shape, X, Y))
    return best


# --------------------------------------------------------------------------
# A*
# --------------------------------------------------------------------------

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
    padded = np.ones((ny + 2, w), dtype=bool)
    padded[1:-1, 1:-1] = grid
    blocked = padded.ravel().tolist()
    total = len(blocked)
    source = (sy + 1) * w + sx + 1
    target = (gy + 1) * w + gx + 1
    tx = gx + 1
    ty = gy + 1
    root2 = math.sqrt(2.0)
    extra = root2 - 2.0
    cost = [math.inf] * total
    parent = [-1] * total
    done = bytearray(total)
    straight = (1, -1, w, -w)
    diagonal = ((w + 1, w, 1), (w - 1, w, -1), (1 - w, -w, 1), (-w - 1, -w, -1))
    cost[source] = 0.0
    heap = [(0.0, 0.0, source)]
    found = False
    while heap:
        current = heapq.heappop(heap)[2]
        if done[current]:
            continue
        if current == target:
            found = True
            break
        done[current] = 1
        base = cost[current]
        moves = []
        for step in straight:
            nxt = current + step
            if not blocked[nxt] and not done[nxt]:
                moves.append((nxt, base + 1.0))
        for step, side_a, side_b in diagonal:
            nxt = current + step
            if blocked[nxt] or done[nxt]:
                continue
            if blocked[current + side_a] or blocked[current + side_b]:
                continue
            moves.append((nxt, base + root2))
        for nxt, value in moves:
            if value < cost[nxt] - 1e-12:
                cost[nxt] = value
                parent[nxt] = current
                dy = abs(nxt // w - ty)
                dx = abs(nxt % w - tx)
                h = dx + dy + extra * (dx if dx < dy else dy)
                heapq.heappush(heap, (value + h, h, nxt))
    if not found:
        return []
    cells = []
    k = target
    while k != -1:
        cells.append((k % w - 1, k // w - 1))
        k = parent[k]
    cells.reverse()
    return cells


# --------------------------------------------------------------------------
# planning
# --------------------------------------------------------------------------

def _line_free(occ, x0, y0, res, a, b):
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    n = int(length / (0.2 * res)) + 2
    t = np.linspace(0.0, 1.0, n)
    ix = np.floor((a[0] + (b[0] - a[0]) * t - x0) / res).astype(int)
    iy = np.floor((a[1] + (b[1] - a[1]) * t - y0) / res).astype(int)
    ny, nx = occ.shape
    if ix.min() < 0 or iy.min() < 0 or ix.max() >= nx or iy.max() >= ny:
        return False
    return not bool(occ[iy, ix].any())


def _entry_cell(world, occ, x0, y0, res, point):
    """The cell of a point, or the nearest free one that the body gets straight to."""
    ny, nx = occ.shape
    ix = int(math.floor((point[0] - x0) / res))
    iy = int(math.floor((point[1] - y0) / res))
    if 0 <= ix < nx and 0 <= iy < ny and not occ[iy, ix]:
        return ix, iy
    rows, cols = np.nonzero(~occ)
    if rows.size == 0:
        return None
    cx = x0 + (cols + 0.5) * res
    cy = y0 + (rows + 0.5) * res
    away = np.hypot(cx - point[0], cy - point[1])
    order = np.argsort(away, kind="stable")
    tries = list(order[:40]) + list(order[40:400:12])
    for k in tries:
        if away[k] > 0.3:
            break
        n = int(away[k] / 0.002) + 2
        t = np.linspace(0.0, 1.0, n)
        c = _clearance(world, point[0] + (cx[k] - point[0]) * t,
                       point[1] + (cy[k] - point[1]) * t)
        if float(c.min()) >= min(BODY_RADIUS + 0.0005, float(c[0])) - 1e-6:
            return int(cols[k]), int(rows[k])
    return None


def _final_point(world, goal):
    """The goal, or a point close to it where the body fits."""
    gx = np.array([goal[0]])
    gy = np.array([goal[1]])
    if float(_clearance(world, gx, gy)[0]) >= BODY_RADIUS + 0.0015:
        return goal
    px = []
    py = []
    for ring in (0.004, 0.008, 0.012, 0.016):
        for k in range(24):
            angle = 2.0 * math.pi * k / 24.0
            px.append(goal[0] + ring * math.cos(angle))
            py.append(goal[1] + ring * math.sin(angle))
    c = _clearance(world, np.array(px), np.array(py))
    for k in range(len(px)):
        if float(c[k]) >= BODY_RADIUS + 0.002:
            return px[k], py[k]
    k = int(np.argmax(c))
    return px[k], py[k]


def _path_length(points):
    total = 0.0
    for k in range(len(points) - 1):
        total += math.hypot(points[k + 1][0] - points[k][0], points[k + 1][1] - points[k][1])
    return total


def _plan_once(world, start, goal, res, margin):
    room = BODY_RADIUS + HALF_DIAGONAL * res + margin
    occ, origin = build_grid(world, res, room)
    x0, y0 = origin
    s = _entry_cell(world, occ, x0, y0, res, start)
    if s is None:
        return None
    g = _entry_cell(world, occ, x0, y0, res, goal)
    if g is None:
        return None
    cells = astar(occ, s, g)
    if not cells:
        return None
    points = [start]
    for ix, iy in cells:
        points.append((x0 + (ix + 0.5) * res, y0 + (iy + 0.5) * res))
    points.append(goal)
    path = [points[0]]
    i = 0
    last = len(points) - 1
    while i < last:
        j = last
        while j > i + 1 and not _line_free(occ, x0, y0, res, points[i], points[j]):
            j -= 1
        path.append(points[j])
        i = j
    return path


def _plan(world, start, goal):
    """Waypoints from start to goal: the widest margin that costs no large detour."""
    target = _final_point(world, goal)
    shortest = _plan_once(world, start, target, GRID_STEP, MARGINS[-1])
    if shortest is None:
        for res, margin in ((0.005, 0.001), (0.004, 0.0)):
            path = _plan_once(world, start, target, res, margin)
            if path is not None:
                return path
        return [start, target]
    limit = 1.2 * _path_length(shortest) + 0.05
    for margin in MARGINS[:-1]:
        path = _plan_once(world, start, target, GRID_STEP, margin)
        if path is not None and _path_length(path) <= limit:
            return path
    return shortest


# --------------------------------------------------------------------------
# driving
# --------------------------------------------------------------------------

def _ps_distance(reading):
    return float(np.interp(float(reading), PS_TABLE_READING, PS_TABLE_DISTANCE))


def compute_wheel_speeds(pose_xy, yaw, waypoint_xy, prox):
    dx = float(waypoint_xy[0]) - float(pose_xy[0])
    dy = float(waypoint_xy[1]) - float(pose_xy[1])
    c = math.cos(float(yaw))
    s = math.sin(float(yaw))
    ahead = c * dx + s * dy
    left_of = c * dy - s * dx
    distance = math.hypot(ahead, left_of)
    if distance < 0.002:
        return 0.0, 0.0
    angle = math.atan2(left_of, ahead)
    if abs(angle) > math.pi - 1e-6:
        angle = math.pi

    if prox is not None and len(prox) >= 8:
        front = max(float(prox[0]), float(prox[7]))
        if front > 600.0 and abs(angle) < 0.6 and distance > _ps_distance(front):
            right_side = float(prox[0]) + float(prox[1]) + float(prox[2])
            left_side = float(prox[7]) + float(prox[6]) + float(prox[5])
            spin = 0.35 * MAX_WHEEL_SPEED
            if left_side > right_side + 1.0:
                spin = -spin
            elif abs(left_side - right_side) <= 1.0 and angle < -1e-6:
                spin = -spin
            return -spin, spin

    turn = max(-5.0, min(5.0, 10.0 * angle))
    forward = min(CRUISE, max(1.0, 150.0 * distance)) * max(0.0, 1.0 - abs(angle) / 0.25)
    forward = min(forward, MAX_WHEEL_SPEED - abs(turn))
    left = max(-MAX_WHEEL_SPEED, min(MAX_WHEEL_SPEED, forward - turn))
    right = max(-MAX_WHEEL_SPEED, min(MAX_WHEEL_SPEED, forward + turn))
    return left, right


def _load_world():
    if _STATE["world"] is None:
        text = (sensors.HERE / WORLD_FILE).read_text(encoding="utf-8")
        _STATE["world"] = parse_world(text)
    return _STATE["world"]


def _make_plan(obs):
    start = (float(obs["pose"][0]), float(obs["pose"][1]))
    goal = (float(obs["goal"][0]), float(obs["goal"][1]))
    _STATE["path"] = _plan(_load_world(), start, goal)
    _STATE["index"] = 1
    _STATE["last"] = start


def reset(obs):
    _make_plan(obs)


def policy(obs):
    x = float(obs["pose"][0])
    y = float(obs["pose"][1])
    yaw = float(obs["pose"][2])
    if _STATE["path"] is None:
        _make_plan(obs)
    else:
        last = _STATE["last"]
        if math.hypot(x - last[0], y - last[1]) > 0.03 and _STATE["replans"] < MAX_REPLANS:
            _STATE["replans"] += 1
            _make_plan(obs)
    _STATE["last"] = (x, y)
    path = _STATE["path"]
    k = min(_STATE["index"], len(path) - 1)
    while k < len(path) - 1 and math.hypot(path[k][0] - x, path[k][1] - y) < SWITCH_DISTANCE:
        k += 1
    _STATE["index"] = k
    left, right = compute_wheel_speeds((x, y), yaw, path[k], None)
    return (max(-1.0, min(1.0, left / MAX_WHEEL_SPEED)),
            max(-1.0, min(1.0, right / MAX_WHEEL_SPEED)))


def run_episode(env, max_steps):
    obs, info = env.reset()
    reset(obs)
    positions = [(float(obs["pose"][0]), float(obs["pose"][1]))]
    goal = (float(obs["goal"][0]), float(obs["goal"][1]))
    speeds = []
    collisions = int(info.get("collisions", 0))
    for _ in range(int(max_steps)):
        left, right = policy(obs)
        obs, reward, terminated, truncated, info = env.step((left, right))
        applied_left = max(-1.0, min(1.0, float(left)))
        applied_right = max(-1.0, min(1.0, float(right)))
        speeds.append((applied_left + applied_right) / 2.0 * FULL_SPEED)
        positions.append((float(obs["pose"][0]), float(obs["pose"][1])))
        collisions = int(info.get("collisions", collisions))
        if terminated or truncated:
            break
    return {
        "positions": positions,
        "speeds": speeds,
        "collisions": collisions,
        "goal": goal,
        "dt": STEP_SECONDS,
    }


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
