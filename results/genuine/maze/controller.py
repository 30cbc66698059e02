"""Drives a differential-drive robot over a 2-D map from a start to a goal."""

import heapq
import math

import numpy as np

import sensors

MAP_IMG = "occupancy.png"
PARAMS_JSON = "params.json"
ROBOT_IMG = "robot.png"

AXLE_LENGTH_PX = 30.0
SENSOR_RANGE_PX = 220.0
SENSOR_FOV_DEG = 110.0
N_RAYS = 18

LOOKAHEAD = 40.0  # farthest point of the path that is aimed at, px
STOP_DIST = 2.0  # the robot stops this near to the end of its path, px
SLOW_DIST = 40.0  # it slows down from here on, px

DT = 0.05
MAX_WHEEL_SPEED = 75.59
BODY_RADIUS = 15.0
STEP_PX = MAX_WHEEL_SPEED * DT  # way of one step at full speed
STEP_TURN = 2.0 * MAX_WHEEL_SPEED * DT / AXLE_LENGTH_PX  # turn of one step in place

SPACING = 2.0  # between points of the path, px
FIELD_CAP = 40  # clearances are exact up to this, px
MIDDLE = 13.0  # clearance beyond the body that the planner likes to have, px
WALL_WEIGHT = 5.0
TRIES = ((3.0, 2), (2.0, 2), (1.2, 2), (1.2, 1), (0.6, 1), (0.25, 1))
LOOK_PARTS = (1.0, 0.8, 0.65, 0.5, 0.4, 0.3, 0.25, 0.2, 0.15, 0.1)
MAX_REPLANS = 3
IDLE_STEPS = 120

MOVES = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
STRAIGHT_COST, DIAGONAL_COST = 12, 17  # their ratio is nearly sqrt(2)

WORLD = {}
STATE = {}


class OccMap2D:
    """Occupancy grid; everything outside it is occupied."""

    def __init__(self, occ):
        self.occ = np.array(occ, dtype=np.bool_)
        self.height, self.width = self.occ.shape

    def is_occupied(self, x, y):
        if not (math.isfinite(x) and math.isfinite(y)):
            return True
        i, j = to_pixel(x), to_pixel(y)
        if i < 0 or j < 0 or i >= self.width or j >= self.height:
            return True
        return bool(self.occ[j, i])


def to_pixel(value):
    """Index of the pixel that holds this coordinate."""
    return int(math.floor(float(value) + 0.5))


def clamp(value, low, high):
    return max(low, min(high, value))


def nearest_free(map2d, x, y, max_rad):
    """The free pixel nearest to (x, y), at most max_rad away."""
    px, py = to_pixel(x), to_pixel(y)
    if not map2d.is_occupied(px, py):
        return (px, py)
    reach = min(float(max_rad), float(map2d.width + map2d.height + abs(px) + abs(py)))
    x0 = max(0, int(math.floor(px - reach)))
    x1 = min(map2d.width - 1, int(math.ceil(px + reach)))
    y0 = max(0, int(math.floor(py - reach)))
    y1 = min(map2d.height - 1, int(math.ceil(py + reach)))
    if reach >= 0 and x0 <= x1 and y0 <= y1:
        rows, cols = np.nonzero(~map2d.occ[y0 : y1 + 1, x0 : x1 + 1])
        if rows.size:
            d2 = (cols + (x0 - px)) ** 2 + (rows + (y0 - py)) ** 2
            k = int(np.argmin(d2))
            if float(d2[k]) <= reach * reach + 1e-9:
                return (int(cols[k]) + x0, int(rows[k]) + y0)
    raise ValueError("no free pixel within max_rad")


def lattice_view(padded, x, y, nx, ny, cell):
    """Every cell-th pixel of the padded map from (x, y) on."""
    return padded[y : y + (ny - 1) * cell + 1 : cell, x : x + (nx - 1) * cell + 1 : cell]


def step_masks(free, x0, y0, nx, ny, cell):
    """For each lattice node a byte whose bits tell which of MOVES are free."""
    padded = np.pad(free, cell, mode="constant", constant_values=False)
    ox, oy = x0 + cell, y0 + cell
    mask = np.zeros((ny, nx), np.uint8)
    for bit, (dx, dy) in enumerate(MOVES):
        ok = lattice_view(padded, ox, oy, nx, ny, cell).copy()
        for t in range(cell):
            ax, ay = ox + dx * t, oy + dy * t
            bx, by = ax + dx, ay + dy
            ok &= lattice_view(padded, bx, by, nx, ny, cell)
            if dx and dy:
                ok &= lattice_view(padded, bx, ay, nx, ny, cell)
                ok &= lattice_view(padded, ax, by, nx, ny, cell)
        mask |= ok.astype(np.uint8) * np.uint8(1 << bit)
    return mask


def plan_path(map2d, start, goal, cell):
    """Shortest 8-connected path of steps of `cell` px for a point; [] without one."""
    sx, sy = int(start[0]), int(start[1])
    gx, gy = int(goal[0]), int(goal[1])
    cell = max(1, int(cell))
    if map2d.is_occupied(sx, sy) or map2d.is_occupied(gx, gy):
        return []
    if (sx, sy) == (gx, gy):
        return [(sx, sy)]
    x0, y0 = sx % cell, sy % cell
    if (gx - x0) % cell or (gy - y0) % cell:
        return []
    free = ~map2d.occ
    nx = len(range(x0, map2d.width, cell))
    ny = len(range(y0, map2d.height, cell))
    masks = step_masks(free, x0, y0, nx, ny, cell).tobytes()
    gi, gj = (gx - x0) // cell, (gy - y0) // cell
    first = ((sy - y0) // cell) * nx + (sx - x0) // cell
    last = gj * nx + gi

    ax = np.abs(np.arange(nx) - gi)[None, :]
    ay = np.abs(np.arange(ny) - gj)[:, None]
    extra = DIAGONAL_COST - STRAIGHT_COST
    guess = (STRAIGHT_COST * np.maximum(ax, ay) + extra * np.minimum(ax, ay)).ravel().tolist()

    table = []
    for bits in range(256):
        options = []
        for bit, (dx, dy) in enumerate(MOVES):
            if bits >> bit & 1:
                length = DIAGONAL_COST if dx and dy else STRAIGHT_COST
                options.append((dy * nx + dx, length))
        table.append(tuple(options))

    size = nx * ny
    cost = [1 << 60] * size
    parent = [-1] * size
    done = bytearray(size)
    cost[first] = 0
    buckets = {guess[first]: [first]}
    keys = [guess[first]]
    while keys:
        total = keys[0]
        bucket = buckets[total]
        if not bucket:
            heapq.heappop(keys)
            del buckets[total]
            continue
        p = bucket.pop()
        if done[p]:
            continue
        done[p] = 1
        if p == last:
            break
        base = cost[p]
        for offset, length in table[masks[p]]:
            q = p + offset
            new = base + length
            if new < cost[q]:
                cost[q] = new
                parent[q] = p
                key = new + guess[q]
                other = buckets.get(key)
                if other is None:
                    buckets[key] = [q]
                    heapq.heappush(keys, key)
                else:
                    other.append(q)
    if not done[last]:
        return []
    path = []
    p = last
    while p >= 0:
        path.append((x0 + (p % nx) * cell, y0 + (p // nx) * cell))
        p = parent[p]
    path.reverse()
    return path


def clearance_field(occ, cap):
    """Distance from each pixel's centre to the nearest occupied square, at most cap."""
    walls = np.pad(occ, 1, mode="constant", constant_values=True)
    height = walls.shape[0]
    far = 10 * (height + cap)
    row = np.arange(height, dtype=np.int32)[:, None]
    before = np.maximum.accumulate(np.where(walls, row, -far), axis=0)
    after = np.minimum.accumulate(np.where(walls, row, far)[::-1], axis=0)[::-1]
    gap = np.minimum(row - before, after - row).astype(np.float32)
    gap = np.clip(gap - np.float32(0.5), 0.0, float(cap))
    square = (gap * gap).astype(np.float32)
    best = square.copy()
    for d in range(1, min(cap, walls.shape[1] - 1) + 1):
        add = np.float32((d - 0.5) ** 2)
        moved = square + add
        np.minimum(best[:, d:], moved[:, :-d], out=best[:, d:])
        np.minimum(best[:, :-d], moved[:, d:], out=best[:, :-d])
    field = np.sqrt(np.minimum(best, np.float32(cap * cap)))
    return field[1:-1, 1:-1].astype(np.float64)


def clearance_at(rows, x, y):
    """Clearance at a point, between the four pixels around it."""
    i, j = math.floor(x), math.floor(y)
    if i < 0 or j < 0 or j >= len(rows) - 1 or i >= len(rows[0]) - 1:
        return 0.0
    u, v = x - i, y - j
    upper, lower = rows[j], rows[j + 1]
    a = upper[i] * (1.0 - u) + upper[i + 1] * u
    b = lower[i] * (1.0 - u) + lower[i + 1] * u
    return a * (1.0 - v) + b * v


def clearance_many(field, xs, ys):
    """The same for arrays of points."""
    height, width = field.shape
    i = np.clip(np.floor(xs).astype(int), 0, width - 2)
    j = np.clip(np.floor(ys).astype(int), 0, height - 2)
    u, v = np.clip(xs - i, 0.0, 1.0), np.clip(ys - j, 0.0, 1.0)
    a = field[j, i] * (1.0 - u) + field[j, i + 1] * u
    b = field[j + 1, i] * (1.0 - u) + field[j + 1, i + 1] * u
    return a * (1.0 - v) + b * v


def line_clear(rows, x0, y0, x1, y1, need):
    """True where every point of the segment has this clearance."""
    count = max(1, int(math.ceil(math.hypot(x1 - x0, y1 - y0) / 1.5)))
    dx, dy = (x1 - x0) / count, (y1 - y0) / count
    for k in range(1, count + 1):
        if clearance_at(rows, x0 + k * dx, y0 + k * dy) < need:
            return False
    return True


def weighted_search(free, weight, first, last):
    """Cheapest 8-connected path between two nodes (i, j); [] without one."""
    height, width = free.shape
    inside = np.zeros((height + 2, width + 2), np.bool_)
    inside[1:-1, 1:-1] = free
    costs = np.ones((height + 2, width + 2))
    costs[1:-1, 1:-1] = weight
    pitch = width + 2
    dist = np.where(inside, np.inf, -1.0).ravel().tolist()
    costs = (0.5 * costs).ravel().tolist()
    parent = [-1] * len(dist)
    moves = [(dy * pitch + dx, math.hypot(dx, dy)) for dx, dy in MOVES]
    source = (first[1] + 1) * pitch + first[0] + 1
    target = (last[1] + 1) * pitch + last[0] + 1
    dist[source] = 0.0
    heap = [(0.0, source)]
    found = False
    while heap:
        d, p = heapq.heappop(heap)
        if d > dist[p]:
            continue
        if p == target:
            found = True
            break
        here = costs[p]
        for offset, length in moves:
            q = p + offset
            new = d + length * (here + costs[q])
            if new < dist[q]:
                dist[q] = new
                parent[q] = p
                heapq.heappush(heap, (new, q))
    if not found:
        return []
    nodes = []
    p = target
    while p >= 0:
        nodes.append((p % pitch - 1, p // pitch - 1))
        p = parent[p]
    nodes.reverse()
    return nodes


def lattice_route(field, start, goal, margin, cell):
    """Nodes, in px, of a route that keeps `margin` from the walls; [] without one."""
    sub = field[::cell, ::cell]
    free = sub >= BODY_RADIUS + margin
    lattice = OccMap2D(~free)
    try:
        first = nearest_free(lattice, start[0] / cell, start[1] / cell, 24.0 / cell)
        last = nearest_free(lattice, goal[0] / cell, goal[1] / cell, 15.0 / cell)
    except ValueError:
        return []
    lack = np.clip((BODY_RADIUS + MIDDLE - sub) / MIDDLE, 0.0, 1.0)
    weight = 1.0 + WALL_WEIGHT * lack * lack
    nodes = weighted_search(free, weight, first, last)
    return [(float(i * cell), float(j * cell)) for i, j in nodes]


def polish(field, points):
    """Smooths a route without giving up clearance and spaces its points evenly."""
    route = np.array(points, dtype=np.float64)
    if len(route) > 2:
        have = clearance_many(field, route[:, 0], route[:, 1])
        limit = np.maximum(
            np.minimum(have - 0.3, BODY_RADIUS + 10.0),
            np.minimum(have, BODY_RADIUS + 1.0),
        )[1:-1]
        for _ in range(40):
            middle = 0.5 * route[1:-1] + 0.25 * (route[:-2] + route[2:])
            good = clearance_many(field, middle[:, 0], middle[:, 1]) >= limit
            route[1:-1][good] = middle[good]
    pieces = np.hypot(np.diff(route[:, 0]), np.diff(route[:, 1]))
    along = np.concatenate(([0.0], np.cumsum(pieces)))
    total = float(along[-1])
    if total < 1e-6:
        return [(float(route[-1, 0]), float(route[-1, 1]))]
    count = max(1, int(round(total / SPACING)))
    at = np.linspace(0.0, total, count + 1)
    xs = np.interp(at, along, route[:, 0]).tolist()
    ys = np.interp(at, along, route[:, 1]).tolist()
    return list(zip(xs, ys))


def plan_route(field, start, goal):
    """The path to follow, and the margin it keeps."""
    for margin, cell in TRIES:
        nodes = lattice_route(field, start, goal, margin, cell)
        if nodes:
            return polish(field, [start] + nodes), margin
    return polish(field, [start, goal]), 0.6


def load_world():
    """Map and clearances, read once."""
    if "rows" not in WORLD:
        occ = np.asarray(sensors.load_occupancy(MAP_IMG), dtype=np.bool_)
        field = clearance_field(occ, FIELD_CAP)
        WORLD["field"] = field
        WORLD["rows"] = field.tolist()
    return WORLD


class Pilot:
    """Follows a planned path; every motion is checked against the map first."""

    def __init__(self, obs):
        world = load_world()
        self.field = world["field"]
        self.rows = world["rows"]
        self.replans = 0
        self.turn_steps = 0
        self.turn_sign = 1.0
        self.plan(obs)

    def plan(self, obs):
        start = (float(obs["pose"][0]), float(obs["pose"][1]))
        self.goal = (float(obs["goal"][0]), float(obs["goal"][1]))
        self.path, margin = plan_route(self.field, start, self.goal)
        self.clear = [clearance_at(self.rows, px, py) for px, py in self.path]
        self.safe = min(1.0, 0.5 * margin)
        self.at = 0
        self.mark = 0
        self.idle = 0

    def replan(self, obs):
        if self.replans < MAX_REPLANS:
            self.replans += 1
            self.plan(obs)

    def advance(self, x, y):
        """Moves on to the nearest point of the path; returns its distance."""
        best, arg = math.inf, self.at
        for j in range(self.at, min(self.at + 20, len(self.path) - 1) + 1):
            px, py = self.path[j]
            d2 = (px - x) ** 2 + (py - y) ** 2
            if d2 < best:
                best, arg = d2, j
        self.at = arg
        return math.sqrt(best)

    def choose_target(self, x, y, room):
        """The farthest point of the path that can be reached in a straight line."""
        last = len(self.path) - 1
        tight = room < self.safe + 0.5
        for part in LOOK_PARTS:
            n = max(2, int(round(part * LOOKAHEAD / SPACING)))
            if tight and n > 5:
                continue
            j = min(self.at + n, last)
            low = min(self.clear[self.at : j + 1])
            need = min(BODY_RADIUS + 5.0, low - 0.4)
            need = max(need, BODY_RADIUS + self.safe)
            need = min(need, BODY_RADIUS + room - 0.02)
            px, py = self.path[j]
            if line_clear(self.rows, x, y, px, py, need):
                return (px, py)
        px, py = self.path[self.at]
        if math.hypot(px - x, py - y) > 3.0:
            return (px, py)
        return self.path[min(self.at + 2, last)]

    def is_safe(self, x, y, heading, v, w, room):
        """Whether the arc of the next step keeps away from the walls."""
        way, turn = v * STEP_PX, w * STEP_TURN
        for part in (0.5, 1.0):
            half = 0.5 * turn * part
            chord = way * part
            if abs(half) > 1e-6:
                chord *= math.sin(half) / half
            px = x + chord * math.cos(heading + half)
            py = y + chord * math.sin(heading + half)
            after = clearance_at(self.rows, px, py) - BODY_RADIUS
            if after < self.safe and after < room - 0.001:
                return False
        return True

    def act(self, obs):
        x, y, heading = (float(value) for value in obs["pose"])
        gx, gy = float(obs["goal"][0]), float(obs["goal"][1])
        ranges = [float(value) for value in obs["ranges"]]
        if math.hypot(gx - self.goal[0], gy - self.goal[1]) > 1.0:
            self.replan(obs)
        if self.advance(x, y) > 30.0:
            self.replan(obs)
            self.advance(x, y)
        end_x, end_y = self.path[-1]
        end_dist = math.hypot(end_x - x, end_y - y)
        last = len(self.path) - 1
        if last - self.at <= 2 and end_dist < STOP_DIST:
            return (0.0, 0.0)

        if self.at > self.mark:
            self.mark, self.idle = self.at, 0
        else:
            self.idle += 1
        if self.idle > IDLE_STEPS:
            self.idle = 0
            self.turn_steps = 6
            half = len(ranges) // 2
            left_room, right_room = sum(ranges[:half]), sum(ranges[-half:])
            self.turn_sign = -1.0 if left_room > right_room else 1.0
            self.replan(obs)
        if self.turn_steps > 0:
            self.turn_steps -= 1
            return (0.4 * self.turn_sign, -0.4 * self.turn_sign)

        room = clearance_at(self.rows, x, y) - BODY_RADIUS
        tx, ty = self.choose_target(x, y, room)
        away = math.hypot(tx - x, ty - y)
        error = math.remainder(math.atan2(ty - y, tx - x) - heading, 2.0 * math.pi)
        gate = 0.12 if room < self.safe + 0.5 else 0.4
        in_place = clamp(error / STEP_TURN, -1.0, 1.0)
        if abs(error) >= gate:
            return (in_place, -in_place)

        v = 0.65 + 0.3 * clamp((room - 2.0) / 8.0, 0.0, 1.0)
        middle = len(ranges) // 2
        ahead = ranges[max(0, middle - 2) : middle + 2]
        if ahead:
            v = min(v, max(0.35, (min(ahead) - BODY_RADIUS) / 15.0))
        remaining = (len(self.path) - 1 - self.at) * SPACING
        if remaining < SLOW_DIST:
            v = min(v, 0.25 + 0.35 * remaining / SLOW_DIST)
        v = min(v, max(0.1, away / (2.0 * STEP_PX)))
        v *= 1.0 - abs(error) / gate
        w = clamp(0.8 * error / STEP_TURN, -0.8, 0.8)
        v = clamp(v, 0.0, 1.0 - abs(w))
        for part in (1.0, 0.5, 0.25):
            if self.is_safe(x, y, heading, v * part, w, room):
                return (clamp(v * part + w, -1.0, 1.0), clamp(v * part - w, -1.0, 1.0))
        return (in_place, -in_place)


def reset(obs):
    """Plans the path of a new episode."""
    STATE["pilot"] = Pilot(obs)


def policy(obs):
    """Speeds of the left and of the right wheel for the next step."""
    if "pilot" not in STATE:
        reset(obs)
    left, right = STATE["pilot"].act(obs)
    return (float(left), float(right))


def run_episode(env, max_steps):
    """Drives one episode and reports what the environment did."""
    obs, info = env.reset()
    reset(obs)
    goal = (float(obs["goal"][0]), float(obs["goal"][1]))
    positions = [(float(obs["pose"][0]), float(obs["pose"][1]))]
    speeds = []
    for _ in range(int(max_steps)):
        left, right = policy(obs)
        obs, reward, terminated, truncated, info = env.step((left, right))
        positions.append((float(obs["pose"][0]), float(obs["pose"][1])))
        applied = clamp(float(left), -1.0, 1.0) + clamp(float(right), -1.0, 1.0)
        speeds.append(applied / 2.0 * MAX_WHEEL_SPEED)
        if terminated or truncated:
            break
    return {
        "positions": positions,
        "speeds": speeds,
        "collisions": int(info.get("collisions", 0)),
        "goal": goal,
        "dt": DT,
    }


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
