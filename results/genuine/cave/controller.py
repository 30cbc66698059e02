"""Differential-drive controller: plan once on the inflated map, follow by pursuit."""

import heapq
import math

import numpy as np

import sensors

MAP_IMG = "occupancy.png"
PARAMS_JSON = "params.json"
ROBOT_IMG = "robot.png"

AXLE_LENGTH_PX = 24.0
SENSOR_RANGE_PX = 220.0
SENSOR_FOV_DEG = 110.0
N_RAYS = 18

LOOKAHEAD = 26.0  # px along the path
STOP_DIST = 4.0  # px from the goal: stand still
SLOW_DIST = 40.0  # px from the goal: drive slowly

MAX_WHEEL_SPEED = 75.59  # px/s
BODY_RADIUS = 12.0  # px
DT = 0.05  # s
TURN_PER_STEP = MAX_WHEEL_SPEED * DT / AXLE_LENGTH_PX  # rad per unit of left - right

GRID = 2  # px, planning lattice
SPACING = 2.0  # px between points of the final path
CLEAR_CAP = 30  # px, clearance is not measured beyond this
COMFORT = 26.0  # px, clearance from which on nothing is charged
THRESHOLDS = (14.5, 13.8, 13.2, 12.7, 12.3)  # px, least clearance of the plan
PENALTIES = (8.0, 4.0, 2.0, 0.8)
DETOUR = 1.22  # longest accepted path relative to the shortest
SMOOTH_FLOOR = 18.0  # px, smoothing may spend clearance above this
SAFE_CLEARANCE = 12.4  # px, centre to wall, of a predicted motion

SPEED_FAST = 0.85
SPEED_NARROW = 0.42
TURN_GAIN = 0.5
TURN_ONLY = 0.6  # rad, above this turn in place
MAX_TURN = 0.28  # rad per step

STUCK_STEPS = 70
MAX_REPLANS = 5

DIRECTIONS = (
    (1, 0),
    (-1, 0),
    (0, 1),
    (0, -1),
    (1, 1),
    (1, -1),
    (-1, 1),
    (-1, -1),
)

PATCH = 18  # px, half width of the patch of the exact clearance
PAD = 24  # px, rim of the padded map
OFFSETS = np.arange(-PATCH, PATCH + 1, dtype=float)

_DATA = {}
_STATE = {"follower": None}


class OccMap2D:
    """Occupancy grid, indexed [y, x]; everything outside is occupied."""

    def __init__(self, occ):
        self.occ = np.asarray(occ, dtype=bool)
        self.height, self.width = self.occ.shape

    def is_occupied(self, x, y):
        i = math.floor(x + 0.5)
        j = math.floor(y + 0.5)
        if i < 0 or j < 0 or i >= self.width or j >= self.height:
            return True
        return bool(self.occ[j, i])


def nearest_free(map2d, x, y, max_rad):
    """The free pixel nearest to (x, y), at most max_rad away."""
    if not map2d.is_occupied(x, y):
        return int(math.floor(x + 0.5)), int(math.floor(y + 0.5))
    left = math.ceil(max(0, x - max_rad))
    right = math.floor(min(map2d.width - 1, x + max_rad))
    top = math.ceil(max(0, y - max_rad))
    bottom = math.floor(min(map2d.height - 1, y + max_rad))
    if right < left or bottom < top:
        raise ValueError("no free pixel within the radius")
    xs = np.arange(left, right + 1, dtype=float) - float(x)
    ys = np.arange(top, bottom + 1, dtype=float) - float(y)
    d2 = ys[:, None] ** 2 + xs[None, :] ** 2
    taken = map2d.occ[top : bottom + 1, left : right + 1]
    d2 = np.where(taken, math.inf, d2)
    k = int(np.argmin(d2))
    row, col = divmod(k, d2.shape[1])
    least = float(d2[row, col])
    if not math.isfinite(least) or least > max_rad * max_rad + 1e-9:
        raise ValueError("no free pixel within the radius")
    return int(left + col), int(top + row)


def _shifted(padded, cell, x0, y0, nx, ny, ox, oy):
    """Lattice view of the padded map, displaced by (ox, oy) pixels."""
    top = cell + y0 + oy
    left = cell + x0 + ox
    return padded[
        top : top + (ny - 1) * cell + 1 : cell,
        left : left + (nx - 1) * cell + 1 : cell,
    ]


def _move_masks(free, x0, y0, cell):
    """For each lattice node the set of allowed moves, as 8 bits."""
    height, width = free.shape
    nx = (width - 1 - x0) // cell + 1
    ny = (height - 1 - y0) // cell + 1
    padded = np.zeros((height + 2 * cell, width + 2 * cell), dtype=bool)
    padded[cell : cell + height, cell : cell + width] = free
    masks = np.zeros((ny, nx), dtype=np.uint8)
    for bit, (dx, dy) in enumerate(DIRECTIONS):
        ok = _shifted(padded, cell, x0, y0, nx, ny, 0, 0).copy()
        for t in range(1, cell + 1):
            ok &= _shifted(padded, cell, x0, y0, nx, ny, t * dx, t * dy)
            if dx and dy:
                ok &= _shifted(padded, cell, x0, y0, nx, ny, t * dx, (t - 1) * dy)
                ok &= _shifted(padded, cell, x0, y0, nx, ny, (t - 1) * dx, t * dy)
        masks |= ok.astype(np.uint8) << np.uint8(bit)
    return masks


def _octile(nx, ny, gx, gy):
    """Octile distance of every lattice node to node (gx, gy), flat list."""
    dx = np.abs(np.arange(nx, dtype=float) - gx)[None, :]
    dy = np.abs(np.arange(ny, dtype=float) - gy)[:, None]
    h = dx + dy + (math.sqrt(2.0) - 2.0) * np.minimum(dx, dy)
    return (h * (1.0 - 1e-9)).ravel().tolist()


def _search(masks, nx, start, goal, weights, heur):
    """A* over flat lattice indices; a list of indices, [] without a path."""
    moves = []
    for mask in range(256):
        allowed = []
        for bit, (dx, dy) in enumerate(DIRECTIONS):
            if (mask >> bit) & 1:
                half = 0.5 * (math.sqrt(2.0) if dx and dy else 1.0)
                allowed.append((dy * nx + dx, half))
        moves.append(tuple(allowed))
    n = len(masks)
    best = [math.inf] * n
    parent = [-1] * n
    done = bytearray(n)
    best[start] = 0.0
    heap = [(heur[start], start)]
    pop, push = heapq.heappop, heapq.heappush
    while heap:
        i = pop(heap)[1]
        if done[i]:
            continue
        if i == goal:
            break
        done[i] = 1
        gi = best[i]
        wi = weights[i]
        for delta, half in moves[masks[i]]:
            j = i + delta
            if done[j]:
                continue
            cost = gi + half * (wi + weights[j])
            if cost < best[j]:
                best[j] = cost
                parent[j] = i
                push(heap, (cost + heur[j], j))
    if best[goal] == math.inf:
        return []
    trail = [goal]
    while trail[-1] != start:
        trail.append(parent[trail[-1]])
    trail.reverse()
    return trail


def plan_path(map2d, start, goal, cell):
    """Shortest 8-connected path of steps of `cell` px for a point."""
    sx, sy = int(start[0]), int(start[1])
    gx, gy = int(goal[0]), int(goal[1])
    cell = int(cell)
    if map2d.is_occupied(sx, sy) or map2d.is_occupied(gx, gy):
        return []
    if (sx, sy) == (gx, gy):
        return [(sx, sy)]
    if cell < 1 or (gx - sx) % cell or (gy - sy) % cell:
        return []
    x0, y0 = sx % cell, sy % cell
    masks = _move_masks(~map2d.occ, x0, y0, cell)
    ny, nx = masks.shape
    ix, iy = (gx - x0) // cell, (gy - y0) // cell
    first = ((sy - y0) // cell) * nx + (sx - x0) // cell
    heur = _octile(nx, ny, ix, iy)
    ones = [1.0] * (nx * ny)
    trail = _search(masks.tobytes(), nx, first, iy * nx + ix, ones, heur)
    return [(int(x0 + cell * (k % nx)), int(y0 + cell * (k // nx))) for k in trail]


def _load_map():
    """The occupancy array; the .npy copy is the quicker one to read."""
    try:
        return sensors.load_occupancy("occupancy.npy")
    except (OSError, ValueError):
        return sensors.load_occupancy(MAP_IMG)


def _clearance_map(occ):
    """Distance from each pixel's centre to the nearest occupied square, capped."""
    height, width = occ.shape
    gap = np.empty((height, width), dtype=np.float32)
    run = np.zeros(width, dtype=np.float32)
    for j in range(height):
        run = np.where(occ[j], np.float32(0), run + np.float32(1))
        gap[j] = run
    run = np.zeros(width, dtype=np.float32)
    for j in range(height - 1, -1, -1):
        run = np.where(occ[j], np.float32(0), run + np.float32(1))
        gap[j] = np.minimum(gap[j], run)
    reach = CLEAR_CAP + 1
    square = np.zeros((height, width + 2 * reach), dtype=np.float32)
    square[:, reach : reach + width] = np.maximum(gap - np.float32(0.5), 0) ** 2
    least = np.full((height, width), float(CLEAR_CAP) ** 2, dtype=np.float32)
    for dx in range(-reach, reach + 1):
        side = np.float32(max(abs(dx) - 0.5, 0.0) ** 2)
        np.minimum(least, square[:, reach + dx : reach + dx + width] + side, out=least)
    return np.sqrt(least)


def _map_data():
    """Map, padded map and clearance, made at the first call."""
    if "clear" not in _DATA:
        occ = np.asarray(_load_map(), dtype=bool)
        _DATA["occ"] = occ
        _DATA["padded"] = np.pad(occ, PAD, constant_values=True)
        _DATA["clear"] = _clearance_map(occ)
    return _DATA


def _clear_at(clear, xs, ys):
    """Clearance at points, interpolated between pixel centres."""
    height, width = clear.shape
    xs = np.clip(np.asarray(xs, dtype=float), 0.0, width - 1.001)
    ys = np.clip(np.asarray(ys, dtype=float), 0.0, height - 1.001)
    i = xs.astype(np.int64)
    j = ys.astype(np.int64)
    fx = xs - i
    fy = ys - j
    upper = clear[j, i] * (1.0 - fx) + clear[j, i + 1] * fx
    lower = clear[j + 1, i] * (1.0 - fx) + clear[j + 1, i + 1] * fx
    return upper * (1.0 - fy) + lower * fy


def _segment_clearance(clear, x, y, tx, ty):
    """Least interpolated clearance along a straight segment."""
    n = max(2, int(math.hypot(tx - x, ty - y) / 1.5) + 2)
    ts = np.linspace(0.0, 1.0, n)
    return float(_clear_at(clear, x + (tx - x) * ts, y + (ty - y) * ts).min())


def _exact_clearance(padded, x, y):
    """Exact distance from (x, y) to the nearest occupied square, up to PATCH."""
    height = padded.shape[0] - 2 * PAD
    width = padded.shape[1] - 2 * PAD
    i = math.floor(x + 0.5)
    j = math.floor(y + 0.5)
    if i < 0 or j < 0 or i >= width or j >= height:
        return 0.0
    part = padded[
        j + PAD - PATCH : j + PAD + PATCH + 1,
        i + PAD - PATCH : i + PAD + PATCH + 1,
    ]
    ax = np.maximum(np.abs(OFFSETS + (i - x)) - 0.5, 0.0) ** 2
    ay = np.maximum(np.abs(OFFSETS + (j - y)) - 0.5, 0.0) ** 2
    d2 = np.where(part, ay[:, None] + ax[None, :], float(PATCH * PATCH))
    return math.sqrt(float(d2.min()))


def _snap_start(clear, free, x, y, strict):
    """Free pixel near the start that is reached in a straight line, or None."""
    height, width = free.shape
    left, right = max(0, int(x) - 30), min(width - 1, int(x) + 31)
    top, bottom = max(0, int(y) - 30), min(height - 1, int(y) + 31)
    if right < left or bottom < top:
        return None
    rows, cols = np.nonzero(free[top : bottom + 1, left : right + 1])
    if rows.size == 0:
        return None
    px = cols + left
    py = rows + top
    order = np.argsort((px - x) ** 2 + (py - y) ** 2, kind="stable")
    here = float(_clear_at(clear, [x], [y])[0])
    need = min(SAFE_CLEARANCE, here) - 0.15
    for k in order[:300].tolist():
        cx, cy = int(px[k]), int(py[k])
        if _segment_clearance(clear, x, y, cx, cy) >= need:
            return cx, cy
    if strict:
        return None
    k = int(order[0])
    return int(px[k]), int(py[k])


def _trail_length(trail, nx):
    """Length of a lattice path, in lattice units."""
    cells = np.asarray(trail)
    dx = np.diff(cells % nx)
    dy = np.diff(cells // nx)
    return float(np.hypot(dx, dy).sum())


def _resample(points):
    """The polyline with points SPACING apart."""
    steps = np.hypot(np.diff(points[:, 0]), np.diff(points[:, 1]))
    keep = np.concatenate(([True], steps > 1e-9))
    points = points[keep]
    if len(points) < 2:
        return points
    steps = np.hypot(np.diff(points[:, 0]), np.diff(points[:, 1]))
    along = np.concatenate(([0.0], np.cumsum(steps)))
    n = max(2, int(math.ceil(along[-1] / SPACING)) + 1)
    marks = np.linspace(0.0, along[-1], n)
    xs = np.interp(marks, along, points[:, 0])
    ys = np.interp(marks, along, points[:, 1])
    return np.stack((xs, ys), axis=1)


def _smooth(clear, points):
    """Straightens the path where that costs no clearance that is needed."""
    points = _resample(points)
    if len(points) < 3:
        return points
    now = _clear_at(clear, points[:, 0], points[:, 1])
    for _ in range(80):
        moved = points.copy()
        middle = 0.5 * (points[:-2] + points[2:])
        moved[1:-1] += 0.5 * (middle - points[1:-1])
        then = _clear_at(clear, moved[:, 0], moved[:, 1])
        better = then >= np.minimum(now, SMOOTH_FLOOR) - 1e-6
        points = np.where(better[:, None], moved, points)
        now = np.where(better, then, now)
    return _resample(points)


def _lattice_route(clear, x, y, gx, gy, threshold, strict):
    """Points of a route at this clearance, or None."""
    free = clear >= threshold
    start = _snap_start(clear, free, x, y, strict)
    if start is None:
        return None
    x0, y0 = start[0] % GRID, start[1] % GRID
    nodes = free[y0::GRID, x0::GRID]
    ny, nx = nodes.shape
    dx = x0 + GRID * np.arange(nx, dtype=float) - gx
    dy = y0 + GRID * np.arange(ny, dtype=float) - gy
    away = np.where(nodes, dy[:, None] ** 2 + dx[None, :] ** 2, math.inf)
    last = int(np.argmin(away))
    nearest = float(away.ravel()[last])
    if not math.isfinite(nearest) or (strict and nearest > 15.0**2):
        return None
    masks = _move_masks(free, x0, y0, GRID).tobytes()
    first = ((start[1] - y0) // GRID) * nx + (start[0] - x0) // GRID
    heur = _octile(nx, ny, last % nx, last // nx)
    trail = _search(masks, nx, first, last, [1.0] * (nx * ny), heur)
    if not trail:
        return None
    longest = DETOUR * _trail_length(trail, nx) + 20.0 / GRID
    short = (COMFORT - clear[y0::GRID, x0::GRID].astype(float)) / (COMFORT - BODY_RADIUS)
    charge = np.clip(short, 0.0, 1.0) ** 2
    for penalty in PENALTIES:
        weights = (1.0 + penalty * charge).ravel().tolist()
        wide = _search(masks, nx, first, last, weights, heur)
        if wide and _trail_length(wide, nx) <= longest:
            trail = wide
            break
    points = [(float(x), float(y))]
    for k in trail:
        points.append((float(x0 + GRID * (k % nx)), float(y0 + GRID * (k // nx))))
    end = points[-1]
    if _segment_clearance(clear, end[0], end[1], gx, gy) >= 12.7:
        points.append((float(gx), float(gy)))
    return np.asarray(points, dtype=float)


def _make_route(x, y, gx, gy):
    """Dense path from (x, y) to the goal, shape (n, 2)."""
    clear = _map_data()["clear"]
    for strict in (True, False):
        for threshold in THRESHOLDS:
            points = _lattice_route(clear, x, y, gx, gy, threshold, strict)
            if points is not None:
                return _smooth(clear, points)
    return _resample(np.asarray([(x, y), (gx, gy)], dtype=float))


def _wrap(angle):
    """The angle in [-pi, pi]."""
    return math.atan2(math.sin(angle), math.cos(angle))


def _arc_point(x, y, heading, left, right, seconds):
    """Position after driving with constant wheel speeds."""
    v = 0.5 * (left + right) * MAX_WHEEL_SPEED
    w = (left - right) * MAX_WHEEL_SPEED / AXLE_LENGTH_PX
    if abs(w) < 1e-6:
        return (
            x + v * seconds * math.cos(heading),
            y + v * seconds * math.sin(heading),
        )
    turned = heading + w * seconds
    return (
        x + v / w * (math.sin(turned) - math.sin(heading)),
        y - v / w * (math.cos(turned) - math.cos(heading)),
    )


def _arc_is_safe(padded, x, y, heading, left, right, need):
    """Whether the next one and a half steps keep the clearance `need`."""
    for part in (0.25, 0.5, 0.75, 1.0, 1.5):
        px, py = _arc_point(x, y, heading, left, right, part * DT)
        if _exact_clearance(padded, px, py) < need:
            return False
    return True


class Follower:
    """Follows one planned path."""

    def __init__(self, x, y, gx, gy):
        self.goal = (gx, gy)
        self.replans = 0
        data = _map_data()
        self.clear = data["clear"]
        self.padded = data["padded"]
        self.plan(x, y)

    def plan(self, x, y):
        self.path = _make_route(x, y, self.goal[0], self.goal[1])
        self.path_clear = _clear_at(self.clear, self.path[:, 0], self.path[:, 1])
        self.index = 0
        self.since = 0
        self.blocked = 0
        self.escape = (x, y)
        self.escape_left = 0

    def advance(self, x, y):
        """Moves the index along the path; replans when lost or stuck."""
        part = self.path[self.index : self.index + 16]
        d2 = (part[:, 0] - x) ** 2 + (part[:, 1] - y) ** 2
        k = int(np.argmin(d2))
        off = math.sqrt(float(d2[k]))
        if k > 0:
            self.index += k
            self.since = 0
        else:
            self.since += 1
        if self.since <= STUCK_STEPS and off <= 30.0:
            return
        if self.replans < MAX_REPLANS:
            self.replans += 1
            self.plan(x, y)
        elif self.since > STUCK_STEPS:
            self.since = 0
            self.start_escape(x, y)

    def start_escape(self, x, y):
        """Picks the direction with the most room for a short move."""
        best, choice = -1.0, (x, y)
        for k in range(24):
            angle = 2.0 * math.pi * k / 24
            px, py = x + 4.0 * math.cos(angle), y + 4.0 * math.sin(angle)
            room = _exact_clearance(self.padded, px, py)
            if room > best:
                best, choice = room, (px, py)
        self.escape = choice
        self.escape_left = 25
        self.blocked = 0

    def target(self, x, y, here):
        """The farthest point of the path ahead that is safely in sight."""
        last = len(self.path) - 1
        end = self.path[last]
        if self.index >= last - 1 and math.hypot(end[0] - x, end[1] - y) < 3.0:
            return self.goal
        far = max(3, int(LOOKAHEAD / SPACING))
        for ahead in range(far, 2, -2):
            k = min(self.index + ahead, last)
            least = float(self.path_clear[self.index : k + 1].min())
            need = max(min(15.5, least, here) - 0.35, min(12.5, here - 0.02))
            tx, ty = float(self.path[k, 0]), float(self.path[k, 1])
            if _segment_clearance(self.clear, x, y, tx, ty) >= need:
                return tx, ty
        k = min(self.index + 2, last)
        return float(self.path[k, 0]), float(self.path[k, 1])

    def cruise(self, here, ranges, goal_dist):
        """Forward speed allowed by the surroundings, as a fraction."""
        room = min(max((here - 14.0) / 10.0, 0.0), 1.0)
        speed = SPEED_NARROW + (SPEED_FAST - SPEED_NARROW) * room
        n = len(ranges)
        if n:
            front = min(ranges[max(0, n // 2 - 3) : n // 2 + 3])
            speed = min(speed, max(0.4, (front - BODY_RADIUS) / 50.0))
        if goal_dist < SLOW_DIST:
            speed = min(speed, 0.45)
        return speed

    def guard(self, x, y, heading, speed, turn, err, here):
        """Wheel speeds, slowed or turned into a rotation where a wall is near."""
        if speed <= 0.0:
            return turn, -turn
        if here > 19.0:
            self.blocked = 0
            return speed + turn, speed - turn
        need = min(SAFE_CLEARANCE, _exact_clearance(self.padded, x, y)) - 1e-4
        for scale in (1.0, 0.6, 0.3, 0.12):
            left, right = scale * speed + turn, scale * speed - turn
            if _arc_is_safe(self.padded, x, y, heading, left, right, need):
                self.blocked = 0
                return left, right
        if abs(err) <= 0.05:
            self.blocked += 1
            if self.blocked >= 3 and self.escape_left == 0:
                self.start_escape(x, y)
        return turn, -turn

    def act(self, x, y, heading, ranges):
        """Wheel speeds for this step."""
        goal_dist = math.hypot(self.goal[0] - x, self.goal[1] - y)
        if goal_dist < STOP_DIST:
            return 0.0, 0.0
        self.advance(x, y)
        here = float(_clear_at(self.clear, [x], [y])[0])
        if self.escape_left > 0:
            self.escape_left -= 1
            tx, ty = self.escape
            limit = 0.3
            if math.hypot(tx - x, ty - y) < 1.0:
                self.escape_left = 0
        else:
            tx, ty = self.target(x, y, here)
            limit = self.cruise(here, ranges, goal_dist)
        err = _wrap(math.atan2(ty - y, tx - x) - heading)
        change = min(max(TURN_GAIN * err, -MAX_TURN), MAX_TURN)
        turn = change / (2.0 * TURN_PER_STEP)
        speed = 0.0
        if abs(err) <= TURN_ONLY:
            speed = limit * max(0.15, 1.0 - 1.5 * abs(err))
            reach = math.hypot(tx - x, ty - y) / (MAX_WHEEL_SPEED * DT)
            speed = min(speed, max(0.05, reach), max(0.0, 1.0 - abs(turn)))
        return self.guard(x, y, heading, speed, turn, err, here)


def _unit(value):
    """The value as a finite float in [-1, 1]."""
    value = float(value)
    if not math.isfinite(value):
        return 0.0
    return min(max(value, -1.0), 1.0)


def reset(obs):
    """Plans the path of a new episode."""
    pose, goal = obs["pose"], obs["goal"]
    _STATE["follower"] = Follower(
        float(pose[0]), float(pose[1]), float(goal[0]), float(goal[1])
    )


def policy(obs):
    """Wheel speeds (left, right) for this observation."""
    pose, goal = obs["pose"], obs["goal"]
    follower = _STATE["follower"]
    if follower is None or follower.goal != (float(goal[0]), float(goal[1])):
        reset(obs)
        follower = _STATE["follower"]
    seen = obs.get("ranges")
    ranges = [] if seen is None else [float(value) for value in seen]
    left, right = follower.act(
        float(pose[0]), float(pose[1]), float(pose[2]), ranges
    )
    return _unit(left), _unit(right)


def run_episode(env, max_steps):
    """Drives one episode and reports what the environment did."""
    obs, info = env.reset()
    reset(obs)
    positions = [(float(obs["pose"][0]), float(obs["pose"][1]))]
    speeds = []
    steps = 0
    over = False
    while not over and steps < max_steps:
        left, right = policy(obs)
        obs, _, terminated, truncated, info = env.step((left, right))
        steps += 1
        positions.append((float(obs["pose"][0]), float(obs["pose"][1])))
        applied = 0.5 * (_unit(left) + _unit(right)) * MAX_WHEEL_SPEED
        speeds.append(float(applied))
        over = bool(terminated or truncated)
    return {
        "positions": positions,
        "speeds": speeds,
        "collisions": int(info.get("collisions", 0)),
        "goal": (float(obs["goal"][0]), float(obs["goal"][1])),
        "dt": DT,
    }


def main():
    """Shows one episode."""
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
