"""Controller of a differential-drive robot on a 2-D map: plan, smooth, pursue."""

import heapq
import math

import numpy as np

import sensors

MAP_IMG = "occupancy.png"
PARAMS_JSON = "params.json"
ROBOT_IMG = "robot.png"

AXLE_LENGTH_PX = 20.0
SENSOR_RANGE_PX = 220.0
SENSOR_FOV_DEG = 110.0
N_RAYS = 18

LOOKAHEAD = 18.0  # px along the path
STOP_DIST = 12.0  # px, front range at which the robot only creeps
SLOW_DIST = 30.0  # px, front range below which the robot slows down

MAX_WHEEL_SPEED = 75.59  # px/s
DT = 0.05  # s
STEP_PX = MAX_WHEEL_SPEED * DT  # px per step at full speed
TURN_RAD = MAX_WHEEL_SPEED * DT / AXLE_LENGTH_PX  # rad per step and unit of left - right

CLEARANCE_CAP = 32  # px, larger clearances are not told apart
LEGAL_CLEARANCE = 9.9  # px, below this the pose cannot be that of the body
HARD_CLEARANCE = 10.15  # px, never go below on purpose
SOFT_CLEARANCE = 11.2  # px, preferred lower bound while driving
TURN_IN_PLACE = 0.6  # rad
SPACING = 1.5  # px between points of the final path
SQRT2 = math.sqrt(2.0)

DIRECTIONS = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1))

_STATE = {"world": None, "driver": None}


# --------------------------------------------------------------------------- map


class OccMap2D:
    """Occupancy grid `occ[y, x]`, True = occupied; the outside is occupied."""

    def __init__(self, occ):
        self.occ = np.array(occ, dtype=bool)
        self.height = int(self.occ.shape[0])
        self.width = int(self.occ.shape[1])

    def is_occupied(self, x, y):
        x, y = float(x), float(y)
        if not (math.isfinite(x) and math.isfinite(y)):
            return True
        i, j = math.floor(x + 0.5), math.floor(y + 0.5)
        if i < 0 or j < 0 or i >= self.width or j >= self.height:
            return True
        return bool(self.occ[j, i])


def nearest_free(map2d, x, y, max_rad):
    """The free pixel nearest to (x, y), at most `max_rad` away."""
    if not map2d.is_occupied(x, y):
        return math.floor(float(x) + 0.5), math.floor(float(y) + 0.5)
    x, y, rad = float(x), float(y), float(max_rad)
    if rad >= 0:
        x_lo = math.ceil(max(0.0, x - rad))
        x_hi = math.floor(min(map2d.width - 1.0, x + rad))
        y_lo = math.ceil(max(0.0, y - rad))
        y_hi = math.floor(min(map2d.height - 1.0, y + rad))
        if x_lo <= x_hi and y_lo <= y_hi:
            part = map2d.occ[y_lo : y_hi + 1, x_lo : x_hi + 1]
            rows = np.arange(y_lo, y_hi + 1, dtype=float)[:, None] - y
            cols = np.arange(x_lo, x_hi + 1, dtype=float)[None, :] - x
            square = rows * rows + cols * cols
            square = np.where(part, np.inf, square)
            at = int(np.argmin(square))
            j, i = divmod(at, square.shape[1])
            if float(square[j, i]) <= rad * rad + 1e-9:
                return int(x_lo + i), int(y_lo + j)
    raise ValueError("no free pixel within the radius")


# ---------------------------------------------------------------------- plan_path


def _shifted(free, cell, frame, dx, dy):
    """Values of the padded array at all lattice nodes moved by (dx, dy)."""
    x0, y0, nx, ny = frame
    top, left = y0 + cell + dy, x0 + cell + dx
    return free[
        top : top + (ny - 1) * cell + 1 : cell,
        left : left + (nx - 1) * cell + 1 : cell,
    ]


def _move_codes(occ, cell, frame):
    """A bit per direction of DIRECTIONS: whether that step is free."""
    nx, ny = frame[2], frame[3]
    free = np.pad(~occ, cell, mode="constant", constant_values=False)
    codes = np.zeros((ny, nx), np.uint8)
    for bit, (ux, uy) in enumerate(DIRECTIONS):
        ok = _shifted(free, cell, frame, 0, 0).copy()
        for t in range(cell):
            ok &= _shifted(free, cell, frame, (t + 1) * ux, (t + 1) * uy)
            if ux and uy:
                ok &= _shifted(free, cell, frame, (t + 1) * ux, t * uy)
                ok &= _shifted(free, cell, frame, t * ux, (t + 1) * uy)
        codes |= ok.astype(np.uint8) * np.uint8(1 << bit)
    return codes


def plan_path(map2d, start, goal, cell):
    """Shortest 8-connected path of a point with steps of `cell` px (A*)."""
    sx, sy = int(start[0]), int(start[1])
    gx, gy = int(goal[0]), int(goal[1])
    cell = int(cell)
    if cell < 1:
        raise ValueError("cell must be at least 1")
    if map2d.is_occupied(sx, sy) or map2d.is_occupied(gx, gy):
        return []
    if (sx, sy) == (gx, gy):
        return [(sx, sy)]
    if (gx - sx) % cell or (gy - sy) % cell:
        return []
    occ = map2d.occ
    height, width = int(occ.shape[0]), int(occ.shape[1])
    if cell >= max(height, width):
        return []
    x0, y0 = sx % cell, sy % cell
    nx = (width - 1 - x0) // cell + 1
    ny = (height - 1 - y0) // cell + 1
    codes = _move_codes(occ, cell, (x0, y0, nx, ny)).ravel().tolist()
    table = []
    for code in range(256):
        moves = []
        for bit, (ux, uy) in enumerate(DIRECTIONS):
            if code >> bit & 1:
                moves.append((uy * nx + ux, SQRT2 if ux and uy else 1.0))
        table.append(tuple(moves))
    first = (sy - y0) // cell * nx + (sx - x0) // cell
    gi, gj = (gx - x0) // cell, (gy - y0) // cell
    last = gj * nx + gi
    across = np.abs(np.arange(nx, dtype=float) - gi)[None, :]
    down = np.abs(np.arange(ny, dtype=float) - gj)[:, None]
    guess = np.maximum(across, down) + (SQRT2 - 1.0) * np.minimum(across, down)
    guess = guess.ravel().tolist()

    count = nx * ny
    cost = [math.inf] * count
    parent = [-1] * count
    closed = bytearray(count)
    cost[first] = 0.0
    heap = [(guess[first], first)]
    pop, push = heapq.heappop, heapq.heappush
    while heap:
        a = pop(heap)[1]
        if closed[a]:
            continue
        closed[a] = 1
        if a == last:
            break
        base = cost[a]
        for offset, length in table[codes[a]]:
            b = a + offset
            new = base + length
            if new < cost[b] and not closed[b]:
                cost[b] = new
                parent[b] = a
                push(heap, (new + guess[b], b))
    if not closed[last]:
        return []
    path = []
    a = last
    while a >= 0:
        j, i = divmod(a, nx)
        path.append((int(x0 + i * cell), int(y0 + j * cell)))
        a = parent[a]
    path.reverse()
    return path


# ---------------------------------------------------------------- clearance, field


def _clearance(occ, cap):
    """Distance from each pixel's centre to the nearest occupied square, up to cap."""
    pad = cap + 1
    height, width = occ.shape
    solid = np.pad(occ, pad, mode="constant", constant_values=True)
    rows = np.arange(solid.shape[0], dtype=np.int32)[:, None]
    above = np.maximum.accumulate(np.where(solid, rows, -100000), axis=0)
    below = np.where(solid, rows, 100000)[::-1]
    below = np.minimum.accumulate(below, axis=0)[::-1]
    gap = np.minimum(np.minimum(rows - above, below - rows), cap + 1)
    square = (np.maximum(gap - 0.5, 0.0) ** 2).astype(np.float32)
    square = np.ascontiguousarray(square[pad : pad + height])
    best = np.full((height, width), float(cap * cap), np.float32)
    for dx in range(-cap, cap + 1):
        side = max(abs(dx) - 0.5, 0.0) ** 2
        part = square[:, pad + dx : pad + dx + width] + np.float32(side)
        np.minimum(best, part, out=best)
    return np.sqrt(best)


class _Field:
    """Cost to the goal over a lattice of pixels, cheaper in the middle of passages."""

    def __init__(self, clearance, goal, step, floor):
        sub = clearance[::step, ::step].astype(float)
        self.step = step
        self.ny, self.nx = int(sub.shape[0]), int(sub.shape[1])
        self.pitch = self.nx + 2
        weight = 1.0 + 2.0 * (np.maximum(28.0 - sub, 0.0) / 18.0) ** 2
        weight = weight + 2.0 * np.maximum(12.5 - sub, 0.0) ** 2
        weight = np.where(sub >= floor, weight, 0.0)
        self.cost = [math.inf] * (self.pitch * (self.ny + 2))
        self.parent = [-1] * len(self.cost)
        if not np.any(weight > 0):
            return
        cols = np.arange(self.nx, dtype=float)[None, :] * step - goal[0]
        rows = np.arange(self.ny, dtype=float)[:, None] * step - goal[1]
        away = np.where(weight > 0, rows * rows + cols * cols, np.inf)
        j, i = divmod(int(np.argmin(away)), self.nx)
        padded = np.pad(weight, 1, mode="constant", constant_values=0.0)
        self._spread(padded.ravel().tolist(), (j + 1) * self.pitch + i + 1)

    def _spread(self, weight, source):
        cost, parent, pitch = self.cost, self.parent, self.pitch
        moves = (
            (1, 1.0),
            (-1, 1.0),
            (pitch, 1.0),
            (-pitch, 1.0),
            (pitch + 1, SQRT2),
            (pitch - 1, SQRT2),
            (1 - pitch, SQRT2),
            (-1 - pitch, SQRT2),
        )
        cost[source] = 0.0
        heap = [(0.0, source)]
        pop, push = heapq.heappop, heapq.heappush
        while heap:
            base, a = pop(heap)
            if base > cost[a]:
                continue
            here = weight[a]
            for offset, length in moves:
                b = a + offset
                there = weight[b]
                if there > 0.0:
                    new = base + length * (here + there)
                    if new < cost[b]:
                        cost[b] = new
                        parent[b] = a
                        push(heap, (new, b))

    def entry(self, world, x, y):
        """Best lattice node that the body reaches straight from (x, y), or -1."""
        step, reach = self.step, 8.0
        here = world.clear(x, y)
        best, best_score = -1, math.inf
        i_lo = max(0, math.ceil((x - reach) / step))
        i_hi = min(self.nx - 1, math.floor((x + reach) / step))
        j_lo = max(0, math.ceil((y - reach) / step))
        j_hi = min(self.ny - 1, math.floor((y + reach) / step))
        for j in range(j_lo, j_hi + 1):
            for i in range(i_lo, i_hi + 1):
                node = (j + 1) * self.pitch + i + 1
                value = self.cost[node]
                if value < math.inf:
                    length = math.hypot(i * step - x, j * step - y)
                    score = value + 12.0 * length / step
                    if score < best_score and world.straight_ok(
                        x, y, here, i * step, j * step, HARD_CLEARANCE
                    ):
                        best, best_score = node, score
        return best

    def nearest(self, x, y):
        """The reachable node nearest to (x, y) whatever lies between, or -1."""
        cost = np.array(self.cost).reshape(self.ny + 2, self.pitch)
        cols = (np.arange(self.pitch, dtype=float)[None, :] - 1) * self.step - x
        rows = (np.arange(self.ny + 2, dtype=float)[:, None] - 1) * self.step - y
        away = np.where(np.isfinite(cost), rows * rows + cols * cols, np.inf)
        at = int(np.argmin(away))
        return at if math.isfinite(float(away.ravel()[at])) else -1

    def descend(self, node):
        """Points from the node to the goal's node."""
        points = []
        while node >= 0:
            j, i = divmod(node, self.pitch)
            points.append(((i - 1) * self.step, (j - 1) * self.step))
            node = self.parent[node]
        return points


class _World:
    """The map with its clearance, and the cost fields of the goals asked for."""

    def __init__(self):
        occ = sensors.load_occupancy(MAP_IMG)
        self.map2d = OccMap2D(occ)
        self.height, self.width = self.map2d.height, self.map2d.width
        self.array = _clearance(self.map2d.occ, CLEARANCE_CAP)
        self.rows = self.array.tolist()
        self.fields = {}

    def clear(self, x, y):
        """Clearance at any point, interpolated; 0 off the map."""
        if not (0.0 <= x < self.width - 1 and 0.0 <= y < self.height - 1):
            return 0.0
        i, j = int(x), int(y)
        fx, fy = x - i, y - j
        a, b = self.rows[j], self.rows[j + 1]
        upper = a[i] + (a[i + 1] - a[i]) * fx
        lower = b[i] + (b[i + 1] - b[i]) * fx
        return upper + (lower - upper) * fy

    def clear_many(self, points):
        """Clearance at the rows of an (n, 2) array."""
        x = np.clip(points[:, 0], 0.0, self.width - 1.001)
        y = np.clip(points[:, 1], 0.0, self.height - 1.001)
        i, j = x.astype(int), y.astype(int)
        fx, fy = x - i, y - j
        c = self.array
        upper = c[j, i] * (1 - fx) + c[j, i + 1] * fx
        lower = c[j + 1, i] * (1 - fx) + c[j + 1, i + 1] * fx
        return upper * (1 - fy) + lower * fy

    def straight_ok(self, x, y, here, tx, ty, floor):
        """Whether the straight way keeps `floor`, or leaves a wall nearer than that."""
        length = math.hypot(tx - x, ty - y)
        n = int(length / 0.8) + 1
        for k in range(1, n + 1):
            q = k / n
            limit = min(floor, here + 0.1 * length * q)
            if self.clear(x + (tx - x) * q, y + (ty - y) * q) < limit:
                return False
        return True

    def arc_ok(self, pose, left, right, here, steps, floor):
        """The same for the arc of constant wheel speeds over some steps."""
        x, y, heading = pose
        turn = (left - right) * TURN_RAD
        travel = 0.5 * (left + right) * STEP_PX
        for k in range(1, 4 * steps + 1):
            q = 0.25 * k
            half, s = 0.5 * turn * q, travel * q
            chord = s * math.sin(half) / half if abs(half) > 1e-9 else s
            px = x + chord * math.cos(heading + half)
            py = y + chord * math.sin(heading + half)
            if self.clear(px, py) < min(floor, here + 0.1 * abs(s)):
                return False
        return True

    def field(self, goal, step, floor):
        key = (round(goal[0]), round(goal[1]), step)
        if key not in self.fields:
            if len(self.fields) >= 4:
                self.fields.clear()
            self.fields[key] = _Field(self.array, goal, step, floor)
        return self.fields[key]

    def route(self, x, y, goal):
        """Smooth path from (x, y) to the goal as lists of x and y; empty if none."""
        field = self.field(goal, 2, 10.4)
        node = field.entry(self, x, y)
        if node < 0 and self.clear(x, y) >= LEGAL_CLEARANCE:
            finer = self.field(goal, 1, 10.05)
            node = finer.entry(self, x, y)
            if node >= 0:
                field = finer
        if node < 0:
            node = field.nearest(x, y)
        if node < 0:
            return [], []
        points = [(x, y)] + field.descend(node)
        end = points[-1]
        if 0.5 < math.hypot(goal[0] - end[0], goal[1] - end[1]) < 12.0:
            if self.clear(goal[0], goal[1]) >= 10.4:
                points.append((goal[0], goal[1]))
        return self._smooth(np.array(points, dtype=float))

    def _smooth(self, points):
        if len(points) > 2:
            clear = self.clear_many(points)
            bound = np.maximum(
                np.minimum(clear, 10.8), np.minimum(clear - 0.5, 15.0)
            )
            for _ in range(40):
                moved = points.copy()
                moved[1:-1] = 0.5 * points[1:-1] + 0.25 * (points[:-2] + points[2:])
                good = self.clear_many(moved) >= bound
                points = np.where(good[:, None], moved, points)
        pieces = np.hypot(np.diff(points[:, 0]), np.diff(points[:, 1]))
        along = np.concatenate(([0.0], np.cumsum(pieces)))
        total = float(along[-1])
        n = max(2, int(total / SPACING) + 1)
        at = np.linspace(0.0, total, n)
        xs = np.interp(at, along, points[:, 0]).tolist()
        ys = np.interp(at, along, points[:, 1]).tolist()
        return xs, ys


# -------------------------------------------------------------------------- driver


def _wrap(angle):
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def _limit(value, low, high):
    return max(low, min(high, value))


def _spin(angle):
    """Wheel speeds that turn in place by `angle`, as far as one step allows."""
    s = _limit(angle / (2.0 * TURN_RAD), -1.0, 1.0)
    return s, -s


def _front(ranges):
    n = len(ranges)
    if n == 0:
        return SENSOR_RANGE_PX
    middle = ranges[max(0, n // 2 - 3) : n // 2 + 3]
    return min(middle) if middle else min(ranges)


def _reactive(ranges):
    """Without a plan: slowly ahead, or turn to the freer side."""
    half = len(ranges) // 2
    if _front(ranges) > SLOW_DIST:
        return 0.25, 0.25
    if sum(ranges[:half]) > sum(ranges[half:]):
        return -0.3, 0.3
    return 0.3, -0.3


class _Driver:
    """Follows the route of one episode."""

    def __init__(self, world, x, y, goal):
        self.world = world
        self.goal = goal
        self.last = (x, y)
        self.refuge = None
        self.refuge_left = 0
        self.cool = 0
        self.idle = 0
        self.least_left = math.inf
        self.short_left = 0
        self.xs, self.ys, self.idx = [], [], 0
        self.plan(x, y)

    def plan(self, x, y):
        self.xs, self.ys = self.world.route(x, y, self.goal)
        self.idx = 0
        self.cool = 20

    def step(self, x, y, heading, ranges):
        world = self.world
        if math.hypot(x - self.last[0], y - self.last[1]) > 12.0:
            self.refuge = None
            self.least_left = math.inf
            self.plan(x, y)
        self.last = (x, y)
        if not self.xs:
            return _reactive(ranges)
        here = world.clear(x, y)
        if self.refuge is not None:
            command = self._to_refuge(x, y, heading, here)
            if command is not None:
                return command
        off = self._locate(x, y)
        self.cool = max(0, self.cool - 1)
        if off > 8.0 and self.cool == 0:
            self.plan(x, y)
            if not self.xs:
                return _reactive(ranges)
            self._locate(x, y)
        if math.hypot(x - self.xs[-1], y - self.ys[-1]) < 1.0:
            return 0.0, 0.0
        if self._is_stuck():
            self.short_left = 150
            return self._flee(x, y, heading, here, ranges)
        tx, ty = self._target(x, y, here)
        return self._pursue(x, y, heading, here, tx, ty, ranges)

    def _locate(self, x, y):
        """Moves the index to the nearest path point close by; returns its distance."""
        low = max(0, self.idx - 4)
        high = min(len(self.xs) - 1, self.idx + 16)
        best, best_at = math.inf, self.idx
        for k in range(low, high + 1):
            d = math.hypot(self.xs[k] - x, self.ys[k] - y)
            if d < best:
                best, best_at = d, k
        self.idx = best_at
        return best

    def _is_stuck(self):
        left = len(self.xs) - 1 - self.idx
        if left <= self.least_left - 2:
            self.least_left = left
            self.idle = 0
            return False
        self.idle += 1
        if self.idle > 45:
            self.idle = 0
            self.least_left = left
            return True
        return False

    def _target(self, x, y, here):
        """The farthest path point ahead that is safely reached straight."""
        world, end = self.world, len(self.xs) - 1
        reach = LOOKAHEAD
        if self.short_left > 0:
            self.short_left -= 1
            reach = 0.5 * LOOKAHEAD
        tx, ty = self.xs[end], self.ys[end]
        for share in (1.0, 0.8, 0.62, 0.46, 0.32, 0.2):
            k = min(end, self.idx + max(2, int(reach * share / SPACING)))
            tx, ty = self.xs[k], self.ys[k]
            floor = min(11.8, here - 0.3, world.clear(tx, ty) - 0.3)
            floor = max(10.2, floor)
            if world.straight_ok(x, y, here, tx, ty, floor):
                break
        return tx, ty

    def _speed(self, here, there, alpha, ranges, x, y):
        room = min(here, there)
        v = 0.45 + 0.45 * _limit((room - 12.0) / 6.0, 0.0, 1.0)
        front = _front(ranges)
        if front < SLOW_DIST:
            v *= _limit((front - STOP_DIST) / (SLOW_DIST - STOP_DIST), 0.4, 1.0)
        to_goal = math.hypot(self.goal[0] - x, self.goal[1] - y)
        if to_goal < 45.0:
            v = min(v, max(0.3, to_goal / 60.0))
        v = max(v, 0.3)
        return v * max(0.55, 1.0 - 0.8 * abs(alpha))

    def _pursue(self, x, y, heading, here, tx, ty, ranges):
        world = self.world
        distance = math.hypot(tx - x, ty - y)
        alpha = _wrap(math.atan2(ty - y, tx - x) - heading)
        if abs(alpha) > TURN_IN_PLACE:
            return _spin(alpha)
        pose = (x, y, heading)
        v = self._speed(here, world.clear(tx, ty), alpha, ranges, x, y)
        bend = 2.0 * math.sin(alpha) / max(distance, 4.0) * 0.5 * AXLE_LENGTH_PX
        v = min(v, 1.0 / (1.0 + abs(bend)), max(0.1, distance / STEP_PX))
        soft = max(HARD_CLEARANCE, min(SOFT_CLEARANCE, here - 0.2))
        for share in (1.0, 0.5):
            left, right = share * v * (1.0 + bend), share * v * (1.0 - bend)
            if world.arc_ok(pose, left, right, here, 3, soft):
                return left, right
        if abs(alpha) > 0.15:
            return _spin(alpha)
        for creep in (0.3, 0.12):
            u = min(v, creep)
            left, right = u * (1.0 + bend), u * (1.0 - bend)
            if world.arc_ok(pose, left, right, here, 1, HARD_CLEARANCE):
                return left, right
        if abs(alpha) > 0.02:
            return _spin(alpha)
        return self._flee(x, y, heading, here, ranges)

    def _flee(self, x, y, heading, here, ranges):
        """Chooses the freest place close by and turns to it."""
        best, place = -math.inf, None
        for k in range(32):
            angle = 2.0 * math.pi * k / 32
            for length in (1.5, 3.0, 5.0):
                px = x + length * math.cos(angle)
                py = y + length * math.sin(angle)
                room = min(self.world.clear(px, py), 20.0)
                if room > best and self.world.straight_ok(
                    x, y, here, px, py, HARD_CLEARANCE
                ):
                    best, place = room, (px, py)
        if place is None:
            if sum(ranges[: len(ranges) // 2]) > sum(ranges[len(ranges) // 2 :]):
                return -0.4, 0.4
            return 0.4, -0.4
        self.refuge, self.refuge_left = place, 30
        return _spin(_wrap(math.atan2(place[1] - y, place[0] - x) - heading))

    def _to_refuge(self, x, y, heading, here):
        px, py = self.refuge
        distance = math.hypot(px - x, py - y)
        self.refuge_left -= 1
        if distance < 0.8 or self.refuge_left <= 0:
            self.refuge = None
            self.plan(x, y)
            return None
        alpha = _wrap(math.atan2(py - y, px - x) - heading)
        if abs(alpha) > 0.05:
            return _spin(alpha)
        v = min(0.3, distance / STEP_PX)
        if self.world.arc_ok((x, y, heading), v, v, here, 1, HARD_CLEARANCE):
            return v, v
        self.refuge = None
        return None


def _read(obs):
    pose = [float(value) for value in obs["pose"]]
    goal = [float(value) for value in obs["goal"]]
    return pose, (goal[0], goal[1])


def _start(pose, goal):
    if _STATE["world"] is None:
        _STATE["world"] = _World()
    _STATE["driver"] = _Driver(_STATE["world"], pose[0], pose[1], goal)
    return _STATE["driver"]


def reset(obs):
    """Plans for a new episode."""
    pose, goal = _read(obs)
    _start(pose, goal)


def policy(obs):
    """Wheel speeds (left, right) for this observation."""
    pose, goal = _read(obs)
    driver = _STATE["driver"]
    if driver is None or driver.goal != goal:
        driver = _start(pose, goal)
    ranges = [float(value) for value in obs["ranges"]]
    left, right = driver.step(pose[0], pose[1], pose[2], ranges)
    return float(_limit(left, -1.0, 1.0)), float(_limit(right, -1.0, 1.0))


# ------------------------------------------------------------------------- episode


def run_episode(env, max_steps):
    """Runs one episode and reports what the environment did."""
    obs, info = env.reset()
    reset(obs)
    goal = (float(obs["goal"][0]), float(obs["goal"][1]))
    positions = [(float(obs["pose"][0]), float(obs["pose"][1]))]
    speeds = []
    collisions = int(info.get("collisions", 0))
    steps = 0
    done = False
    while not done and steps < max_steps:
        left, right = policy(obs)
        obs, _, terminated, truncated, info = env.step((left, right))
        steps += 1
        applied_left = _limit(float(left), -1.0, 1.0)
        applied_right = _limit(float(right), -1.0, 1.0)
        speeds.append(0.5 * (applied_left + applied_right) * MAX_WHEEL_SPEED)
        positions.append((float(obs["pose"][0]), float(obs["pose"][1])))
        collisions = int(info.get("collisions", 0))
        done = bool(terminated) or bool(truncated)
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
