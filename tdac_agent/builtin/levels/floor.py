"""Drives to a goal on a floor in metres, with a pose, a scan and wheels that err.

The robot keeps a pose of its own: the wheels move it, each scan is fitted to the map
that earlier scans have made, and the localiser, which errs more but never drifts,
slowly pulls it. Cells of the map count hits and passes, so that noise averages out. A
wave from the goal gives the time to it from every place; unseen floor costs a little
more. In each step, pairs of speed and turn are tried out over the next second, as fast
as the limits allow: the least time to the goal wins, and more distance from obstacles
is worth a little time.
"""

import json
import math

import numpy as np

with open("params.json") as file:
    PARAMS = json.load(file)
ROBOT, ERRORS = PARAMS["robot"], PARAMS["disturbances"]
RADIUS, AXLE, RANGE = ROBOT["radius"], ROBOT["axle_length"], ROBOT["range_max"]
NEAREST = ROBOT.get("range_min", 0.0)
AHEAD, ASIDE = ROBOT.get("scanner_offset", (0.0, 0.0))  # m of the scanner from here
NOISE = max(ERRORS["range_noise"], 0.002)
POSE_LATE, SCAN_LATE = ERRORS.get("pose_delay", 0), ERRORS.get("scan_delay", 0)
DT, TOLERANCE = PARAMS["dt"], PARAMS["goal_tolerance"]
FULL = ROBOT["max_wheel_speed"]  # m/s
SPEED = min(FULL, ROBOT.get("max_speed", FULL))
SPIN = min(2.0 * FULL / AXLE, ROBOT.get("max_turn_rate", math.inf))  # rad/s
SPIN_UP = ROBOT.get("max_turn_acceleration", math.inf)  # rad/s²
SPEED_UP = ROBOT.get("max_acceleration", math.inf)  # m/s²
ANGLES = np.array(ROBOT["ray_angles"])
STRIDE = max(ANGLES.size // 180, 1)  # of so many rays, one is fitted
CELL = min(max(RADIUS / 4.2, 0.02), 0.05)  # m
COARSE = 2  # cells of the map in a place of the search
REACH = math.ceil((RADIUS + 0.24) / CELL)  # cells up to which distances are known
SEEN = min(RANGE, 2.5)  # m up to which a scan goes into the map
HIT, PASS, LEAST, MOST, WALL = 0.5, 0.4, -2.5, 8.0, 0.7  # evidence of a cell
KEEP, WISH = 0.012, 0.07  # m that are kept from obstacles; that are wished for
FEAR = 6.0  # s that a metre less than the wish costs
UNSEEN = 0.25  # how much more unseen floor costs
STEPS = 8  # steps over which a course is tried out
RING, BEARINGS = 0.22, 24  # m, number of the places around an end that show the way
TURNING = 0.55  # s that a turn by a rad costs at the end of a course
ANCHOR, ANCHOR_TURN = 0.008, 0.012  # shares by which a pose of the localiser counts
LOST = 0.4  # m that the localiser is off after a jump
BEND_GAIN, MOST_BEND = 0.02, 0.02 / AXLE  # rad per m that unequal wheels turn
DRIFT = 0.0008, 0.0008, 0.004  # m, m, rad: error of a step of the wheels
REPLAN = 5  # steps between two waves
BAND = 0.05  # m of cost that a wave does at once
STATE = {}


class Grid:
    """The map: evidence of cells, the distance to walls, the cost to the goal.

    Attributes:
        half: Cells from the start to each side.
        evidence: Above WALL for a wall; shape (side, side), indexed [y, x].
        seen: Which cells a ray has crossed.
        away: Distance to the nearest wall, at most REACH cells, m.
        cost: Cost to the goal of every COARSE-th cell, m; inf if there is no way.
    """

    def __init__(self, goal):
        reach = max(abs(goal[0]), abs(goal[1])) + 5.0
        self.half = COARSE * math.ceil(reach / CELL / COARSE)
        self.side = 2 * self.half + 1
        shape = self.side, self.side
        self.evidence = np.zeros(shape, np.float32)
        self.seen = np.zeros(shape, bool)
        self.away = np.full(shape, REACH * CELL, np.float32)
        self.cost = np.full((self.half + 1, self.half + 1), np.inf)
        self.box = [self.half, self.half, self.half + 1, self.half + 1]

    def index(self, x, y):
        """Rows and columns of the cells of places."""
        i = np.rint(np.asarray(x) / CELL).astype(int) + self.half
        j = np.rint(np.asarray(y) / CELL).astype(int) + self.half
        last = self.side - 1
        return np.clip(j, 0, last), np.clip(i, 0, last)

    def add(self, pose, ranges):
        """Adds a scan that was taken at a pose."""
        x, y, heading = scanner_at(pose)
        good = (ranges > NEAREST) & (ranges > 0.0)
        reach, turn = ranges[good], heading + ANGLES[good]
        spread = np.maximum(1.0 * NOISE * reach, 0.7 * CELL)
        free = np.minimum(reach - spread, SEEN)
        along = np.arange(0.0, SEEN, 0.8 * CELL)
        ray, step = np.nonzero(along < free[:, None])
        cosine, sine = np.cos(turn), np.sin(turn)
        cells = self.index(x + along[step] * cosine[ray], y + along[step] * sine[ray])
        # Far rays tell less: they graze walls, and the heading errs.
        tells = (PASS * np.minimum(1.0, (0.8 / (along[step] + 0.1)) ** 2)).astype("f4")
        self.evidence[cells] = np.maximum(self.evidence[cells] - tells, LEAST)
        self.seen[cells] = True
        hit = reach < min(SEEN, RANGE - 0.02)
        reach, cosine, sine = reach[hit], cosine[hit], sine[hit]
        j, i = self.index(x + reach * cosine, y + reach * sine)
        weight = np.minimum(1.0, (CELL / (2.0 * NOISE * reach)) ** 2)
        near = weight > 0.15
        j, i, weight = j[near], i[near], weight[near]
        grown = (HIT + PASS) * weight
        np.add.at(self.evidence, (j, i), np.maximum(grown, 0.0).astype(np.float32))
        np.minimum(self.evidence, MOST, out=self.evidence)
        if cells[0].size:
            rows, columns = cells
            top, left, bottom, right = self.box
            self.box = [
                min(top, int(rows.min()) - 4),
                min(left, int(columns.min()) - 4),
                max(bottom, int(rows.max()) + 5),
                max(right, int(columns.max()) + 5),
            ]

    def measure(self):
        """Measures the distance of all cells to the nearest wall."""
        top, left, bottom, right = (min(max(edge, 0), self.side) for edge in self.box)
        walls = self.evidence[top:bottom, left:right] > WALL
        self.away[top:bottom, left:right] = CELL * distances(walls, REACH)

    def room(self, x, y):
        """Distance to the nearest wall, between the cells, m."""
        u, v = np.asarray(x) / CELL + self.half, np.asarray(y) / CELL + self.half
        last = self.side - 2
        i = np.clip(np.floor(u).astype(int), 0, last)
        j = np.clip(np.floor(v).astype(int), 0, last)
        a, b = np.clip(u - i, 0.0, 1.0), np.clip(v - j, 0.0, 1.0)
        flat, at = self.away.ravel(), j * self.side + i
        above = flat[at] * (1.0 - a) + flat[at + 1] * a
        below = flat[at + self.side] * (1.0 - a) + flat[at + self.side + 1] * a
        return above * (1.0 - b) + below * b

    def left(self, x, y):
        """Cost to the goal from places, between the places of the search, m."""
        size = CELL * COARSE
        u, v = np.asarray(x) / size, np.asarray(y) / size
        middle = self.half // COARSE
        last = self.cost.shape[0] - 2
        i = np.clip(np.floor(u).astype(int) + middle, 0, last)
        j = np.clip(np.floor(v).astype(int) + middle, 0, last)
        a, b = np.clip(u + middle - i, 0.0, 1.0), np.clip(v + middle - j, 0.0, 1.0)
        corners = np.stack(
            [
                self.cost[j, i],
                self.cost[j, i + 1],
                self.cost[j + 1, i],
                self.cost[j + 1, i + 1],
            ]
        )
        shares = np.stack([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b])
        shares = np.where(np.isfinite(corners), shares, 0.0)
        whole = shares.sum(axis=0)
        worth = (shares * np.where(np.isfinite(corners), corners, 0.0)).sum(axis=0)
        return np.where(whole > 0.25, worth / np.maximum(whole, 1e-9), np.inf)

    def plan(self, place, goal):
        """Finds the cost to the goal; with less room if there is no other way."""
        away = self.away[::COARSE, ::COARSE].astype(float)
        seen = self.seen[::COARSE, ::COARSE]
        middle = self.half // COARSE
        size = CELL * COARSE
        robot, target = (
            (round(y / size) + middle, round(x / size) + middle)
            for x, y in (place, goal)
        )
        for least in (RADIUS + KEEP, RADIUS - 0.5 * CELL, RADIUS - 1.5 * CELL):
            passable = away >= least
            for j, i in (robot, target):
                passable[j - 1 : j + 2, i - 1 : i + 2] = True
            passable[:3], passable[-3:] = False, False
            passable[:, :3], passable[:, -3:] = False, False
            room = np.clip((RADIUS + WISH + 0.05 - away) / (WISH + 0.05), 0.0, 1.0)
            price = 1.0 + 0.8 * room**2 + UNSEEN * ~seen
            self.cost, found = wave(passable, price, target, robot, size)
            if found:
                return True
        return False


def distances(walls, reach):
    """Distance from each cell to the nearest wall, at most reach, cells.

    Hits lie on the surface, so it is that to the centre of the cell.
    """
    far = float(reach * reach)
    down = np.full(walls.shape, far, np.float32)
    for k in range(reach + 1):
        own = np.float32(k * k)
        if k == 0:
            down[walls] = own
            continue
        for to, of in (
            (slice(k, None), slice(None, -k)),
            (slice(None, -k), slice(k, None)),
        ):
            part = down[to]
            part[walls[of] & (part > own)] = own
    best = down.copy()
    for k in range(1, reach + 1):
        own = np.float32(k * k)
        np.minimum(best[:, k:], down[:, :-k] + own, out=best[:, k:])
        np.minimum(best[:, :-k], down[:, k:] + own, out=best[:, :-k])
    return np.sqrt(np.minimum(best, far))


def moves(width, size):
    """Shifts, lengths, and both places that are passed, of moves in 16 directions."""
    found = []
    for dx in range(-2, 3):
        for dy in range(-2, 3):
            if math.gcd(dx, dy) != 1:
                continue
            shift, over = dy * width + dx, (0, 0)
            if max(abs(dx), abs(dy)) == 2:
                sx, sy = (dx > 0) - (dx < 0), (dy > 0) - (dy < 0)
                straight = sx if abs(dx) == 2 else sy * width
                over = straight, sy * width + sx
            found.append((shift, size * math.hypot(dx, dy), *over))
    return (np.array(each) for each in zip(*found, strict=True))


def wave(passable, price, goal, robot, size):
    """Costs to the goal over places, in bands; until some way beyond the robot.

    Also returns whether the robot was reached.
    """
    width = passable.shape[1]
    shifts, lengths, first, second = moves(width, size)
    free, price = passable.ravel(), np.where(passable, price, np.inf).ravel()
    cost = np.full(free.shape, np.inf)
    start, target = goal[0] * width + goal[1], robot[0] * width + robot[1]
    cost[start], until = 0.0, math.inf
    bands, band = {0: [np.array([start])]}, 0
    while bands and band * BAND < until:
        parts = bands.pop(band, None)
        band += 1
        if parts is None:
            continue
        at = np.unique(np.concatenate(parts))
        at = at[cost[at] >= (band - 1) * BAND]
        to = at[:, None] + shifts
        further = cost[at][:, None] + 0.5 * lengths * (price[at][:, None] + price[to])
        some, move = np.nonzero(further < cost[to])
        fits = free[at[some] + first[move]] & free[at[some] + second[move]]
        some, move = some[fits], move[fits]
        if not some.size:
            continue
        to, further = to[some, move], further[some, move]
        np.minimum.at(cost, to, further)
        where = (further / BAND).astype(int)
        for k in range(int(where.min()), int(where.max()) + 1):
            part = to[where == k]
            if part.size:
                bands.setdefault(k, []).append(part)
        if until == math.inf and cost[target] < math.inf:
            until = float(cost[target]) + 1.5
    return cost.reshape(-1, width), until < math.inf


def scanner_at(pose):
    """Where the scanner is, and its heading."""
    x, y, heading = pose
    cosine, sine = math.cos(heading), math.sin(heading)
    return x + cosine * AHEAD - sine * ASIDE, y + sine * AHEAD + cosine * ASIDE, heading


def moved(pose, left, right):
    """The pose after a step with these fractions of the full wheel speed."""
    x, y, heading = pose
    arc = 0.5 * (left + right) * FULL * DT
    turn = (right - left) * FULL * DT / AXLE + STATE["bend"] * arc
    half = 0.5 * turn
    chord = arc * float(np.sinc(half / math.pi))
    x += chord * math.cos(heading + half)
    y += chord * math.sin(heading + half)
    return x, y, heading + turn


def relative(pose, base):
    """A pose in the frame of another."""
    dx, dy = pose[0] - base[0], pose[1] - base[1]
    cosine, sine = math.cos(base[2]), math.sin(base[2])
    return cosine * dx + sine * dy, cosine * dy - sine * dx, pose[2] - base[2]


def placed(pose, base):
    """The inverse of `relative`."""
    cosine, sine = math.cos(base[2]), math.sin(base[2])
    x, y = cosine * pose[0] - sine * pose[1], sine * pose[0] + cosine * pose[1]
    return base[0] + x, base[1] + y, base[2] + pose[2]


def fitted(grid, pose, ranges):
    """The pose from which a scan fits the map best, near the given one."""
    some = slice(None, None, STRIDE)
    reach, angle = ranges[some], ANGLES[some]
    good = (reach > max(NEAREST, 0.01)) & (reach < min(SEEN, RANGE - 0.02))
    reach, angle = reach[good], angle[good]
    if reach.size < 12:
        return pose
    far, trust = REACH * CELL, 1.0 / (0.02 + NOISE * reach) ** 2
    px = AHEAD + reach * np.cos(angle)
    py = ASIDE + reach * np.sin(angle)
    x, y, heading = pose
    prior = 1.0 / np.array(DRIFT) ** 2
    step = 0.5 * CELL
    for _ in range(4):
        cosine, sine = math.cos(heading), math.sin(heading)
        u, v = cosine * px - sine * py, sine * px + cosine * py
        gap = grid.room(x + u, y + v)
        along = grid.room(x + u + step, y + v) - grid.room(x + u - step, y + v)
        across = grid.room(x + u, y + v + step) - grid.room(x + u, y + v - step)
        known = gap < min(0.15, far - CELL)
        if known.sum() < 12:
            return pose
        slopes = np.stack([along, across, across * u - along * v]) / (2.0 * step)
        weight = known * trust / (1.0 + (gap / 0.04) ** 2)
        matrix = (slopes * weight) @ slopes.T
        off = np.array([x - pose[0], y - pose[1], heading - pose[2]])
        right = -(slopes * weight) @ gap - prior * off
        change = np.linalg.solve(matrix + np.diag(prior), right)
        x, y, heading = x + change[0], y + change[1], heading + change[2]
        if abs(change[2]) < 2e-4 and max(abs(change[:2])) < 2e-4:
            break
    if math.hypot(x - pose[0], y - pose[1]) > 0.03 or abs(heading - pose[2]) > 0.03:
        return pose
    return float(x), float(y), float(heading)


def reset(obs):  # noqa: ARG001
    """Forgets everything."""
    STATE.clear()
    STATE.update(grid=None, poses=[(0.0, 0.0, 0.0)], age=REPLAN, step=0, still=0)
    STATE.update(bend=0.0)


def locate(obs, ranges):
    """The present pose on the map, and the goal there; adds the scan to the map."""
    grid, poses = STATE["grid"], STATE["poses"]
    left, right = (float(value) for value in obs["wheel_speeds"])
    if STATE["step"]:
        poses.append(moved(poses[-1], left, right))
    late = max(len(poses) - 1 - SCAN_LATE, 0)
    if STATE["step"] >= SCAN_LATE:
        at = poses[late]
        better = fitted(grid, at, ranges) if STATE["step"] > SCAN_LATE + 1 else at
        learn(left, right, better[2] - at[2])
        poses[late:] = [placed(relative(each, at), better) for each in poses[late:]]
        grid.add(poses[late], ranges)
    keep = max(POSE_LATE, SCAN_LATE) + 2
    STATE["poses"] = poses = poses[-keep:]
    told = tuple(float(value) for value in obs["pose"])
    if STATE["step"] >= POSE_LATE:
        anchor(told, poses)
    STATE["step"] += 1
    return poses[-1], [float(value) for value in obs["goal"]]


def learn(left, right, turn):
    """Takes the turn by which the scan did not fit as that of unequal wheels."""
    arc = 0.5 * (left + right) * FULL * DT
    if abs(arc) > 0.3 * SPEED * DT:
        bend = STATE["bend"] + BEND_GAIN * turn / arc
        STATE["bend"] = min(max(bend, -MOST_BEND), MOST_BEND)


def anchor(told, poses):
    """Moves the last poses a little towards what the localiser says."""
    own = poses[max(len(poses) - 1 - POSE_LATE, 0)]
    turn = math.remainder(told[2] - own[2], 2.0 * math.pi)
    dx, dy = told[0] - own[0], told[1] - own[1]
    share = 1.0 if math.hypot(dx, dy) < LOST else 0.05  # a jump, which decays
    better = (
        own[0] + share * ANCHOR * dx,
        own[1] + share * ANCHOR * dy,
        own[2] + ANCHOR_TURN * turn,
    )
    poses[:] = [placed(relative(each, own), better) for each in poses]


def courses(speed, spin):
    """Commands to try, and x, y, heading after each of STEPS steps from the origin."""
    wanted = [
        (forward * SPEED, turn * SPIN)
        for forward in (-0.4, 0.0, 0.35, 0.7, 1.0)
        for turn in np.linspace(-1.0, 1.0, 25) ** 3
    ]
    wanted = np.array(wanted)
    # No wheel is faster than it can be: turns are kept, and speed is given up.
    most = np.maximum(FULL - 0.5 * AXLE * np.abs(wanted[:, 1]), 0.0)
    wanted[:, 0] = np.clip(wanted[:, 0], -most, most)
    v, w = np.full(len(wanted), speed), np.full(len(wanted), spin)
    x, y, heading = np.zeros((3, len(wanted)))
    parts = []
    for _ in range(STEPS):
        w = w + np.clip(wanted[:, 1] - w, -SPIN_UP * DT, SPIN_UP * DT)
        v = v + np.clip(wanted[:, 0] - v, -SPEED_UP * DT, SPEED_UP * DT)
        half = 0.5 * w * DT
        chord = v * DT * np.sinc(half / math.pi)
        x, y = x + chord * np.cos(heading + half), y + chord * np.sin(heading + half)
        heading = heading + 2.0 * half
        parts.append((x, y, heading, w))
    return wanted, np.array(parts).transpose(1, 2, 0)


def room_of_scan(points, x, y):
    """Distance from places to the nearest of some points, m."""
    if not points.size:
        return np.full(x.shape, np.inf)
    dx = x.reshape(-1, 1) - points[0]
    dy = y.reshape(-1, 1) - points[1]
    return np.sqrt((dx * dx + dy * dy).min(axis=1)).reshape(x.shape)


def near_points(pose, ranges):
    """Points that the scan has hit near the robot, on the map."""
    late = STATE["poses"][max(len(STATE["poses"]) - 1 - SCAN_LATE, 0)]
    x, y, heading = scanner_at(late)
    near = (ranges > NEAREST) & (ranges < 0.7)
    reach, turn = ranges[near], heading + ANGLES[near]
    points = np.stack([x + reach * np.cos(turn), y + reach * np.sin(turn)])
    apart = np.hypot(points[0] - pose[0], points[1] - pose[1])
    return points[:, apart < RADIUS + 0.4][:, ::2]


def best_course(grid, pose, goal, ranges):
    """The pair (speed, turn) that reaches the goal soonest, or None."""
    left, right = STATE["wheels"]
    speed, spin = 0.5 * (left + right) * FULL, (right - left) * FULL / AXLE
    wanted, (ahead, aside, facing, spins) = courses(speed, spin)
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    x = pose[0] + cosine * ahead - sine * aside
    y = pose[1] + sine * ahead + cosine * aside
    points = near_points(pose, ranges)
    room = np.minimum(grid.room(x, y), room_of_scan(points, x, y)) - RADIUS
    now = float(min(grid.room(pose[0], pose[1]), 9.0)) - RADIUS
    least = min(KEEP, max(now - 0.002, -0.02))
    fits = (room >= least).all(axis=1)
    if not fits.any():
        return None
    near = np.hypot(x - goal[0], y - goal[1]) <= 0.8 * TOLERANCE
    arrives = np.where(near.any(axis=1), near.argmax(axis=1), STEPS + 9)
    to_go = grid.left(x[:, -1], y[:, -1])
    time = DT * STEPS + to_go / SPEED
    heading = pose[2] + facing[:, -1]
    time += TURNING * turn_left(grid, x[:, -1], y[:, -1], heading, goal)
    time = np.where(near.any(axis=1), DT * arrives - 5.0, time)
    close = np.clip(WISH - room, 0.0, None)
    time += FEAR * close.mean(axis=1) + 0.5 * FEAR * close.max(axis=1)
    time += 0.02 * np.abs(spins[:, -1] - spin) + 0.3 * (wanted[:, 0] < 0.0)
    slow = np.abs(wanted[:, 0]) < 0.1 * SPEED
    if STATE["still"] <= 10:
        slow &= np.abs(wanted[:, 1]) < 0.1 * SPIN
    time += (0.5 + 0.05 * max(STATE["still"] - 10, 0)) * slow
    time = np.where(fits, time, np.inf)
    k = int(time.argmin())
    return wanted[k] if math.isfinite(time[k]) else None


def turn_left(grid, x, y, heading, goal):
    """The turn into the way to the goal that is still to come, rad."""
    angles = np.arange(BEARINGS) * (2.0 * math.pi / BEARINGS)
    ring_x = x[:, None] + RING * np.cos(angles)
    ring_y = y[:, None] + RING * np.sin(angles)
    cost = grid.left(ring_x, ring_y)
    middle = np.minimum(
        grid.room(
            x[:, None] + 0.5 * RING * np.cos(angles),
            y[:, None] + 0.5 * RING * np.sin(angles),
        ),
        grid.room(ring_x, ring_y),
    )
    cost = np.where(middle >= RADIUS, cost, cost + 0.5)
    cost = np.where(np.isfinite(cost), cost, 1e3)
    k = cost.argmin(axis=1)
    row = np.arange(len(k))
    before, at, after = cost[row, k - 1], cost[row, k], cost[row, (k + 1) % BEARINGS]
    bend = np.clip(before - at, 0.0, 0.1) + np.clip(after - at, 0.0, 0.1) + 1e-9
    shift = (
        0.5 * (np.clip(before - at, 0.0, 0.1) - np.clip(after - at, 0.0, 0.1)) / bend
    )
    bearing = (k + shift) * (2.0 * math.pi / BEARINGS)
    direct = np.arctan2(goal[1] - y, goal[0] - x)
    near = np.hypot(goal[0] - x, goal[1] - y) < RING
    bearing = np.where(near, direct, bearing)
    return np.abs(np.remainder(bearing - heading + math.pi, 2.0 * math.pi) - math.pi)


def escape(grid, pose, ranges):
    """A slow pair that leads away from what is near."""
    left, right = STATE["wheels"]
    speed, spin = 0.5 * (left + right) * FULL, (right - left) * FULL / AXLE
    wanted, (ahead, aside, _, _) = courses(speed, spin)
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    x = pose[0] + cosine * ahead - sine * aside
    y = pose[1] + sine * ahead + cosine * aside
    points = near_points(pose, ranges)
    room = np.minimum(grid.room(x, y), room_of_scan(points, x, y))
    worth = room.min(axis=1) + 0.5 * room[:, -1] - 0.01 * (np.abs(wanted[:, 0]) > 0.15)
    return wanted[int(worth.argmax())]


def policy(obs):
    """Wheel speeds (left, right)."""
    ranges = np.asarray(obs["ranges"], float)
    if STATE["grid"] is None:
        STATE["grid"] = Grid([float(value) for value in obs["goal"]])
    grid = STATE["grid"]
    pose, goal = locate(obs, ranges)
    STATE["wheels"] = tuple(float(value) for value in obs["wheel_speeds"])
    STATE["age"] += 1
    is_still = abs(sum(STATE["wheels"])) < 0.1
    STATE["still"] = STATE["still"] + 1 if is_still else max(STATE["still"] - 3, 0)
    if STATE["age"] % 2 == 0 or STATE["step"] < 4:
        grid.measure()
    if STATE["age"] >= REPLAN:
        grid.plan(pose[:2], goal)
        STATE["age"] = 0
    best = best_course(grid, pose, goal, ranges)
    if best is None:
        best = escape(grid, pose, ranges)
    speed, spin = float(best[0]), float(best[1])
    half = 0.5 * AXLE * spin
    return (
        min(max((speed - half) / FULL, -1.0), 1.0),
        min(max((speed + half) / FULL, -1.0), 1.0),
    )
