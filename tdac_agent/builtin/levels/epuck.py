"""Drives an e-puck to a goal without a map and without a pose, by feel.

A Kalman filter adds up the angles of the wheels, and corrects the pose by the
directions of the walls, which are all parallel or at right angles to each other. What
the infra-red sensors hit is kept in a map of the robot's own. Runs of hits along the
walls are plates: they are taken to go on until a ray finds nothing there, and believed
to go on up to the next plate across. A search finds the way to the goal that is
cheapest if all else is free, and the robot drives straight to the farthest point of it
that it can, along the arc that leads there best and leaves room.
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

FINE = 0.01  # m, cells of hits and of free space
CELL = 0.015  # m, cells of the search
HALF = 3.2  # m from the start to the borders of the maps
# How much more a place costs in the search whose body would be so near to a hit, m.
BELTS = (
    (0.002, 300.0),
    (0.006, 8.0),
    (0.010, 5.0),
    (0.015, 3.0),
    (0.02, 1.5),
    (0.025, 0.7),
    (0.032, 0.3),
)
WIDE = 0.009  # m beside a ray that count as seen
LOOK = 0.25  # m ahead on the path
MARGIN = 0.009  # m that arcs keep from hits
BEYOND = 0.02  # m that a thing is taken to go on beyond its last hit
PLATE = 0.05  # m that a plate is taken to go on beyond its last hit
LEAST, MOST = 0.22, 0.3  # m, widths of passages
SIDE = 2.03  # m, longest side of the floor
TIGHT = 1  # belt whose hits on the path call for another path
REPLAN = 5  # steps after which a path is looked for anew
DOUBT = 4.0  # how much more a place costs where a plate is believed to go on
UNKNOWN = 0.3  # how much more a place costs that no ray has seen
AGAIN = 0.02  # m that a spin back costs
RISK, SAFE = 0.06, 0.012  # m that a contact costs; m of room in which it is a third


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
        belts: Numbers of hits that a body at a place would be nearer to than each of
            `BELTS`.
        plates: Pieces of plates: axis, place across, and both ends.
        part: Rows and columns in which the last search was.
    """

    def __init__(self):
        self.hits = {}
        self.passed = set()
        side = int(2 * HALF / FINE)
        self.free = np.zeros((side, side), bool)
        cells = int(2 * HALF / CELL)
        self.belts = np.zeros((len(BELTS), cells, cells), np.int16)
        self.plates = []
        self.part = slice(0, cells), slice(0, cells)
        span = int((RADIUS + BELTS[-1][0]) / CELL) + 2
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
        for belt, (room, _) in zip(self.belts, BELTS, strict=True):
            belt[part] += sign * (far < RADIUS + room)

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

    def forget(self, place, reach, before):
        """Forgets the hits about a place that are older than a time."""
        for key, ((x, y), time) in list(self.hits.items()):
            if time < before and math.dist((x, y), place) < reach:
                self.drop(key)

    def around(self, x, y, reach):
        """Hits within a square, shape (n, 2)."""
        found = [
            p
            for p, _ in self.hits.values()
            if abs(p[0] - x) < reach and abs(p[1] - y) < reach
        ]
        return np.array(found).reshape(-1, 2)

    def plate(self, axis, across, low, high):
        """Keeps a piece of a plate: its axis, its place across, and its ends."""
        for old in self.plates:
            same = old[0] == axis and abs(old[1] - across) < 0.025
            if same and low < old[3] + 0.06 and high > old[2] - 0.06:
                old[1:] = [across, min(low, old[2]), max(high, old[3])]
                return
        self.plates.append([axis, across, low, high])

    def prices(self, grid, seen):
        """Price of each place: hits, plates that go on, and the sides of the floor.

        Args:
            grid: Direction of the walls, rad, or None.
            seen: Places that are surely on the floor, shape (n, 2).
        """
        side = self.belts.shape[1]
        price = np.full((side, side), 1000.0)
        hits = np.array([hit[0] for hit in self.hits.values()]).reshape(-1, 2)
        places = np.concatenate([seen, hits])
        low = ((places.min(axis=0) - 0.4 + HALF) / CELL).astype(int).clip(0, side)
        high = ((places.max(axis=0) + 0.4 + HALF) / CELL).astype(int).clip(0, side)
        part = slice(low[1], high[1]), slice(low[0], high[0])
        self.part = part
        rows, columns = (
            ((np.arange(c.start, c.stop) + 0.5) * CELL / FINE).astype(int) for c in part
        )
        price[part] = 1.0 + UNKNOWN * ~self.free[np.ix_(rows, columns)]
        for belt, (_, more) in zip(self.belts, BELTS, strict=True):
            price[part] = np.maximum(price[part], (1.0 + more) * (belt[part] > 0))
        if grid is None:
            return price
        ahead = np.array([math.cos(grid), math.sin(grid)])
        across = np.array([-ahead[1], ahead[0]])
        for x, y in self.doubtful(ahead, across):
            i, j = int((x + HALF) / CELL), int((y + HALF) / CELL)
            near = price[j - 2 : j + 3, i - 2 : i + 3]
            np.maximum(near, 1.0 + DOUBT, out=near)
        rows, columns = ((np.arange(c.start, c.stop) + 0.5) * CELL - HALF for c in part)
        for way in ahead, across:
            places = seen @ way
            far = way[0] * columns[None, :] + way[1] * rows[:, None]
            out = (far < places.max() - SIDE) | (far > places.min() + SIDE)
            price[part] += 1000.0 * out
        return price

    def doubtful(self, ahead, across):
        """Unseen places where plates go on, if they end at the next plate across."""
        found = []
        for axis, place, low, high in self.plates:
            along, other = (across, -ahead) if axis else (ahead, across)
            lines = [p[1] if axis else -p[1] for p in self.plates if p[0] != axis]
            for end, sign in (low, -1.0), (high, 1.0):
                ways = [sign * (line - end) for line in lines]
                ways = [way for way in ways if -0.02 < way < MOST]
                most = min(ways, default=max(0.5 * (LEAST - high + low), 0.03))
                steps = FINE * np.arange(1, int(most / FINE) + 1)
                points = np.outer(end + sign * steps, along) + place * other
                i, j = ((points + HALF) / FINE).astype(int).T
                found += points[~self.free[j, i]].tolist()
        return found

    def path(self, start, goal, price):
        """Points of the cheapest way, if all unknown space is free; and its price."""
        low_j, low_i = (c.start for c in self.part)
        flat = price[self.part]
        count, cells = flat.shape
        flat = flat.ravel().tolist()
        (si, sj), (gi, gj) = (
            (int((x + HALF) / CELL) - low_i, int((y + HALF) / CELL) - low_j)
            for x, y in (start, goal)
        )
        first = sj * cells + si
        best, came = {first: 0.0}, {}
        heap = [(math.hypot(gi - si, gj - sj), first)]
        near = TOLERANCE * 0.6 / CELL
        done = set()
        steps = [(j * cells + i, size) for i, j, size in NEIGHBOURS]
        while heap:
            _, at = heapq.heappop(heap)
            if at in done:
                continue
            done.add(at)
            j, i = divmod(at, cells)
            if math.hypot(gi - i, gj - j) <= near and flat[at] < 100.0:
                way = [at]
                while way[-1] in came:
                    way.append(came[way[-1]])
                way.reverse()
                places = np.array(
                    [(k % cells + low_i, k // cells + low_j) for k in way]
                )
                return (places + 0.5) * CELL - HALF, best[at]
            if not (1 <= i < cells - 1 and 1 <= j < count - 1):
                continue
            here, mine = best[at], flat[at]
            for step, size in steps:
                to = at + step
                if to in done:
                    continue
                cost = here + 0.5 * size * (mine + flat[to])
                if cost < best.get(to, math.inf):
                    best[to] = cost
                    came[to] = at
                    v, u = divmod(to, cells)
                    heapq.heappush(heap, (cost + math.hypot(gi - u, gj - v), to))
        return None, math.inf


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
        trail=[],
        spin=0.0,
        runs=[[] for _ in range(8)],
        visited=[(0.0, 0.0)],
        price=None,
        dropped=-99,
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
            STATE["maps"].forget((x, y), 0.2, STATE["now"] - 10)
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
    if path is not None and STATE["age"] < REPLAN:
        i, j = ((path + HALF) / CELL).astype(int).T
        if int((maps.belts[TIGHT][j, i] > 0).sum()) <= STATE["tight"]:
            return
    STATE["age"] = 0
    grid = STATE["pose"].grid
    seen = np.array([*STATE["visited"], STATE["goal"], (x, y)])
    price = STATE["price"] = maps.prices(grid, seen)
    found, cost = maps.path((x, y), STATE["aim"], price)
    if cost > 900.0 and STATE["now"] - STATE["dropped"] > 40:
        STATE["dropped"] = STATE["now"]
        old = sorted(maps.hits, key=lambda key: maps.hits[key][1])
        for key in old[: max(len(old) // 4, 1)] if old else []:
            maps.drop(key)
        maps.plates = []
        if STATE["goals"]:
            STATE["aim"] = STATE["goals"].pop(0)
    STATE["path"] = found
    if found is not None:
        i, j = ((found + HALF) / CELL).astype(int).T
        STATE["tight"] = int((maps.belts[TIGHT][j, i] > 0).sum())


def target(x, y):
    """The farthest point of the path that a straight drive reaches as cheaply."""
    path, price = STATE["path"], STATE["price"]
    if path is None or len(path) < 2:
        return STATE["aim"]
    gaps = np.hypot(path[:, 0] - x, path[:, 1] - y)
    first = int(gaps[:20].argmin())
    i, j = ((path + HALF) / CELL).astype(int).T
    sizes = np.hypot(*np.diff(path[first:], axis=0).T)
    costs = price[j, i][first:]
    sums = np.concatenate([[0.0], np.cumsum(sizes * 0.5 * (costs[1:] + costs[:-1]))])
    last = min(len(path) - 1, first + int(LOOK / CELL))
    for k in range(last, first + 2, -2):
        far = math.hypot(path[k, 0] - x, path[k, 1] - y)
        if far > LOOK:
            continue
        share = np.linspace(0.0, 1.0, max(int(far / 0.01), 2))
        i = ((x + share * (path[k, 0] - x) + HALF) / CELL).astype(int)
        j = ((y + share * (path[k, 1] - y) + HALF) / CELL).astype(int)
        if price[j, i].mean() * far <= sums[k - first] * 1.1 + 0.015:
            break
    else:
        k = min(first + 3, len(path) - 1)
    if k == len(path) - 1:
        return STATE["aim"]
    return path[k].tolist()


def plates(ends, hit):
    """Takes runs of hits along the walls for plates, which go on for a little."""
    maps, grid = STATE["maps"], STATE["pose"].grid
    for k in range(8):
        run = STATE["runs"][k]
        if not hit[k]:
            run.clear()
            continue
        here = ends[k].tolist()
        gap = math.dist(here, run[-1]) if run else 1.0
        if gap > 0.025:
            run.clear()
        if gap > 0.003:
            run.append(here)
        del run[:-8]
        if grid is None or len(run) < 4 or math.dist(run[-1], run[0]) < 0.03:
            continue
        at = np.array(run)
        off = at - at.mean(axis=0)
        angle = 0.5 * math.atan2(
            2.0 * float(off[:, 0] @ off[:, 1]),
            float(off[:, 0] @ off[:, 0] - off[:, 1] @ off[:, 1]),
        )
        if abs(wrapped(angle - grid, 0.5 * math.pi)) > 0.15:
            continue
        axis = round((angle - grid) / (0.5 * math.pi)) % 2
        way = grid + axis * 0.5 * math.pi
        cosine, sine = math.cos(way), math.sin(way)
        across = at @ np.array([-sine, cosine])
        if across.std() > 0.003:
            continue
        along = at @ np.array([cosine, sine])
        low, high, middle = float(along.min()), float(along.max()), float(across.mean())
        maps.plate(axis, middle, low, high)
        for n in range(1, int(PLATE / FINE) + 1):
            for u in low - n * FINE, high + n * FINE:
                x, y = u * cosine - middle * sine, u * sine + middle * cosine
                maps.hit((x, y), STATE["now"] - 4, faint=True)


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
    plates(ends, hit)
    x, y, heading = pose.pose
    if STATE["now"] % 8 == 0:
        STATE["visited"].append((x, y))
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
    worth = gap + 0.004 * bearing + 0.004 * TIMES / 7.0
    worth = np.where(fits, worth, np.inf)
    price = worth[:, 3:].min(axis=1)
    price = price + RISK * np.exp(-np.maximum(room[:, :4].min(axis=1), 0.0) / SAFE)
    back = SPEEDS.sum(axis=1) < -0.1
    price = price + 0.05 * back + AGAIN * (SPINS * STATE["spin"] < 0.0)
    k = int(price.argmin())
    if not math.isfinite(price[k]):
        STATE["path"] = None
        return escape(room)
    STATE["spin"] = float(SPINS[k])
    return float(SPEEDS[k, 0]), float(SPEEDS[k, 1])


def escape(room):
    """Speeds of the course that leaves most room."""
    value = room[:, 1] + 0.5 * room[:, 3]
    value = value - 0.02 * (np.abs(SPEEDS).max(axis=1) > 0.7)
    k = int(value.argmax())
    return 0.5 * float(SPEEDS[k, 0]), 0.5 * float(SPEEDS[k, 1])
