"""Drives a differential-drive robot over a 2-D map without touching anything."""

import bisect
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

LOOKAHEAD = 40.0  # px along the route
STOP_DIST = 12.6  # px, reading straight ahead below which the robot only turns
SLOW_DIST = 34.0  # px, reading straight ahead below which it slows down

DT = 0.05
PARAMS = sensors.load_params(PARAMS_JSON)
BODY_RADIUS = float(PARAMS["robot"]["radius"])
MAX_WHEEL_SPEED = float(PARAMS["robot"]["max_wheel_speed"])
STEP_PX = MAX_WHEEL_SPEED * DT  # way of a wheel in one step at full speed

AHEADS = (LOOKAHEAD, 34.0, 28.0, 22.0, 17.0, 12.0, 8.0, 5.0, 3.0)
# (lattice step, least clearance of the centre) to try one after the other
PLANS = (
    (2, BODY_RADIUS + 1.2),
    (2, BODY_RADIUS + 0.6),
    (1, BODY_RADIUS + 0.2),
)
COMFORT = BODY_RADIUS + 10.0  # clearance from which on a place costs nothing extra
FIELD_REACH = 40  # clearances are known up to here, px
DIAGONAL = math.sqrt(2.0)
# bit number -> (dx, dy) of a move
MOVES = (
    (1, 0),
    (-1, 0),
    (0, 1),
    (0, -1),
    (1, 1),
    (-1, -1),
    (-1, 1),
    (1, -1),
)


# ---------------------------------------------------------------- map and planning


class OccMap2D:
    """Occupancy grid, indexed [y, x]; everything outside is occupied."""

    def __init__(self, occ):
        self.occ = np.array(occ, dtype=np.bool_)
        self.height, self.width = self.occ.shape

    def is_occupied(self, x, y):
        i = math.floor(x + 0.5)
        j = math.floor(y + 0.5)
        if i < 0 or j < 0 or i >= self.width or j >= self.height:
            return True
        return bool(self.occ[j, i])


def nearest_free(map2d, x, y, max_rad):
    """The free pixel nearest to (x, y), at most `max_rad` away."""
    if not map2d.is_occupied(x, y):
        return int(math.floor(x + 0.5)), int(math.floor(y + 0.5))
    x, y, max_rad = float(x), float(y), float(max_rad)
    x0 = int(math.ceil(min(max(x - max_rad, 0.0), float(map2d.width))))
    y0 = int(math.ceil(min(max(y - max_rad, 0.0), float(map2d.height))))
    x1 = int(math.floor(max(min(x + max_rad, map2d.width - 1.0), -1.0)))
    y1 = int(math.floor(max(min(y + max_rad, map2d.height - 1.0), -1.0)))
    if max_rad >= 0 and x0 <= x1 and y0 <= y1:
        rows, cols = np.nonzero(~map2d.occ[y0 : y1 + 1, x0 : x1 + 1])
        if rows.size:
            d2 = (cols + x0 - x) ** 2 + (rows + y0 - y) ** 2
            k = int(np.argmin(d2))
            if float(d2[k]) <= max_rad * max_rad + 1e-9:
                return int(cols[k]) + x0, int(rows[k]) + y0
    raise ValueError("no free pixel within the radius")


def _shifted(array, dy, dx):
    """out[y, x] = array[y + dy, x + dx], False outside; dy is at least 0."""
    h, w = array.shape
    out = np.zeros_like(array)
    if abs(dx) >= w or dy >= h:
        return out
    x0, x1 = max(0, -dx), min(w, w - dx)
    out[: h - dy, x0:x1] = array[dy:, x0 + dx : x1 + dx]
    return out


def _repeat_move(unit, dy, dx, cell):
    """Where `cell` unit moves in a row are possible."""
    total = unit.copy()
    for k in range(1, min(cell, max(unit.shape) + 1)):
        total &= _shifted(unit, k * dy, k * dx)
    return total


def _move_masks(free, cell, ox, oy):
    """For each lattice point the possible moves, as bits in the order of MOVES."""
    below = _shifted(free, 1, 0)
    east = free & _shifted(free, 0, 1)
    south = free & below
    south_east = east & below & _shifted(free, 1, 1)
    south_west = free & _shifted(free, 0, -1) & below & _shifted(free, 1, -1)
    e = _repeat_move(east, 0, 1, cell)[oy::cell, ox::cell].astype(np.uint8)
    s = _repeat_move(south, 1, 0, cell)[oy::cell, ox::cell].astype(np.uint8)
    se = _repeat_move(south_east, 1, 1, cell)[oy::cell, ox::cell].astype(np.uint8)
    sw = _repeat_move(south_west, 1, -1, cell)[oy::cell, ox::cell].astype(np.uint8)
    masks = e.copy()
    masks[:, 1:] |= e[:, :-1] << 1
    masks |= s << 2
    masks[1:, :] |= s[:-1, :] << 3
    masks |= se << 4
    masks[1:, 1:] |= se[:-1, :-1] << 5
    masks |= sw << 6
    masks[1:, :-1] |= sw[:-1, 1:] << 7
    return masks


def _move_table(width):
    """For each mask the list of (index change, length)."""
    table = []
    for mask in range(256):
        row = []
        for bit, (dx, dy) in enumerate(MOVES):
            if mask >> bit & 1:
                row.append((dx + dy * width, DIAGONAL if dx and dy else 1.0))
        table.append(row)
    return table


def _search(masks, weight, start, goal):
    """A* over flat lattice indices; weights are at least 1. [] without a path."""
    height, width = masks.shape
    table = _move_table(width)
    moves = masks.tobytes()
    gx, gy = goal % width, goal // width
    saving = 2.0 - DIAGONAL
    cost = [math.inf] * (height * width)
    cost[start] = 0.0
    parent = {start: -1}
    heap = [(0.0, 0.0, start)]
    while heap:
        _, negative, n = heapq.heappop(heap)
        g = -negative
        if g > cost[n]:
            continue
        if n == goal:
            break
        for delta, length in table[moves[n]]:
            m = n + delta
            new = g + length * weight[m]
            if new < cost[m] - 1e-9:
                cost[m] = new
                parent[m] = n
                dx = abs(m % width - gx)
                dy = abs(m // width - gy)
                rest = dx + dy - saving * (dx if dx < dy else dy)
                heapq.heappush(heap, (new + rest, -new, m))
    if goal not in parent:
        return []
    nodes = []
    n = goal
    while n != -1:
        nodes.append(n)
        n = parent[n]
    nodes.reverse()
    return nodes


def plan_path(map2d, start, goal, cell):
    """Shortest 8-connected path of a point in steps of `cell` px."""
    sx, sy = int(start[0]), int(start[1])
    gx, gy = int(goal[0]), int(goal[1])
    cell = max(1, int(cell))
    if map2d.is_occupied(sx, sy) or map2d.is_occupied(gx, gy):
        return []
    if (sx, sy) == (gx, gy):
        return [(sx, sy)]
    if (gx - sx) % cell or (gy - sy) % cell:
        return []
    ox, oy = sx % cell, sy % cell
    masks = _move_masks(~map2d.occ, cell, ox, oy)
    height, width = masks.shape
    first = (sy - oy) // cell * width + (sx - ox) // cell
    last = (gy - oy) // cell * width + (gx - ox) // cell
    nodes = _search(masks, [1.0] * (height * width), first, last)
    return [(ox + n % width * cell, oy + n // width * cell) for n in nodes]


# ---------------------------------------------------------------- clearances


def _distance_field(occ, reach):
    """Distance of each pixel's centre to the nearest occupied square, up to reach.

    The result has a rim of one pixel that stands for the outside.
    """
    padded = np.pad(occ, 1, constant_values=True)
    h, w = padded.shape
    down = np.zeros((h, w), np.float32)
    up = np.zeros((h, w), np.float32)
    run = np.zeros(w, np.float32)
    for j in range(h):
        run = np.where(padded[j], np.float32(0), run + np.float32(1))
        down[j] = run
    run = np.zeros(w, np.float32)
    for j in range(h - 1, -1, -1):
        run = np.where(padded[j], np.float32(0), run + np.float32(1))
        up[j] = run
    gap = np.maximum(np.minimum(down, up) - np.float32(0.5), np.float32(0))
    square = np.minimum(gap, np.float32(reach + 1)) ** 2
    best = square.copy()
    for d in range(1, min(reach, w - 1) + 1):
        extra = np.float32((d - 0.5) ** 2)
        np.minimum(best[:, d:], square[:, :-d] + extra, out=best[:, d:])
        np.minimum(best[:, :-d], square[:, d:] + extra, out=best[:, :-d])
    return np.minimum(np.sqrt(best), np.float32(reach))


class World:
    """The map with the clearance of every point."""

    def __init__(self, occ):
        self.occ = np.asarray(occ, np.bool_)
        self.height, self.width = self.occ.shape
        field = _distance_field(self.occ, FIELD_REACH)
        self.interior = field[1:-1, 1:-1]
        self.flat = field.ravel().tolist()
        self.pitch = self.width + 2
        self.pad = 16
        self.padded = np.pad(self.occ, self.pad, constant_values=True)

    def clearance(self, x, y):
        """Distance of the point to the nearest wall, px (at most FIELD_REACH)."""
        if not (-0.5 <= x < self.width - 0.5 and -0.5 <= y < self.height - 0.5):
            return 0.0
        u, v = x + 1.0, y + 1.0
        i, j = int(u), int(v)
        a, b = u - i, v - j
        p = j * self.pitch + i
        flat = self.flat
        top = flat[p] * (1.0 - a) + flat[p + 1] * a
        p += self.pitch
        low = flat[p] * (1.0 - a) + flat[p + 1] * a
        value = top * (1.0 - b) + low * b
        if BODY_RADIUS - 2.0 < value < BODY_RADIUS + 1.0:
            return self.exact(x, y)
        return value

    def exact(self, x, y):
        """The same without interpolation, up to about 15 px."""
        i, j = math.floor(x + 0.5), math.floor(y + 0.5)
        r = self.pad - 1
        i0, j0 = i - r, j - r
        part = self.padded[
            j0 + self.pad : j0 + self.pad + 2 * r + 1,
            i0 + self.pad : i0 + self.pad + 2 * r + 1,
        ]
        cols = np.maximum(np.abs(np.arange(part.shape[1]) + (i0 - x)) - 0.5, 0.0)
        rows = np.maximum(np.abs(np.arange(part.shape[0]) + (j0 - y)) - 0.5, 0.0)
        d2 = rows[:, None] ** 2 + cols[None, :] ** 2
        return math.sqrt(float(np.where(part, d2, float(r * r)).min()))

    def segment_free(self, ax, ay, bx, by, floor):
        """Whether the clearance is at least `floor` on the way from a to b."""
        n = max(1, math.ceil(math.hypot(bx - ax, by - ay)))
        dx, dy = (bx - ax) / n, (by - ay) / n
        for k in range(1, n + 1):
            if self.clearance(ax + k * dx, ay + k * dy) < floor:
                return False
        return True

    def arc_free(self, x, y, heading, left, right, floor):
        """Whether one step with these wheel speeds keeps the clearance."""
        way = 0.5 * (left + right) * STEP_PX
        turn = (left - right) * STEP_PX / AXLE_LENGTH_PX
        n = 6
        for k in range(1, n + 1):
            t = k / n
            if abs(turn) < 1e-6:
                px = x + way * t * math.cos(heading)
                py = y + way * t * math.sin(heading)
            else:
                r = way / turn
                px = x + r * (math.sin(heading + turn * t) - math.sin(heading))
                py = y - r * (math.cos(heading + turn * t) - math.cos(heading))
            if self.clearance(px, py) < floor:
                return False
        return True


def _anchor(world, free, cell, x, y, floor):
    """The nearest free lattice point (as column, row) in sight, or None."""
    reach = 40.0
    part = free[::cell, ::cell]
    rows_n, cols_n = part.shape
    i0 = max(0, int((x - reach) // cell))
    j0 = max(0, int((y - reach) // cell))
    i1 = min(cols_n, int((x + reach) // cell) + 2)
    j1 = min(rows_n, int((y + reach) // cell) + 2)
    if i0 >= i1 or j0 >= j1:
        return None
    rows, cols = np.nonzero(part[j0:j1, i0:i1])
    if rows.size == 0:
        return None
    rows, cols = rows + j0, cols + i0
    d2 = (cols * cell - x) ** 2 + (rows * cell - y) ** 2
    for k in np.argsort(d2, kind="stable")[:400].tolist():
        col, row = int(cols[k]), int(rows[k])
        if world.segment_free(x, y, float(col * cell), float(row * cell), floor):
            return col, row
    return None


def _leave_floor(here, need):
    """Clearance to keep: `need`, or what there is where the robot is closer."""
    return min(need, max(here - 0.02, BODY_RADIUS + 0.004))


def _route_nodes(world, start, goal, cell, need):
    """Lattice points of a cheap route that keeps to the middle of passages."""
    free = world.interior >= need
    floor = _leave_floor(world.clearance(start[0], start[1]), need)
    first = _anchor(world, free, cell, start[0], start[1], floor)
    last = _anchor(world, free, cell, goal[0], goal[1], 0.3)
    if first is None or last is None:
        return []
    masks = _move_masks(free, cell, 0, 0)
    width = masks.shape[1]
    near = np.maximum(COMFORT - world.interior[::cell, ::cell], 0.0) / 10.0
    weight = (1.0 + 1.5 * near * near).ravel().tolist()
    nodes = _search(
        masks, weight, first[1] * width + first[0], last[1] * width + last[0]
    )
    return [(float(n % width * cell), float(n // width * cell)) for n in nodes]


def plan_route(world, start, goal):
    """Points from the start to the goal for the centre of the body."""
    for cell, need in PLANS:
        nodes = _route_nodes(world, start, goal, cell, need)
        if nodes:
            points = [start] + nodes
            ex, ey = points[-1]
            apart = math.hypot(goal[0] - ex, goal[1] - ey)
            if apart > 0.5 and world.segment_free(
                ex, ey, goal[0], goal[1], BODY_RADIUS + 0.3
            ):
                points.append(goal)
            return points
    return [start, goal]


# ---------------------------------------------------------------- driving


def _clip(value, low, high):
    return low if value < low else high if value > high else value


def _wrap(angle):
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def _spin(angle):
    """Turns in place by `angle`, or as far as one step goes."""
    a = _clip(angle * AXLE_LENGTH_PX / (2.0 * STEP_PX), -1.0, 1.0)
    return a, -a


def _freer_side(ranges):
    """A turn in place to the side with more room."""
    half = len(ranges) // 2
    if sum(ranges[:half]) > sum(ranges[len(ranges) - half :]):
        return -0.4, 0.4
    return 0.4, -0.4


class Driver:
    """Follows a route that is planned at the start of the episode."""

    def __init__(self, world):
        self.world = world
        self.goal = None
        self.route = []
        self.clear = []
        self.along = []
        self.index = 0
        self.mark = 0.0
        self.idle = 0
        self.forced = 0
        self.plans = 0

    def begin(self, obs):
        pose = [float(v) for v in obs["pose"]]
        self.goal = (float(obs["goal"][0]), float(obs["goal"][1]))
        self.forced = 0
        self.plans = 0
        self.set_route(pose[0], pose[1])

    def set_route(self, x, y):
        self.plans += 1
        self.route = plan_route(self.world, (x, y), self.goal)
        self.clear = [self.world.clearance(px, py) for px, py in self.route]
        self.along = [0.0]
        for k in range(1, len(self.route)):
            ax, ay = self.route[k - 1]
            bx, by = self.route[k]
            self.along.append(self.along[-1] + math.hypot(bx - ax, by - ay))
        self.index = 0
        self.mark = 0.0
        self.idle = 0

    def advance(self, x, y):
        """Moves on to the nearest point of the next stretch of the route."""
        limit = self.along[self.index] + 40.0
        best, best_k = math.inf, self.index
        k = self.index
        while k < len(self.route) and self.along[k] <= limit:
            d = math.hypot(self.route[k][0] - x, self.route[k][1] - y)
            if d < best:
                best, best_k = d, k
            k += 1
        self.index = best_k
        if self.along[best_k] > self.mark + 2.0:
            self.mark = self.along[best_k]
            self.idle = 0
        else:
            self.idle += 1

    def target(self, x, y, here):
        """The farthest point ahead on the route that can be reached straight."""
        last = len(self.route) - 1
        base = self.along[self.index]
        for ahead in AHEADS:
            k = min(bisect.bisect_left(self.along, base + ahead), last)
            px, py = self.route[k]
            if math.hypot(px - x, py - y) < 1.0:
                continue
            stretch = self.clear[self.index + 1 : k + 1] or [self.clear[k]]
            need = max(
                BODY_RADIUS + 0.1, min(BODY_RADIUS + 4.0, min(stretch)) - 0.6
            )
            if self.world.segment_free(x, y, px, py, _leave_floor(here, need)):
                return px, py
        px, py = self.route[min(self.index + 2, last)]
        if math.hypot(px - x, py - y) < 1.0:
            return self.goal
        return px, py

    def escape(self, x, y, heading, here, ranges):
        """Turns to where there is more room and goes there slowly."""
        floor = _leave_floor(here, BODY_RADIUS + 0.25)
        best, best_error = -math.inf, None
        for k in range(24):
            angle = k * math.pi / 12.0
            px, py = x + 5.0 * math.cos(angle), y + 5.0 * math.sin(angle)
            if not self.world.segment_free(x, y, px, py, floor):
                continue
            error = _wrap(angle - heading)
            score = self.world.clearance(px, py) - 0.3 * abs(error)
            if score > best:
                best, best_error = score, error
        if best_error is None:
            return _freer_side(ranges)
        if abs(best_error) > 0.15:
            return _spin(best_error)
        if self.world.arc_free(x, y, heading, 0.3, 0.3, floor):
            return 0.3, 0.3
        return _freer_side(ranges)

    def act(self, obs):
        x, y, heading = [float(v) for v in obs["pose"]]
        goal = (float(obs["goal"][0]), float(obs["goal"][1]))
        if not self.route or goal != self.goal:
            self.begin(obs)
        readings = obs.get("ranges")
        if readings is None or len(readings) == 0:
            ranges = [SENSOR_RANGE_PX] * N_RAYS
        else:
            ranges = [float(v) for v in readings]
        here = self.world.clearance(x, y)
        self.advance(x, y)

        if self.forced > 0:
            self.forced -= 1
            action = self.escape(x, y, heading, here, ranges)
            if self.forced == 0:
                self.idle = 0
                if self.plans < 7:
                    self.set_route(x, y)
            return action
        if self.idle > 60:
            self.forced = 14
            return self.escape(x, y, heading, here, ranges)

        tx, ty = self.target(x, y, here)
        distance = math.hypot(tx - x, ty - y)
        error = _wrap(math.atan2(ty - y, tx - x) - heading)
        middle = len(ranges) // 2
        front = min(ranges[max(0, middle - 3) : middle + 3])
        if abs(error) > 0.5 or (front < STOP_DIST and abs(error) > 0.1):
            return _spin(error)

        # Forward speed: slower near walls, near the goal and while turning.
        pace = 0.45 + 0.55 * _clip((here - BODY_RADIUS - 0.5) / 6.0, 0.0, 1.0)
        room = (front - BODY_RADIUS) / (SLOW_DIST - BODY_RADIUS)
        pace *= _clip(room, 0.35, 1.0)
        pace *= 1.0 - 1.6 * abs(error)
        if math.hypot(goal[0] - x, goal[1] - y) < 40.0:
            pace = min(pace, 0.6)
        if front < STOP_DIST:
            pace = min(pace, 0.1)
        turn = _clip(0.8 * error, -0.25, 0.25)
        half = 0.5 * turn * AXLE_LENGTH_PX / STEP_PX
        pace = min(pace, 1.0 - abs(half), max(distance, 0.4) / STEP_PX)
        pace = max(pace, 0.02)

        floor = _leave_floor(here, BODY_RADIUS + 0.25)
        for scale in (1.0, 0.6, 0.35, 0.15):
            left = _clip(pace * scale + half, -1.0, 1.0)
            right = _clip(pace * scale - half, -1.0, 1.0)
            if self.world.arc_free(x, y, heading, left, right, floor):
                return left, right
        if abs(error) > 0.03:
            return _spin(error)
        return self.escape(x, y, heading, here, ranges)


WORLD = World(sensors.load_occupancy(MAP_IMG))
DRIVER = Driver(WORLD)


def reset(obs):
    """Plans the route from the first pose of the episode."""
    DRIVER.begin(obs)


def policy(obs):
    """Speeds of the left and of the right wheel, each in [-1, 1]."""
    left, right = DRIVER.act(obs)
    return float(_clip(left, -1.0, 1.0)), float(_clip(right, -1.0, 1.0))


def run_episode(env, max_steps):
    """Runs one episode and reports what the environment did."""
    obs, info = env.reset()
    reset(obs)
    goal = (float(obs["goal"][0]), float(obs["goal"][1]))
    positions = [(float(obs["pose"][0]), float(obs["pose"][1]))]
    speeds = []
    for _ in range(int(max_steps)):
        left, right = policy(obs)
        obs, _reward, terminated, truncated, info = env.step((left, right))
        positions.append((float(obs["pose"][0]), float(obs["pose"][1])))
        applied_left = _clip(float(left), -1.0, 1.0)
        applied_right = _clip(float(right), -1.0, 1.0)
        speeds.append((applied_left + applied_right) / 2.0 * MAX_WHEEL_SPEED)
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
