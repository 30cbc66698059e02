"""Optimal reciprocal collision avoidance (ORCA) on a grid with a navigation function.

J. van den Berg, S. J. Guy, M. Lin and D. Manocha, "Reciprocal n-body collision
avoidance", Robotics Research (ISRR 2009), Springer 2011.

Discs are found in successive scans as groups of hits on a circle, and their velocities
from their places; all other hits are walls, marked and cleared in an obstacle layer
over the map if one is given. Dijkstra's costs of the way to the goal over it give the
preferred velocity. Each disc and each piece of wall nearby forbids a half-plane of
velocities; the one nearest to the preferred velocity is chosen from a fine set. The
robot turns to it, forwards or backwards, and drives as far as the walls allow in its
present direction. If it gets no further, it clears the obstacle layer and turns on the
spot.
"""

import json
import math

import numpy as np

with open("params.json") as file:
    PARAMS = json.load(file)
ROBOT = PARAMS["robot"]
RADIUS, AXLE, RANGE = ROBOT["radius"], ROBOT["axle_length"], ROBOT["range_max"]
SPEED, DT = ROBOT["max_wheel_speed"], PARAMS["dt"]
RAYS = ROBOT["n_rays"]
VIEW = math.radians(ROBOT["field_of_view_deg"])
FAN = np.linspace(-VIEW / 2.0, VIEW / 2.0, RAYS)

HORIZON = 2.0
"""Time for which a velocity must not lead into a disc, s."""
WALL_HORIZON = 0.4
"""Time for which a velocity must not lead into a wall, s."""
SHARE = 1.0
"""Part of avoiding that the robot takes on; 0.5 if the others do the same."""
ROOM = 1.5
"""Room that is kept to discs, px."""
MARGIN = 0.5
"""Room that is kept to walls, px."""
TURN_GAIN = 0.8
"""Part of the angle to the chosen velocity that is turned in a step."""
LOOKAHEAD = 16.0
"""Distance of the way-point along the planned way, px."""
INFLATION = 1.0
"""How much more the way costs beside an obstacle, as a factor."""
SMOOTH = 0.6
"""Weight of the newest measurement of a disc's velocity."""

FREE = 6.0
"""Clearance beyond the body from which obstacles cost the way nothing, px."""
JUMP = 6.0
"""Distance of neighbouring hits that belong to different things, px."""
LARGEST = 10.0
"""Largest radius of a disc, px."""
GATE = 6.0
"""Distance within which a disc is taken for the one that was expected there, px."""
LOST = 10
"""Steps after which a disc that is not seen is forgotten."""
SLOWEST = 4.0
"""Speed from which a disc is not taken for a part of the walls, px/s."""
NEAR = 60.0
"""Distance up to which walls restrict the velocity, px."""
MEMORY = 1000.0
"""Time after which a hit is forgotten, s; looked at after each plan."""

SLACK = 0.5
"""By how much the plan may come too near to obstacles, px."""
THIN = 0.3
"""Hits nearer than this to known obstacles are not added, px."""
CLEAR = 4.0
"""A hit is cleared if the rays beside it go further by so much, px."""
CELL = 2
"""Pitch of the plan, px."""
REPLAN = 5
"""Steps between plans while the obstacles change."""
STUCK = 25
"""Steps within 3 px after which the robot recovers."""
REACH = int(RADIUS + 8.0)
"""Distance up to which clearances are known, px."""

AROUND = np.arange(-REACH, REACH + 1, dtype=np.float32)
FAR = np.float32(REACH * REACH)
TO_GO = 1e6  # px; stands for "no way"


class Odometer:
    """The pose: observed, or from dead reckoning."""

    def __init__(self):
        self.x = self.y = self.heading = 0.0

    def update(self, obs):
        """Takes over an observation."""
        if "pose" in obs:
            self.x, self.y, self.heading = (float(value) for value in obs["pose"])
        else:
            self.move(*(float(value) for value in obs["odometry"]))

    def move(self, length, turn):
        """Drives an arc."""
        self.x += length * math.cos(self.heading + turn / 2.0)
        self.y += length * math.sin(self.heading + turn / 2.0)
        self.heading = math.remainder(self.heading + turn, math.tau)


class Grid:
    """Squared distances to obstacles at each px, and the navigation function."""

    def __init__(self, x, y, goal):
        self.goal = goal
        half = int(max(440.0, abs(goal[0] - x) + 80.0, abs(goal[1] - y) + 80.0))
        self.side = 2 * half + 1
        self.left, self.top = round(x) - half, round(y) - half
        self.base = np.full((self.side, self.side), FAR)
        self.corners = np.zeros((0, 2))  # of the map
        if PARAMS["map"]:
            self.base[:] = 0.0
            cells = map_distances(np.load("occupancy.npy"))
            self.corners = np.array([(0.0, 0.0), cells.shape[::-1]])
            rows, columns = np.arange(cells.shape[0]), np.arange(cells.shape[1])
            rows, columns = rows - self.top, columns - self.left
            fits = [(k >= 0) & (k < self.side) for k in (rows, columns)]
            self.base[np.ix_(rows[fits[0]], columns[fits[1]])] = cells[np.ix_(*fits)]
        self.near = self.base.copy()
        self.points = np.zeros((0, 3))
        self.costs = np.full(((self.side + 1) // CELL,) * 2, TO_GO)
        self.age, self.changed = REPLAN, True

    def box(self, left, top, right, bottom):
        """Slices of the px around places, up to REACH."""
        columns = slice(
            max(int(left) - self.left - REACH, 0),
            max(int(right) - self.left + REACH + 2, 0),
        )
        rows = slice(
            max(int(top) - self.top - REACH, 0),
            max(int(bottom) - self.top + REACH + 2, 0),
        )
        return rows, columns

    def stamp(self, x, y):
        """Lowers the distances around a hit."""
        i, j = round(x) - self.left, round(y) - self.top
        if min(i, j) < REACH or max(i, j) >= self.side - REACH:
            return
        part = self.near[j - REACH : j + REACH + 1, i - REACH : i + REACH + 1]
        dx, dy = AROUND + (i + self.left - x), AROUND + (j + self.top - y)
        found = (dy * dy)[:, None] + (dx * dx)[None, :]
        np.minimum(part, found, out=part)

    def remove(self, gone):
        """Forgets some of the hits."""
        places = self.points[gone, :2]
        self.points = self.points[~gone]
        left, top = places.min(axis=0)
        right, bottom = places.max(axis=0)
        rows, columns = self.box(left, top, right, bottom)
        self.near[rows, columns] = self.base[rows, columns]
        x, y = self.points[:, 0], self.points[:, 1]
        wide = 2 * REACH + 2
        affected = (x > left - wide) & (x < right + wide)
        affected &= (y > top - wide) & (y < bottom + wide)
        for a, b, _ in self.points[affected].tolist():
            self.stamp(a, b)
        self.changed = True

    def scan(self, x, y, heading, ranges, hit, now):
        """Clears what the rays pass, and marks some of what they hit."""
        if len(self.points):
            dx, dy = self.points[:, 0] - x, self.points[:, 1] - y
            off = np.remainder(np.arctan2(dy, dx) - heading + math.pi, math.tau)
            ray = np.floor((off - math.pi + VIEW / 2.0) / VIEW * (RAYS - 1)).astype(int)
            inside = (ray >= 0) & (ray < RAYS - 1)
            ray = np.clip(ray, 0, RAYS - 2)
            free = np.minimum(ranges[ray], ranges[ray + 1])
            gone = inside & (np.hypot(dx, dy) < np.minimum(free - CLEAR, RANGE / 2.0))
            if self.age == 0:
                gone |= now - self.points[:, 2] > MEMORY
            if gone.any():
                self.remove(gone)
        ends = np.column_stack(
            [
                x + ranges[hit] * np.cos(heading + FAN[hit]),
                y + ranges[hit] * np.sin(heading + FAN[hit]),
            ]
        )
        new = []
        for a, b in ends[self.clearance(ends[:, 0], ends[:, 1]) > THIN].tolist():
            if self.near[self.entry(a, b)] > THIN * THIN:
                self.stamp(a, b)
                new.append((a, b, now))
        if new:
            self.points = np.vstack([self.points, new])
            self.changed = True

    def entry(self, x, y):
        """Row and column of the px at a place."""
        most = self.side - 1
        return (
            min(max(round(y) - self.top, 0), most),
            min(max(round(x) - self.left, 0), most),
        )

    def entries(self, x, y):
        """Rows and columns of the px at places."""
        most = self.side - 1
        return (
            np.clip(np.rint(y).astype(int) - self.top, 0, most),
            np.clip(np.rint(x).astype(int) - self.left, 0, most),
        )

    def clearance(self, x, y):
        """Distances of places to the nearest obstacle, px."""
        u = np.clip(x - self.left, 0.0, self.side - 1.01)
        v = np.clip(y - self.top, 0.0, self.side - 1.01)
        i, j = u.astype(np.int32), v.astype(np.int32)
        u, v, at, flat = u - i, v - j, j * self.side + i, self.near.ravel()
        upper = flat[at] * (1.0 - u) + flat[at + 1] * u
        at = at + self.side
        lower = flat[at] * (1.0 - u) + flat[at + 1] * u
        return np.sqrt(upper * (1.0 - v) + lower * v)

    def to_go(self, x, y):
        """Costs of the way to the goal from places, px."""
        wide = self.costs.shape[1]
        u = np.clip((x - self.left) / CELL, 0.0, wide - 1.01)
        v = np.clip((y - self.top) / CELL, 0.0, wide - 1.01)
        i, j = u.astype(np.int32), v.astype(np.int32)
        u, v, at, flat = u - i, v - j, j * wide + i, self.costs.ravel()
        found = flat[at] + CELL * np.hypot(u, v)
        for shift, a, b in ((1, 1, 0), (wide, 0, 1), (wide + 1, 1, 1)):
            other = flat[at + shift] + CELL * np.hypot(u - a, v - b)
            found = np.minimum(found, other)
        return found

    def replan(self, x, y):
        """Renews the navigation function if the obstacles have changed."""
        self.age += 1
        if self.changed and self.age >= REPLAN:
            self.age, self.changed = 0, False
            self.plan(x, y)

    def plan(self, x, y):
        """Dijkstra's algorithm from the goal, up to somewhat beyond the robot.

        Places are taken in bands of equal cost. No move is shorter than a band is
        wide, so each band is final when its turn comes.
        """
        places = np.vstack([self.points[:, :2], self.corners, [(x, y), self.goal]])
        low = (places.min(axis=0) - (self.left, self.top) - 40.0) // CELL
        high = (places.max(axis=0) - (self.left, self.top) + 40.0) // CELL
        left, top = (int(value) for value in np.maximum(low, 1))
        right, bottom = (int(v) for v in np.minimum(high, len(self.costs) - 2))
        room = np.sqrt(self.near[::CELL, ::CELL][top:bottom, left:right]) - RADIUS
        price = 1.0 + INFLATION * np.clip(1.0 - room / FREE, 0.0, 1.0) ** 2
        price[room < -SLACK] = np.inf
        price[[0, -1], :], price[:, [0, -1]] = np.inf, np.inf
        wide, price = price.shape[1], price.ravel()
        start, robot = (
            (round((b - self.top) / CELL) - top) * wide
            + round((a - self.left) / CELL)
            - left
            for a, b in (self.goal, (x, y))
        )
        shifts = np.array([1, -1, wide, -wide, wide + 1, wide - 1, 1 - wide, -1 - wide])
        halves = CELL / 2.0 * np.repeat([1.0, math.sqrt(2.0)], 4)
        near = [robot + a + b * wide for a in (-1, 0, 1) for b in (-1, 0, 1)]
        cost = np.full(price.shape, np.inf)
        cost[start], price[start] = 0.0, 1.0
        bands, band, last = {0: [np.array([start])]}, 0, math.inf
        while bands and band * CELL < last:
            parts = bands.pop(band, None)
            band += 1
            if parts is None:
                continue
            at = np.unique(np.concatenate(parts))
            at = at[cost[at] >= (band - 1) * CELL]
            to = at[:, None] + shifts
            further = cost[at][:, None] + halves * (price[at][:, None] + price[to])
            better = further < cost[to]
            to, further = to[better], further[better]
            if not to.size:
                continue
            np.minimum.at(cost, to, further)
            number = (further / CELL).astype(int)
            for k in range(int(number.min()), int(number.max()) + 1):
                some = to[number == k]
                if some.size:
                    bands.setdefault(k, []).append(some)
            if last == math.inf and np.isfinite(cost[near]).any():
                last = float(cost[near].min()) + 60.0
        self.costs[:] = TO_GO
        cost[~np.isfinite(cost)] = TO_GO
        self.costs[top:bottom, left:right] = cost.reshape(-1, wide)

    def way_point(self, x, y, distance):
        """The place so far along the planned way."""
        wide, flat = self.costs.shape[1], self.costs.ravel()
        i, j = round((x - self.left) / CELL), round((y - self.top) / CELL)
        around = [(a, b) for a in range(-2, 3) for b in range(-2, 3) if a or b]
        shifts = np.array([b * wide + a for a, b in around])
        lengths = CELL * np.array([math.hypot(a, b) for a, b in around])
        at, left = j * wide + i, distance
        while left > 0.0:
            k = int((flat[at + shifts] + lengths).argmin())
            if flat[at + shifts[k]] >= flat[at]:
                break
            at += int(shifts[k])
            left -= lengths[k]
        j, i = divmod(at, wide)
        if flat[at] < 2.0 * CELL:
            return self.goal
        return i * CELL + self.left, j * CELL + self.top


def map_distances(cells):
    """Squared distances of the px of a map to the nearest occupied px."""
    found = np.where(np.pad(cells, REACH, constant_values=True), np.float32(0.0), FAR)
    for _ in range(2):  # first along the rows, then along the columns
        wide = found.shape[1] - 2 * REACH
        best = found[:, REACH : REACH + wide].copy()
        for d in range(-REACH, REACH + 1):
            gap = max(abs(d) - 0.5, 0.0) ** 2
            other = found[:, REACH + d : REACH + d + wide] + np.float32(gap)
            np.minimum(best, other, out=best)
        found = np.ascontiguousarray(best.T)
    return found


def velocities():
    """Velocities among which one is chosen: x and y, as shares of the full speed."""
    speeds, angles = np.linspace(0.1, 1.0, 10), np.arange(72) * (math.tau / 72.0)
    found = speeds[:, None, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.vstack([[(0.0, 0.0)], found.reshape(-1, 2)])


CHOICE = SPEED * velocities()
STATE = {}


class Disc:
    """A disc that was seen, with its velocity."""

    def __init__(self, place, radius):
        self.place, self.radius = np.array(place), radius
        self.velocity, self.seen, self.unseen = np.zeros(2), 1, 0

    def expected(self):
        """The place after the steps since it was last seen."""
        return self.place + self.velocity * DT * (self.unseen + 1)

    def moves(self):
        """Whether it may be more than a part of the walls."""
        return self.seen < 3 or math.hypot(*self.velocity) > SLOWEST

    def update(self, place, radius):
        """Takes over a new place."""
        measured = (np.array(place) - self.place) / (DT * (self.unseen + 1))
        weight = SMOOTH if self.seen > 1 else 1.0
        self.velocity = self.velocity + weight * (measured - self.velocity)
        self.place, self.radius = np.array(place), radius
        self.seen, self.unseen = self.seen + 1, 0


def groups(x, y, hit):
    """Groups of neighbouring hits: lists of the numbers of rays."""
    found, before = [], None
    for k in np.flatnonzero(hit).tolist():
        if before == k - 1 and math.hypot(x[k] - x[k - 1], y[k] - y[k - 1]) < JUMP:
            found[-1].append(k)
        else:
            found.append([k])
        before = k
    return found


def circle(x, y, from_x, from_y):
    """Centre and radius of the disc that hits may be of; None if they are not."""
    if len(x) < 3 or math.hypot(x[-1] - x[0], y[-1] - y[0]) > 2.0 * LARGEST:
        return None
    matrix = np.column_stack([2.0 * x, 2.0 * y, np.ones(len(x))])
    (a, b, c), *_ = np.linalg.lstsq(matrix, x * x + y * y, rcond=None)
    radius = math.sqrt(max(c + a * a + b * b, 0.0))
    off = np.abs(np.hypot(x - a, y - b) - radius).max()
    nearest = np.hypot(x - from_x, y - from_y).min()
    if math.hypot(a - from_x, b - from_y) < nearest or off > 0.5:
        return None
    return ((float(a), float(b)), radius) if 3.0 < radius < LARGEST else None


def hidden(free, x, y):
    """The disc whose few visible hits these may be, from where it is expected."""
    for disc in free:
        a, b = disc.expected()
        if len(x) < 3 and np.hypot(x - a, y - b).max() < disc.radius + GATE:
            return disc
    return None


def track(grid, pose, ranges):
    """Renews the discs; returns which rays hit walls."""
    hit = ranges < RANGE - 1e-3
    x = pose.x + ranges * np.cos(pose.heading + FAN)
    y = pose.y + ranges * np.sin(pose.heading + FAN)
    walls = hit.copy()
    hit &= np.sqrt(grid.base[grid.entries(x, y)]) > 2.5
    discs, free = STATE["discs"], list(STATE["discs"])
    for group in sorted(groups(x, y, hit), key=len, reverse=True):
        found = circle(x[group], y[group], pose.x, pose.y)
        gaps = [math.dist(found[0], disc.expected()) for disc in free] if found else []
        if gaps and min(gaps) < GATE:
            disc = free.pop(gaps.index(min(gaps)))
            disc.update(*found)
        elif found:
            disc = Disc(*found)
            discs.append(disc)
        else:
            disc = hidden(free, x[group], y[group])
        walls[group] &= disc is None or not disc.moves()
    for disc in free:
        disc.unseen += 1
    STATE["discs"] = [disc for disc in discs if disc.unseen < LOST]
    return walls


def disc_plane(place, velocity, radius, own):
    """The half-plane (normal, least value along it) that a disc leaves.

    The place is relative to the robot, and the radius that of both together.
    """
    relative, far = own - velocity, math.hypot(*place)
    if far <= radius:  # leave it within a step
        middle, cut = place / DT, radius / DT
    else:
        middle, cut = place / HORIZON, radius / HORIZON
        from_cut = relative - middle
        along = float(from_cut @ place)
        if along > 0.0 or along**2 <= radius**2 * float(from_cut @ from_cut):
            # The nearest side of the cone.
            leg = math.sqrt(far * far - radius * radius)
            side = 1.0 if place[0] * from_cut[1] > place[1] * from_cut[0] else -1.0
            ahead = (
                np.array(
                    [
                        place[0] * leg - side * place[1] * radius,
                        side * place[0] * radius + place[1] * leg,
                    ]
                )
                / far**2
            )
            normal = side * np.array([-ahead[1], ahead[0]])
            change = -float(relative @ normal)
            return normal, float(own @ normal) + SHARE * change
    from_cut = relative - middle
    long = max(math.hypot(*from_cut), 1e-9)
    normal = from_cut / long
    return normal, float(own @ normal) + SHARE * (cut - long)


def half_planes(pose, ranges, walls, own):
    """Normals and least values along them: those of walls, then those of discs."""
    k = np.flatnonzero(walls & (ranges < NEAR))
    angles = pose.heading + FAN[k]
    normals = -np.column_stack([np.cos(angles), np.sin(angles)])
    room = ranges[k] - RADIUS - MARGIN
    least = -np.maximum(room, 0.0) / WALL_HORIZON
    count, here = len(k), np.array([pose.x, pose.y])
    for disc in STATE["discs"]:
        if not disc.moves():
            continue
        place = disc.place + disc.velocity * DT * disc.unseen - here
        radius = RADIUS + disc.radius + ROOM
        normal, value = disc_plane(place, disc.velocity, radius, own)
        normals, least = np.vstack([normals, normal]), np.append(least, value)
    return normals, least, count


def chosen(preferred, normals, least, count):
    """The allowed velocity nearest to the preferred one.

    If there is none, the one that enters the half-planes of discs least.
    """
    found = np.vstack([CHOICE, [preferred]])
    if len(least):
        lacking = least - normals @ preferred
        found = np.vstack([found, preferred + lacking[:, None] * normals])
        found = found[np.hypot(found[:, 0], found[:, 1]) <= SPEED + 1e-6]
        missing = least[:, None] - normals @ found.T
        walls = missing[:count].max(axis=0, initial=-np.inf) <= 1e-6
        worst = missing[count:].max(axis=0, initial=-np.inf)
        allowed = walls & (worst <= 1e-6)
        if not allowed.any():
            return found[int(np.where(walls, worst, np.inf).argmin())]
        found = found[allowed]
    return found[int(((found - preferred) ** 2).sum(axis=1).argmin())]


def recovers(grid, pose):
    """Whether the robot turns on the spot, since it got no further."""
    trail = STATE["trail"] = [*STATE["trail"][-4 * STUCK :], (pose.x, pose.y)]
    if len(trail) > 4 * STUCK and np.ptp(trail, axis=0).max() < 3.0:
        STATE["trail"], STATE["turns"] = [], math.ceil(math.pi * AXLE / SPEED / DT)
        if len(grid.points):
            grid.remove(np.ones(len(grid.points), bool))
    STATE["turns"] -= 1
    return STATE["turns"] >= 0


def reset(obs):
    """Begins an episode."""
    pose = Odometer()
    pose.update(obs)
    goal = tuple(float(value) for value in obs["goal"])
    STATE.update(pose=pose, grid=Grid(pose.x, pose.y, goal), time=0.0)
    STATE.update(trail=[], turns=0, discs=[], own=np.zeros(2))


def policy(obs):
    """The fractions of the wheels' full speed, left and right."""
    pose, grid = STATE["pose"], STATE["grid"]
    pose.update(obs)
    STATE["time"] += DT
    ranges = np.asarray(obs["ranges"], float)
    walls = track(grid, pose, ranges)
    grid.scan(pose.x, pose.y, pose.heading, ranges, walls, STATE["time"])
    grid.replan(pose.x, pose.y)
    if recovers(grid, pose):
        return 1.0, -1.0
    x, y = grid.way_point(pose.x, pose.y, LOOKAHEAD)
    way = np.array([x - pose.x, y - pose.y])
    far = max(math.hypot(*way), 1e-6)
    preferred = way / far * min(SPEED, far / DT)
    normals, least, count = half_planes(pose, ranges, walls, STATE["own"])
    velocity = chosen(preferred, normals, least, count)
    ahead = np.array([math.cos(pose.heading), math.sin(pose.heading)])
    speed = math.hypot(*velocity)
    off = math.atan2(velocity[1], velocity[0]) - pose.heading if speed > 1e-3 else 0.0
    off = math.remainder(off, math.tau)
    sign = 1.0 if abs(off) <= math.pi / 2.0 else -1.0
    off, ahead = math.remainder(off, math.pi), sign * ahead
    turn = max(-1.0, min(1.0, TURN_GAIN * off / (2.0 * SPEED * DT / AXLE)))
    towards = normals[:count] @ ahead
    limits = least[:count][towards < -1e-3] / towards[towards < -1e-3]
    speed = max(0.0, speed * math.cos(off))
    speed = min(speed, float(limits.min(initial=SPEED)), SPEED * (1.0 - abs(turn)))
    STATE["own"] = speed * ahead
    return sign * speed / SPEED + turn, sign * speed / SPEED - turn
