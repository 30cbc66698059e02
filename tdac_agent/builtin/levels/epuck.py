"""Drives an e-puck to a goal without a map and without a pose, by feel.

A Kalman filter adds up the angles of the wheels, and corrects the pose by the
directions of the walls, which are all parallel or at right angles to each other. What
the infra-red sensors hit, and where their rays and the body found nothing, is kept in a
map of the robot's own; its way leads to the goal as if all that is unknown were free.
The robot drives only where its rays have been: they are few, so it looks around for it.
"""

import heapq
import json
import math

import numpy as np

with open("params.json") as file:
    PARAMS = json.load(file)
ROBOT, NOISES = PARAMS["robot"], PARAMS.get("disturbances", {})
RADIUS, AXLE, RIM = ROBOT["radius"], ROBOT["axle_length"], ROBOT["wheel_radius"]
TOLERANCE = PARAMS["goal_tolerance"]
STEP = ROBOT["max_wheel_speed"] * RIM * PARAMS["dt"]  # m at full speed
SLIP = max(NOISES.get("wheel_slip", 0.0) * math.sqrt(0.1 / PARAMS["dt"]), 0.005)
WHEEL = max(NOISES.get("wheel_radius_error", 0.0), 0.002)
AXLE_ERROR = max(NOISES.get("axle_error", 0.0), 0.002)

# Rays of ps0 to ps7: x ahead, y to the left, azimuth; and readings by their lengths.
RAYS = np.array(
    [
        (0.030, -0.010, -0.3008),
        (0.022, -0.025, -0.8008),
        (0.000, -0.031, -1.5708),
        (-0.030, -0.015, -2.6440),
        (-0.030, 0.015, 2.6392),
        (0.000, 0.031, 1.5708),
        (0.022, 0.025, 0.7992),
        (0.030, 0.010, 0.2992),
    ]
)
LENGTHS = np.array([0.0, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07])
READINGS = np.array(
    [4095.0, 2133.33, 1465.73, 601.46, 383.84, 234.93, 158.03, 120.0, 104.09, 67.19]
)
FLAT = 0.987  # length on the floor of a ray of length 1
SEEN = 84.0  # a lower reading may be noise
CLEAR = 0.06  # m that a ray without a hit is free
SIDES = (2, 5)  # sensors that look to the sides
AHEAD = (-0.31, 0.31, -0.83, 0.83)  # bearings at which sensors ahead look

FINE = 0.01  # m, cells of hits and of free space
CELL = 0.015  # m, cells of the search
HALF = 3.2  # m from the start to the borders of the maps
KEEP = 0.005  # m that are kept from hits in the search
NEAR = 0.03  # m from the body in which a cell costs more
PRICE = 1.5  # how much more
WIDE = 0.009  # m beside a ray that count as seen
LOOK = 0.07  # m ahead on the path
MARGIN = 0.006  # m that arcs keep from hits
BEYOND = 0.02  # m that a wall is taken to go on beyond its last hit
AGAIN = 0.02  # m that a spin back costs
RISK, SAFE = 0.25, 0.02  # m that a contact costs; m of room in which it is a third


def wrapped(angle, turn=2.0 * math.pi):
    """The angle in (-turn / 2, turn / 2]."""
    return angle - turn * math.floor(angle / turn + 0.5)


class Pose:
    """A Kalman filter over the pose and what is wrong with the wheels.

    Attributes:
        pose: x, y and heading.
        bend: Turn for each m, rad, since the wheels differ.
        scale: Relative error of turns, since the axle differs.
        grid: Direction of the walls, rad, up to right angles; None if not known yet.
        spread: Covariance of the errors of all of these.
    """

    def __init__(self):
        self.pose = [0.0, 0.0, 0.0]
        self.bend = self.scale = 0.0
        self.grid = None
        bend = WHEEL * math.sqrt(2.0 / 3.0) / AXLE
        scale = AXLE_ERROR / math.sqrt(3.0) + WHEEL / 3.0
        self.spread = np.diag([1e-8, 1e-8, 1e-8, bend**2, scale**2, 100.0])

    def moved(self, left, right):
        """Takes a step of the wheels, m."""
        x, y, heading = self.pose
        way, turn = 0.5 * (left + right), (right - left) / AXLE
        true = turn * (1.0 + self.scale) + self.bend * way
        middle = heading + 0.5 * true
        dx, dy = way * math.cos(middle), way * math.sin(middle)
        self.pose = [x + dx, y + dy, heading + true]
        step = np.eye(6)
        step[0, 2], step[1, 2] = -dy, dx
        step[2, 3], step[2, 4] = way, turn
        noise = np.zeros((6, 6))
        wheel = SLIP**2 * (left * left + right * right)
        noise[2, 2] = wheel / AXLE**2
        along = 0.25 * wheel + 1e-10
        noise[0, 0], noise[1, 1] = along, along
        self.spread = step @ self.spread @ step.T + noise

    def wall(self, direction, sd):
        """Takes the direction of a wall as seen, rad."""
        right = 0.5 * math.pi
        if self.grid is None:
            self.grid = wrapped(direction, right)
        off = wrapped(direction - self.grid, right)
        row = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 1.0])
        gain = self.spread @ row
        size = float(row @ gain) + sd * sd
        if off * off > 9.0 * size or abs(off) > 0.5:
            return
        gain = gain / size
        fix = gain * off
        # `fix` is by how much the pose is too far, and the walls are not far enough.
        self.pose = [p - f for p, f in zip(self.pose, fix[:3].tolist(), strict=True)]
        self.bend -= float(fix[3])
        self.scale -= float(fix[4])
        self.grid += float(fix[5])
        self.spread = self.spread - np.outer(gain, row @ self.spread)


class Walls:
    """The last hits of a sensor at the side, for the direction of a wall."""

    def __init__(self):
        self.points = []

    def add(self, point):
        """Adds a hit, or forgets all; gives the direction of a wall and its SD."""
        if point is None:
            self.points = []
            return None
        self.points.append(point)
        if len(self.points) < 6:
            return None
        at = np.array(self.points)
        length = float(np.hypot(*(at[-1] - at[0])))
        if length < 0.07:
            if len(self.points) > 30:
                self.points = self.points[1:]
            return None
        middle = at.mean(axis=0)
        off = at - middle
        _, sizes, axes = np.linalg.svd(off, full_matrices=False)
        rough = float(sizes[1]) / math.sqrt(len(at))
        if rough > 0.003:
            self.points = self.points[len(self.points) // 2 :]
            return None
        self.points = []
        direction = math.atan2(axes[0, 1], axes[0, 0])
        return direction, 0.015 + 2.0 * rough / length


class Maps:
    """Hits, free space, and where the body may be.

    Attributes:
        hits: Place and time of the last hit in each cell.
        passed: Cells that a ray has passed.
        free: Which cells rays and body have found free.
        block, close: Numbers of hits that a body at a place would touch, or be near to.
    """

    def __init__(self):
        self.hits = {}
        self.passed = set()
        side = int(2 * HALF / FINE)
        self.free = np.zeros((side, side), bool)
        cells = int(2 * HALF / CELL)
        self.block = np.zeros((cells, cells), np.int16)
        self.close = np.zeros((cells, cells), np.int16)
        span = int((RADIUS + NEAR) / CELL) + 2
        self.span = np.arange(-span, span + 1)
        reach = int(RADIUS / FINE) + 1
        i, j = np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1))
        inside = np.hypot(i, j) * FINE <= RADIUS + 0.003
        self.body = np.column_stack([i[inside], j[inside]])

    def stamp(self, point, sign):
        """Adds or removes what a hit blocks."""
        i0, j0 = (int((c + HALF) / CELL) for c in point)
        i, j = i0 + self.span, j0 + self.span
        dx = (i + 0.5) * CELL - HALF - point[0]
        dy = (j + 0.5) * CELL - HALF - point[1]
        far = np.hypot(dx[None, :], dy[:, None])
        part = np.ix_(j, i)
        self.block[part] += sign * (far < RADIUS + KEEP)
        self.close[part] += sign * (far < RADIUS + NEAR)

    def hit(self, point, now, faint=False):
        """Keeps a hit; a faint one is a guess."""
        if max(abs(point[0]), abs(point[1])) > HALF - 0.2:
            return
        key = int((point[0] + HALF) / FINE), int((point[1] + HALF) / FINE)
        old = self.hits.get(key)
        if faint and (old is not None or key in self.passed):
            return
        if old is None:
            self.stamp(point, 1)
            self.hits[key] = (point, now)
            i, j = key
            self.free[j - 1 : j + 2, i - 1 : i + 2] = False
        else:
            self.hits[key] = (old[0], now)

    def drop(self, key):
        """Forgets a hit."""
        self.stamp(self.hits.pop(key)[0], -1)

    def carve(self, pose, lengths, hit, now):
        """Takes what rays and body passed for free."""
        x, y, heading = pose
        cosine, sine = math.cos(heading), math.sin(heading)
        along = np.arange(0.0, 0.0601, 0.005)
        for k in range(8):
            far = lengths[k] - 0.004 if hit[k] else CLEAR
            angle = heading + RAYS[k, 2]
            ux, uy = math.cos(angle), math.sin(angle)
            ox = x + cosine * RAYS[k, 0] - sine * RAYS[k, 1]
            oy = y + sine * RAYS[k, 0] + cosine * RAYS[k, 1]
            some = along[along <= far]
            for side in (-WIDE, 0.0, WIDE):
                i = ((ox + ux * some - uy * side + HALF) / FINE).astype(int)
                j = ((oy + uy * some + ux * side + HALF) / FINE).astype(int)
                self.free[j, i] = True
                if side == 0.0:
                    sure = max(len(some) - 2, 0)
                    for key in zip(i[:sure].tolist(), j[:sure].tolist(), strict=True):
                        self.passed.add(key)
                        if key in self.hits and self.hits[key][1] < now - 3:
                            self.drop(key)
        i, j = int((x + HALF) / FINE), int((y + HALF) / FINE)
        self.free[j + self.body[:, 1], i + self.body[:, 0]] = True
        for di, dj in self.body.tolist():
            if (di * di + dj * dj) * FINE * FINE < (RADIUS - 0.008) ** 2:
                key = i + di, j + dj
                if key in self.hits:
                    self.drop(key)

    def trust(self, x, y):
        """Takes what is near for free, unless something was hit there."""
        i, j = int((x + HALF) / FINE), int((y + HALF) / FINE)
        self.free[j - 10 : j + 11, i - 10 : i + 11] = True

    def around(self, x, y, reach):
        """Hits within a square, shape (n, 2)."""
        found = [
            p
            for p, _ in self.hits.values()
            if abs(p[0] - x) < reach and abs(p[1] - y) < reach
        ]
        return np.array(found).reshape(-1, 2)

    def path(self, start, goal):
        """Points of the cheapest way, if all unknown space is free; None if none."""
        cells = self.block.shape[0]
        si, sj = (int((c + HALF) / CELL) for c in start)
        gi, gj = (int((c + HALF) / CELL) for c in goal)
        blocked, close = self.block > 0, self.close > 0
        best, came = {(si, sj): 0.0}, {}
        heap = [(math.hypot(gi - si, gj - sj), si, sj)]
        near = TOLERANCE * 0.6 / CELL
        done = set()
        while heap:
            _, i, j = heapq.heappop(heap)
            if (i, j) in done:
                continue
            done.add((i, j))
            if math.hypot(gi - i, gj - j) <= near and not blocked[j, i]:
                way = [(i, j)]
                while way[-1] in came:
                    way.append(came[way[-1]])
                way.reverse()
                return (np.array(way) + 0.5) * CELL - HALF
            here = best[i, j]
            for di, dj, size in NEIGHBOURS:
                u, v = i + di, j + dj
                if not (1 <= u < cells - 1 and 1 <= v < cells - 1) or (u, v) in done:
                    continue
                price = 1.0
                if blocked[v, u]:
                    if max(abs(u - si), abs(v - sj)) > 2:
                        continue
                    price = 8.0
                elif close[v, u]:
                    price += PRICE
                cost = here + size * price
                if cost < best.get((u, v), math.inf):
                    best[u, v] = cost
                    came[u, v] = (i, j)
                    rest = math.hypot(gi - u, gj - v)
                    heapq.heappush(heap, (cost + rest, u, v))
        return None


NEIGHBOURS = [
    (i, j, math.hypot(i, j)) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j
]
TIMES = np.arange(1, 8)


def courses():
    """An arc of one, two, four or all steps, and then a straight line.

    Returns:
        Speeds, shape (n, 2), and x, y and heading after each step, shape (n, 7).
    """
    ends = [-1.0, -0.6, -0.2, 0.1, 0.3, 0.5, 0.65, 0.8, 0.9, 1.0]
    pairs = [(1.0, e) for e in ends] + [(e, 1.0) for e in ends[:-1]]
    pairs += [(0.5 * a, 0.5 * b) for a, b in pairs]
    pairs += [(0.25, -0.25), (-0.25, 0.25)]
    pairs += [(-0.5, -0.5), (-0.5, -0.2), (-0.2, -0.5)]
    speeds, places = [], []
    for left, right in pairs:
        for arc in (1, 2, 4, 7):
            if left == right and arc < 7:
                continue
            x = y = heading = 0.0
            row = []
            for t in TIMES.tolist():
                if t <= arc:
                    way, turn = 0.5 * (left + right), (right - left) * STEP / AXLE
                else:
                    way, turn = max(abs(left), abs(right)), 0.0
                    way = math.copysign(way, left + right + 1e-9)
                x += STEP * way * math.cos(heading + 0.5 * turn)
                y += STEP * way * math.sin(heading + 0.5 * turn)
                heading += turn
                row.append((x, y, heading))
            speeds.append((left, right))
            places.append(row)
    return np.array(speeds), np.array(places)


SPEEDS, PLACES = courses()
SPINS = np.where(SPEEDS.prod(axis=1) < 0.0, SPEEDS[:, 1] - SPEEDS[:, 0], 0.0)
# The rim of the body, in which nothing may be that no ray has seen.
BEARINGS = np.linspace(-1.5, 1.5, 13)
RINGS = np.repeat([RADIUS + 0.002, 0.7 * RADIUS], len(BEARINGS))
RIM_X = RINGS * np.tile(np.cos(BEARINGS), 2)
RIM_Y = RINGS * np.tile(np.sin(BEARINGS), 2)
STATE = {}


def reset(obs):
    """Forgets everything."""
    STATE.update(
        pose=Pose(),
        maps=Maps(),
        walls={k: Walls() for k in SIDES},
        angles=np.zeros(2),
        goal=[float(value) for value in obs["goal"]],
        goals=[],
        aim=[float(value) for value in obs["goal"]],
        path=None,
        age=99,
        ends=[None] * 8,
        now=0,
        looks=0,
        trail=[],
        spin=0.0,
    )


def sensed(ps):
    """Lengths of the rays on the floor, and which of them have hit something."""
    ps = np.asarray(ps, float)
    lengths = np.interp(ps, READINGS[::-1], LENGTHS[::-1])
    return FLAT * lengths, ps > SEEN


def tips(pose, lengths):
    """Where the rays end, shape (8, 2)."""
    x, y, heading = pose
    cosine, sine = math.cos(heading), math.sin(heading)
    ox = x + cosine * RAYS[:, 0] - sine * RAYS[:, 1]
    oy = y + sine * RAYS[:, 0] + cosine * RAYS[:, 1]
    angles = heading + RAYS[:, 2]
    return np.column_stack(
        [ox + lengths * np.cos(angles), oy + lengths * np.sin(angles)]
    )


def aim_around(x, y):
    """Goes around the goal in rings, if it is not where it is believed."""
    aim = STATE["aim"]
    gap = math.hypot(aim[0] - x, aim[1] - y)
    STATE["trail"] = [*STATE["trail"][-40:], (x, y)]
    stuck = len(STATE["trail"]) > 40 and np.ptp(STATE["trail"], axis=0).max() < 0.03
    if gap > 0.02 and not stuck:
        return
    if stuck:
        STATE["trail"] = []
        if gap > 0.3:
            STATE["maps"].trust(x, y)
            return
    if not STATE["goals"]:
        gx, gy = STATE["goal"]
        for ring in range(1, 7):
            for k in range(6 * ring):
                angle = 2.0 * math.pi * k / (6 * ring)
                away = 1.3 * TOLERANCE * ring
                STATE["goals"].append(
                    [gx + away * math.cos(angle), gy + away * math.sin(angle)]
                )
    STATE["aim"] = STATE["goals"].pop(0)
    STATE["path"] = None


def plan(x, y):
    """Looks for the way to the goal, when there is need."""
    maps, path = STATE["maps"], STATE["path"]
    STATE["age"] += 1
    if path is not None and STATE["age"] < 40:
        i, j = ((path + HALF) / CELL).astype(int).T
        gaps = np.hypot(path[:, 0] - x, path[:, 1] - y)
        if not (maps.block[j, i][3:] > 0).any() and gaps.min() < 0.04:
            return
        if STATE["age"] < 2:
            return
    STATE["age"] = 0
    found = maps.path((x, y), STATE["aim"])
    if found is None:
        old = sorted(maps.hits, key=lambda key: maps.hits[key][1])
        for key in old[: max(len(old) // 4, 1)] if old else []:
            maps.drop(key)
        if STATE["goals"]:
            STATE["aim"] = STATE["goals"].pop(0)
        found = maps.path((x, y), STATE["aim"])
    STATE["path"] = found


def target(x, y):
    """The point of the path that is aimed at."""
    path = STATE["path"]
    if path is None or len(path) < 2:
        return STATE["aim"]
    gaps = np.hypot(path[:, 0] - x, path[:, 1] - y)
    first = int(gaps.argmin())
    ahead = first
    while ahead + 1 < len(path) and gaps[ahead] < LOOK:
        ahead += 1
    if ahead + 1 == len(path):
        return STATE["aim"]
    return path[ahead].tolist()


def policy(obs):
    """Speeds of the wheels (left, right)."""
    pose, maps = STATE["pose"], STATE["maps"]
    angles = np.asarray(obs["encoders"], float)
    left, right = (RIM * (angles - STATE["angles"])).tolist()
    STATE["angles"] = angles
    pose.moved(left, right)
    STATE["now"] += 1
    lengths, hit = sensed(obs["ps"])
    ends = tips(pose.pose, lengths)
    for k in SIDES:
        good = hit[k] and lengths[k] < 0.058
        found = STATE["walls"][k].add(ends[k] if good else None)
        if found is not None:
            pose.wall(*found)
            ends = tips(pose.pose, lengths)
            for other in SIDES:
                STATE["walls"][other].points = []
    maps.carve(pose.pose, lengths, hit, STATE["now"])
    for k in range(8):
        last = STATE["ends"][k]
        here = STATE["ends"][k] = ends[k].tolist() if hit[k] else None
        if here is None:
            continue
        maps.hit(tuple(here), STATE["now"])
        if last is None:
            continue
        gap = math.dist(here, last)
        if 0.003 < gap < 0.02:
            # What has been seen goes on for a little, until a ray finds nothing there.
            dx, dy = (BEYOND / gap * (a - b) for a, b in zip(here, last, strict=True))
            for place in (here[0] + dx, here[1] + dy), (last[0] - dx, last[1] - dy):
                maps.hit(place, STATE["now"] - 4, faint=True)
    x, y, heading = pose.pose
    aim_around(x, y)
    plan(x, y)
    return chosen(x, y, heading)


def chosen(x, y, heading):
    """Speeds of the course that leads best along the path."""
    maps = STATE["maps"]
    cosine, sine = math.cos(heading), math.sin(heading)
    px = x + cosine * PLACES[:, :, 0] - sine * PLACES[:, :, 1]
    py = y + sine * PLACES[:, :, 0] + cosine * PLACES[:, :, 1]
    facing = heading + PLACES[:, :, 2]
    near = maps.around(x, y, 0.2)
    room = np.full(px.shape, 0.1)
    if len(near):
        gaps = np.hypot(px[..., None] - near[:, 0], py[..., None] - near[:, 1])
        room = gaps.min(axis=2) - RADIUS
        now = float(np.hypot(near[:, 0] - x, near[:, 1] - y).min()) - RADIUS
    else:
        now = 0.1
    least = min(MARGIN, now - 0.0005)
    fits = np.logical_and.accumulate(room >= least, axis=1)
    tx, ty = target(x, y)
    gap = np.hypot(tx - px, ty - py)
    bearing = np.abs(np.angle(np.exp(1j * (np.arctan2(ty - py, tx - px) - facing))))
    worth = gap + 0.012 * bearing + 0.004 * TIMES / 7.0
    worth = np.where(fits, worth, np.inf)
    price = worth[:, 3:].min(axis=1)
    price = price + RISK * np.exp(-np.maximum(room[:, :4].min(axis=1), 0.0) / SAFE)
    back = SPEEDS.sum(axis=1) < -0.1
    price = price + 0.05 * back + AGAIN * (SPINS * STATE["spin"] < 0.0)
    rx, ry, unseen = swept(px[:, :2], py[:, :2], facing[:, :2], back)
    hidden = unseen.any(axis=(1, 2))
    price = price + 0.03 * hidden
    k = int(price.argmin())
    if not math.isfinite(price[k]):
        STATE["path"] = None
        return escape(room)
    if hidden[k]:
        at_x, at_y = rx[k][unseen[k]][0], ry[k][unseen[k]][0]
        return look(math.atan2(at_y - y, at_x - x) - heading, rx[k], ry[k])
    if SPEEDS[k].sum() > 0.1:
        STATE["looks"] = 0
    STATE["spin"] = float(SPINS[k])
    return float(SPEEDS[k, 0]), float(SPEEDS[k, 1])


def swept(px, py, facing, back):
    """The front of the body in the next steps: places, and which no ray has seen."""
    ahead = facing + np.where(back, math.pi, 0.0)[:, None]
    cos, sin = np.cos(ahead)[..., None], np.sin(ahead)[..., None]
    rx = px[..., None] + cos * RIM_X - sin * RIM_Y
    ry = py[..., None] + sin * RIM_X + cos * RIM_Y
    i, j = ((rx + HALF) / FINE).astype(int), ((ry + HALF) / FINE).astype(int)
    moves = np.abs(SPEEDS.sum(axis=1)) >= 0.05
    return rx, ry, ~STATE["maps"].free[j, i] & moves[:, None, None]


def look(place, rx, ry):
    """Speeds of a turn that points a sensor at an unseen place.

    Args:
        place: Its bearing, rad.
        rx: x of all that is wanted to be seen; it is taken for free after some looks.
        ry: y of it.
    """
    STATE["looks"] += 1
    if STATE["looks"] > 5:
        i, j = ((rx + HALF) / FINE).astype(int), ((ry + HALF) / FINE).astype(int)
        STATE["maps"].free[j, i] = True
        STATE["looks"] = 2
    turn = min((wrapped(place - azimuth) for azimuth in AHEAD), key=abs)
    share = min(max(turn * AXLE / (2.0 * STEP), -1.0), 1.0)
    if abs(share) < 0.05:
        share = math.copysign(0.05, share)
    return -share, share


def escape(room):
    """Speeds of the course that leaves most room."""
    value = room[:, 1] + 0.5 * room[:, 3]
    value = value - 0.02 * (np.abs(SPEEDS).max(axis=1) > 0.7)
    k = int(value.argmax())
    return 0.5 * float(SPEEDS[k, 0]), 0.5 * float(SPEEDS[k, 1])
