"""Drives to a goal on a map it is given, among people.

A ray that ends away from all walls has hit a person; Kalman filters estimate where each
person is, how large it is and how it moves. The time from everywhere to the goal is
computed once. In each step, a search in space and time around the robot, backwards from
a few seconds ahead, finds what each place is worth soon, by where the people will be.
Courses of the next steps are tried out with the gains of the wheels, which are
measured: the one with the least costs, up to its end and from there on, is driven.
"""

import heapq
import json
import math

import numpy as np

with open("params.json") as file:
    PARAMS = json.load(file)
ROBOT = PARAMS["robot"]
RADIUS, AXLE, RANGE = ROBOT["radius"], ROBOT["axle_length"], ROBOT["range_max"]
DT = PARAMS["dt"]
STEP = ROBOT["max_wheel_speed"] * DT  # px at full speed
TOLERANCE = 0.95 * PARAMS["goal_tolerance"]
FAN = np.array(ROBOT["ray_angles"])  # rad from the heading
OFFSET = ROBOT.get("scanner_offset") or (0.0, 0.0)  # where the rays start: ahead,
# and to positive angles, px

EDGE = 36  # occupied pixels that are added around the map
REACH = 40  # px up to which clearances are known
BESIDE = 0.3  # px from a wall within which a hit is of the wall
SMALLEST, LARGEST, USUAL = 5.0, 8.0, 6.5  # px, radii of people
FASTEST = 26.0  # px/s, people
HIT_NOISE = 0.005  # px^2, variance of the distance of a hit from a circle
CIRCLE, PAIR, SINGLE = (0.1, 0.05), (2.0, 0.8), (4.0, 0.8)  # px^2, variances of the
# place and the radius of a person that is new, by three hits or more, two, and one
SHAKE = np.diag([0.02, 0.02, 9.0, 9.0, 0.0005])  # what a step adds to the covariance
SPEEDS = 144.0  # (px/s)^2, variance of a velocity of which nothing is known
VAGUE = 60.0  # (px/s)^2, variance from which a velocity is not known well
GATE = 6.0  # px from a circle within which a hit may be of its person, at most
JUMP = 11.0  # px between two neighbouring hits of a person, at most
APART = 7.0  # px between the centres of two people, at least
COAST, LATELY = 30, 5  # steps for which a person is remembered, and known well, unseen
MARGIN = 0.25  # px that are kept from walls
NODE = 2  # px between the nodes of the search in space and time
LAYER = 2  # steps between two layers; within them, the robot drives three nodes
LAYERS, BEGIN = 24, 3  # layers, and the one in which courses end
WINDOW = 48  # nodes from the robot to the border of the search
STAMP = 17  # nodes around a person where there is a risk
FAR = np.float32(1e4)  # steps, where there is no way
ROOM, CROWDED = 20.0, 0.7  # px from walls below which a step costs more, and how much
GRAZE, GRAZING = 9.3, 1.5  # px from walls below which, and steps that a px less costs
BLOCKED, DEEPER = 250.0, 100.0  # steps that a step too near to a wall costs, and a px
RISK, FADE = 80.0, 3.0  # steps that a contact costs at once; by how much less later
TOUCH = 0.8  # px from a person at which a contact is as likely as not
SHARP, BLUR, BLURRED = 0.28, 0.4, 1.2  # px by which gaps are uncertain at first, after
# a second more, and at most
VAGUE_SHARP, VAGUE_BLUR, VAGUE_BLURRED = 0.8, 1.6, 2.8  # the same where little is known
HIT, HIT_STEPS = 0.3, 5  # px below which a gap counts as a contact, in the first steps
STRUCK, STRUCK_DEEPER = 100.0, 20.0  # steps that such a contact costs, and a px
AROUND = 75.0  # px from the robot within which people matter for courses
VEER, REVERSE = 0.4, 0.4  # steps that another direction, and another gear, costs
FIRST = 3  # steps of the first part of a course
FACING = 1.2  # rad to the direction of a course from which the robot drives
STATE = {}


def clearances(cells):
    """Distances of pixels to the nearest obstacle, at most REACH px."""
    far = np.float32(REACH**2)
    found = np.where(np.pad(cells, EDGE, constant_values=True), np.float32(0.0), far)
    for _ in range(2):  # first along the columns, then along the rows
        best = found.copy()
        for d in range(1, REACH + 1):
            gap = np.float32((d - 0.5) ** 2)
            np.minimum(best[d:], found[:-d] + gap, out=best[d:])
            np.minimum(best[:-d], found[d:] + gap, out=best[:-d])
        found = np.ascontiguousarray(best.T)
    return np.sqrt(found)


CELLS = np.load("occupancy.npy")
CLEAR = clearances(CELLS)
SLOPES = np.stack(np.gradient(CLEAR)[::-1], axis=-1)
SLOPES /= np.maximum(np.linalg.norm(SLOPES, axis=-1, keepdims=True), 1e-6)


def corners(x, y, width):
    """The four entries around points in a grid, and the share of each."""
    i, j = x.astype(np.int32), y.astype(np.int32)
    u, v, at = x - i, y - j, j * width + i
    shares = (1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v
    return (at, at + 1, at + width, at + width + 1), shares


def clear_at(x, y):
    """Clearances at points, interpolated, px."""
    height, width = CLEAR.shape
    x = np.clip(x + EDGE, 0.0, width - 1.001)
    y = np.clip(y + EDGE, 0.0, height - 1.001)
    around = zip(*corners(x, y, width), strict=True)
    return sum(CLEAR.ravel()[at] * share for at, share in around)


def price_at(clear):
    """What a step costs by the clearance: it is more beside walls."""
    return 1.0 + CROWDED * np.clip((ROOM - clear) / (ROOM - RADIUS), 0.0, 1.0)


def times_to(goal):
    """Steps to the goal from every node of a grid, and the prices of steps there."""
    clear = CLEAR[EDGE % NODE :: NODE, EDGE % NODE :: NODE]
    height, width = clear.shape
    off_x = NODE * np.arange(width) - EDGE - goal[0]
    off_y = NODE * np.arange(height)[:, None] - EDGE - goal[1]
    near = np.hypot(off_x, off_y)
    free = clear >= RADIUS + 2.0 * MARGIN
    free |= (near < TOLERANCE) & (clear >= RADIUS)
    price = price_at(clear)
    open_, prices = free.ravel().tolist(), price.ravel().tolist()
    times = [math.inf] * free.size
    waiting = [(0.0, k) for k in np.flatnonzero(free & (near < TOLERANCE)).tolist()]
    for _, k in waiting:
        times[k] = 0.0
    moves = [
        (j * width + i, 0.5 * NODE / STEP * math.hypot(i, j))
        for i in range(-2, 3)
        for j in range(-2, 3)
        if math.gcd(i, j) == 1
    ]
    while waiting:
        time, k = heapq.heappop(waiting)
        if time > times[k]:
            continue
        for offset, steps in moves:
            to = k + offset
            if open_[to]:
                later = time + steps * (prices[k] + prices[to])
                if later < times[to]:
                    times[to] = later
                    heapq.heappush(waiting, (later, to))
    times = np.minimum(np.array(times).reshape(clear.shape), FAR).astype(np.float32)
    price = np.where(free, LAYER * price, FAR).astype(np.float32)
    return times, price, free & (near < TOLERANCE)


class Person:
    """A person: place (px), velocity (px/s) and radius (px) with their covariance."""

    def __init__(self, x, y, radius, spread, spread_radius):
        self.mean = np.array([x, y, 0.0, 0.0, radius])
        self.covariance = np.diag([spread, spread, SPEEDS, SPEEDS, spread_radius])
        self.unseen, self.denied = 0, 0.0

    def expect(self):
        """Goes on by a step."""
        before = self.mean.copy()
        self.mean[:2] += DT * self.mean[2:4]
        self.covariance = MOTION @ self.covariance @ MOTION.T + SHAKE
        self.unseen += 1
        if self.unseen > 1:  # walls stop whom nobody sees
            clear = clear_of(self.mean[None, :2])[0]
            if clear < self.mean[4] - 1.0 and clear < clear_of(before[None, :2])[0]:
                self.mean[:2] = before[:2]
                self.mean[2:4] *= 0.8

    def hit(self, x, y):
        """Corrects the estimates: there is a point on the circle."""
        off_x, off_y = x - self.mean[0], y - self.mean[1]
        far = max(math.hypot(off_x, off_y), 1e-6)
        slope = np.array([-off_x / far, -off_y / far, 0.0, 0.0, -1.0])
        spread = self.covariance @ slope
        gain = spread / (float(slope @ spread) + HIT_NOISE)
        self.mean += gain * (self.mean[4] - far)
        self.covariance -= np.outer(gain, spread)
        self.unseen, self.denied = 0, 0.0

    def tidy(self):
        """Keeps the estimates within what is possible."""
        self.mean[4] = min(max(self.mean[4], SMALLEST), LARGEST)
        speed = math.hypot(self.mean[2], self.mean[3])
        if speed > FASTEST:
            self.mean[2:4] *= FASTEST / speed
        self.covariance = 0.5 * (self.covariance + self.covariance.T)


MOTION = np.eye(5)
MOTION[0, 2] = MOTION[1, 3] = DT


def clear_of(places):
    """Clearances of the pixels of some places, shape (n, 2)."""
    i, j = pixels(places)
    return CLEAR[j, i]


def pixels(places):
    """Columns and rows of the pixels of some places among the clearances."""
    i, j = (np.rint(places) + EDGE).astype(int).T
    return np.clip(i, 0, CLEAR.shape[1] - 1), np.clip(j, 0, CLEAR.shape[0] - 1)


def on_walls(x, y):
    """Which points are within BESIDE of a wall."""
    found = np.zeros(len(x), bool)
    for i in (-BESIDE, BESIDE):
        for j in (-BESIDE, BESIDE):
            columns, rows = pixels(np.column_stack([x + i, y + j]))
            found |= CLEAR[rows, columns] == 0.0
    return found


def circle_through(x, y):
    """Centre and radius of the circle through three points; None if there is none."""
    ux, uy, vx, vy = x[1] - x[0], y[1] - y[0], x[2] - x[0], y[2] - y[0]
    twice = 2.0 * (ux * vy - uy * vx)
    if abs(twice) < 1e-3:
        return None
    u, v = ux * ux + uy * uy, vx * vx + vy * vy
    px, py = (vy * u - uy * v) / twice, (ux * v - vx * u) / twice
    return x[0] + px, y[0] + py, math.hypot(px, py)


def new_people(x, y, from_x, from_y):
    """People who explain neighbouring hits, by their points."""
    n = len(x)
    if n >= 3:
        ends = [0, n // 2, n - 1]
        circle = circle_through(x[ends], y[ends])
        if circle is not None:
            off = np.abs(np.hypot(x - circle[0], y - circle[1]) - circle[2]).max()
            behind = (
                math.hypot(circle[0] - from_x, circle[1] - from_y)
                > np.hypot(x - from_x, y - from_y).min()
            )
            if off < 0.2 and SMALLEST - 0.3 < circle[2] < LARGEST + 0.3 and behind:
                return [Person(*circle, *CIRCLE)]
        cut = int(np.hypot(np.diff(x), np.diff(y)).argmax()) + 1
        parts = (x[:cut], y[:cut]), (x[cut:], y[cut:])
        return [p for part in parts for p in new_people(*part, from_x, from_y)]
    middle_x, middle_y = x.mean(), y.mean()
    half = 0.5 * math.hypot(x[-1] - x[0], y[-1] - y[0])
    far = max(math.hypot(middle_x - from_x, middle_y - from_y), 1e-6)
    deep = math.sqrt(max(USUAL**2 - half**2, 0.0)) if n == 2 else 0.85 * USUAL
    centre_x = middle_x + deep * (middle_x - from_x) / far
    centre_y = middle_y + deep * (middle_y - from_y) / far
    return [Person(centre_x, centre_y, USUAL, *(PAIR if n == 2 else SINGLE))]


def scanner_at(x, y, heading):
    """The place where the rays start, for the robot's centre at a place."""
    cosine, sine = math.cos(heading), math.sin(heading)
    ahead, aside = OFFSET
    return x + ahead * cosine - aside * sine, y + ahead * sine + aside * cosine


def track(people, pose, ranges):
    """The people after this step, by the rays, which start at this pose."""
    x, y, heading = pose
    for person in people:
        person.expect()
    hit_x, hit_y = (
        x + ranges * np.cos(heading + FAN),
        y + ranges * np.sin(heading + FAN),
    )
    hits = np.flatnonzero((ranges < RANGE - 0.5) & ~on_walls(hit_x, hit_y))
    left = []
    if people:
        means = np.array([person.mean for person in people])
        spread = np.array([p.covariance[0, 0] + p.covariance[1, 1] for p in people])
        gates = np.minimum(1.5 + 2.0 * np.sqrt(np.maximum(spread, 0.0)), GATE)
        off_x, off_y = (
            hit_x[hits, None] - means[:, 0],
            hit_y[hits, None] - means[:, 1],
        )
        off = np.abs(np.hypot(off_x, off_y) - means[:, 4])
        off = np.where(off < gates, off, np.inf)
        for k, row in zip(hits.tolist(), off, strict=True):
            who = int(row.argmin())
            if row[who] < np.inf:
                people[who].hit(float(hit_x[k]), float(hit_y[k]))
            else:
                left.append(k)
    else:
        left = hits.tolist()
    for person in people:
        person.tidy()
    kept = [person for person in people if is_there(person, pose, ranges)]
    group = []
    for k in [*left, None]:
        if group and (
            k is None
            or k - group[-1] > 2
            or math.hypot(hit_x[k] - hit_x[group[-1]], hit_y[k] - hit_y[group[-1]])
            > JUMP
        ):
            kept += new_people(hit_x[group], hit_y[group], x, y)
            group = []
        group.append(k)
    kept.sort(key=lambda p: (p.unseen > 0, p.covariance[0, 0] + p.covariance[1, 1]))
    found = []
    for person in kept:
        if all(math.dist(person.mean[:2], other.mean[:2]) > APART for other in found):
            found.append(person)
    return found


def is_there(person, pose, ranges):
    """Whether a person may still be there, by the rays that pass its place."""
    if person.unseen == 0:
        return True
    x, y, heading = pose
    off_x, off_y = person.mean[0] - x, person.mean[1] - y
    far = math.hypot(off_x, off_y)
    if far < RANGE - LARGEST:
        bearing = FAN + heading - math.atan2(off_y, off_x)
        bearing = np.abs(np.remainder(bearing + math.pi, 2.0 * math.pi) - math.pi)
        across = bearing < math.asin(min(0.75 * person.mean[4] / max(far, 0.1), 1.0))
        seen = ranges[across]
        if np.any((seen > far) & (seen < RANGE - 0.5)):
            person.denied += 1.0
        else:
            person.denied += 0.5 * min(np.count_nonzero(seen >= RANGE - 0.5), 2)
    inside = clear_of(person.mean[None, :2])[0] < 2.0
    return person.denied < 2.0 and person.unseen <= COAST and not inside


def forecast(people):
    """Places in each layer, shape (LAYERS + 1, n, 2), px; people slide along walls."""
    means = np.array([person.mean for person in people])
    at, rates, radii = means[:, :2], LAYER * DT * means[:, 2:4], means[:, 4]
    places = np.empty((LAYERS + 1, *at.shape))
    places[0] = at
    for k in range(1, LAYERS + 1):
        at = at + rates
        i, j = pixels(at)
        lack = radii - CLEAR[j, i]
        if (lack > 0.0).any():
            normals = np.where((lack > 0.0)[:, None], SLOPES[j, i], 0.0)
            at = at + np.clip(lack, 0.0, 6.0)[:, None] * normals
            into = np.minimum((rates * normals).sum(axis=1), 0.0)
            rates = rates - into[:, None] * normals
        places[k] = at
    return places


def risks(gaps, times, unsure):
    """Costs of a step at gaps to a person, px, at times ahead, s."""
    if unsure:
        width = np.minimum(VAGUE_SHARP + VAGUE_BLUR * times, VAGUE_BLURRED)
    else:
        width = np.minimum(SHARP + BLUR * times, BLURRED)
    off = np.clip((gaps - TOUCH) / width, -30.0, 30.0)
    return RISK / (1.0 + times) ** FADE / (1.0 + np.exp(off))


def stamps():
    """Risks of a layer around people, by surety, layer and radius in halves of a px."""
    side = NODE * np.arange(-STAMP, STAMP + 1)
    far = np.hypot(side, side[:, None]) - RADIUS
    return {
        (unsure, layer, half): (
            LAYER * risks(far - 0.5 * half, layer * LAYER * DT, unsure)
        ).astype(np.float32)
        for unsure in (False, True)
        for layer in range(BEGIN, LAYERS)
        for half in range(round(2 * SMALLEST), round(2 * LARGEST) + 1)
    }


STAMPS = stamps()


def least_around(values):
    """The least value within three nodes, shape smaller by 3 on each side."""
    height, width = values.shape[0] - 6, values.shape[1] - 6
    three = np.minimum(np.minimum(values[:, :-2], values[:, 1:-1]), values[:, 2:])
    five = np.minimum(three[:, :-2], three[:, 2:])
    seven = np.minimum(five[:, :-2], five[:, 2:])
    three, five = three[:, 2 : 2 + width], five[:, 1 : 1 + width]
    best = np.minimum(seven[2 : 2 + height], seven[3 : 3 + height])
    np.minimum(best, seven[4 : 4 + height], out=best)
    for rows, top in ((five, 1), (five, 5), (three, 0), (three, 6)):
        np.minimum(best, rows[top : top + height], out=best)
    return best


def values_ahead(people, places, x, y):
    """What is left to pay at each node in layer BEGIN; column and row of the first."""
    times, price, at_goal = STATE["grid"]
    column = min(max(round((x + EDGE) / NODE), 20), times.shape[1] - 21)
    row = min(max(round((y + EDGE) / NODE), 20), times.shape[0] - 21)
    left, top = max(column - WINDOW, 3), max(row - WINDOW, 3)
    right = min(column + WINDOW + 1, times.shape[1] - 3)
    bottom = min(row + WINDOW + 1, times.shape[0] - 3)
    height, width = bottom - top, right - left
    values = times[top - 3 : bottom + 3, left - 3 : right + 3].copy()
    inner = values[3:-3, 3:-3]
    goals = at_goal[top:bottom, left:right]
    prices = np.full((height + 2 * STAMP, width + 2 * STAMP), FAR)
    base = price[top:bottom, left:right]
    side = 2 * STAMP + 1
    columns = np.rint((places[:, :, 0] + EDGE) / NODE).astype(int) - left
    rows = np.rint((places[:, :, 1] + EDGE) / NODE).astype(int) - top
    near = (columns > -STAMP) & (columns < width + STAMP)
    near &= (rows > -STAMP) & (rows < height + STAMP)
    columns, rows = np.clip(columns, 0, width - 1), np.clip(rows, 0, height - 1)
    kinds = [kind_of(person) for person in people]
    for layer in range(LAYERS - 1, BEGIN - 1, -1):
        prices[STAMP:-STAMP, STAMP:-STAMP] = base
        for m in np.flatnonzero(near[layer]).tolist():
            unsure, half = kinds[m]
            i, j = columns[layer, m], rows[layer, m]
            prices[j : j + side, i : i + side] += STAMPS[unsure, layer, half]
        inner[:] = prices[STAMP:-STAMP, STAMP:-STAMP] + least_around(values)
        inner[goals] = 0.0
    return values, NODE * (left - 3) - EDGE, NODE * (top - 3) - EDGE


def kind_of(person):
    """Whether the velocity of a person is unsure, and its radius in halves of a px."""
    unsure = person.covariance[2, 2] + person.covariance[3, 3] > VAGUE
    half = math.ceil(2.0 * person.mean[4] - 0.15)
    return bool(unsure or person.unseen > LATELY), min(half, round(2 * LARGEST))


def value_at(values, left, top, x, y):
    """Values at points, interpolated between the nodes that are free."""
    height, width = values.shape
    at, shares = corners(
        np.clip((x - left) / NODE, 0.0, width - 1.001),
        np.clip((y - top) / NODE, 0.0, height - 1.001),
        width,
    )
    total, weights = 0.0, 1e-9
    for k, share in zip(at, shares, strict=True):
        found = values.ravel()[k]
        part = np.where(found < 0.5 * FAR, share, 0.0)
        total, weights = total + part * found, weights + part
    return np.where(weights > 0.03, total / weights, 0.3 * FAR)


def candidates():
    """Headings and speeds to try: first turn and further one (rad), speeds, gear."""
    rows = []
    for k in range(36):
        angle = math.radians(10.0 * k)
        rows += [(angle, b, 1.0, 1.0, 1.0) for b in (0.0, -0.5, 0.5, -1.1, 1.1)]
        rows += [(angle, b, 1.0, 1.0, -1.0) for b in (0.0, -0.8, 0.8)]
        for first, then in ((0.5, 0.5), (1.0, 0.0), (0.0, 1.0)):
            rows += [(angle, 0.0, first, then, gear) for gear in (1.0, -1.0)]
    rows.append((0.0, 0.0, 0.0, 0.0, 1.0))
    return np.array(rows).T


CANDIDATES = candidates()
STEPS = BEGIN * LAYER


def roll(pose):
    """Drives all candidates: x, y after each step and the first wheel speeds."""
    first, further, speed_1, speed_2, gear = CANDIDATES
    x, y, heading = pose
    top = min(1.0, *STATE["gains"])
    limit = 2.0 * STEP * top / AXLE
    aim = heading + first + np.where(gear < 0.0, math.pi, 0.0)
    x, y = np.full(len(gear), x), np.full(len(gear), y)
    heading = np.full(len(gear), heading)
    xs, ys = [], []
    for step in range(STEPS):
        goal, speed = (aim, speed_1) if step < FIRST else (aim + further, speed_2)
        off = np.remainder(goal - heading + math.pi, 2.0 * math.pi) - math.pi
        turn = np.clip(off, -limit, limit)
        wheel = 0.5 * AXLE / STEP * turn
        drive = np.maximum(np.minimum(speed * top, top - np.abs(wheel)), 0.0)
        drive = gear * np.where(np.abs(off) > FACING, 0.0, drive)
        if step == 0:
            wheels = np.column_stack([drive + wheel, drive - wheel])
        length = STEP * drive * (1.0 - turn * turn / 24.0)
        x = x + length * np.cos(heading + 0.5 * turn)
        y = y + length * np.sin(heading + 0.5 * turn)
        heading = heading + turn
        xs.append(x)
        ys.append(y)
    return np.array(xs), np.array(ys), wheels


def costs_of(xs, ys, people, places, pose):
    """Costs of each step of all candidates, by walls and people."""
    clear = clear_at(xs, ys)
    costs = price_at(clear) + GRAZING * np.clip(GRAZE - clear, 0.0, 2.0)
    lack = RADIUS + MARGIN - clear
    costs += np.where(lack > 0.0, BLOCKED + DEEPER * lack, 0.0)
    steps = np.arange(1, STEPS + 1)
    for person, way in zip(people, places.transpose(1, 2, 0), strict=True):
        if math.dist(person.mean[:2], pose[:2]) > AROUND:
            continue
        unsure, half = kind_of(person)
        layers = np.arange(LAYERS + 1)
        at_x, at_y = (np.interp(steps / LAYER, layers, each)[:, None] for each in way)
        gaps = np.hypot(xs - at_x, ys - at_y) - 0.5 * half - RADIUS
        costs += risks(gaps, DT * steps[:, None], unsure)
        lack = HIT - gaps[:HIT_STEPS]
        costs[:HIT_STEPS] += np.where(lack > 0.0, STRUCK + STRUCK_DEEPER * lack, 0.0)
    return costs


def chosen(people, pose):
    """The wheel speeds of the candidate that costs least."""
    places = forecast(people) if people else np.zeros((LAYERS + 1, 0, 2))
    values, left, top = values_ahead(people, places, *pose[:2])
    xs, ys, wheels = roll(pose)
    costs = costs_of(xs, ys, people, places, pose)
    goal_x, goal_y = STATE["goal"]
    done = np.hypot(xs - goal_x, ys - goal_y) < TOLERANCE
    done = np.logical_or.accumulate(done, axis=0)
    costs[1:][done[:-1]] = 0.0
    total = costs.sum(axis=0)
    total += np.where(done[-1], 0.0, value_at(values, left, top, xs[-1], ys[-1]))
    way = pose[2] + CANDIDATES[0]
    if STATE["way"] is not None:
        total += VEER * (1.0 - np.cos(way - STATE["way"][0]))
        total += np.where(CANDIDATES[4] != STATE["way"][1], REVERSE, 0.0)
    best = int(total.argmin())
    if CANDIDATES[2, best] > 0.0:
        STATE["way"] = way[best], CANDIDATES[4, best]
    return wheels[best]


def measure(pose):
    """Measures the gains of the wheels from the motion of the last step."""
    x, y, heading = pose
    old_x, old_y, old_heading = STATE["pose"]
    turn = math.remainder(heading - old_heading, 2.0 * math.pi)
    middle = old_heading + 0.5 * turn
    along = (x - old_x) * math.cos(middle) + (y - old_y) * math.sin(middle)
    forward = along / max(np.sinc(0.5 * turn / math.pi), 1e-6)
    wheels = np.array([forward + 0.5 * turn * AXLE, forward - 0.5 * turn * AXLE]) / STEP
    for k in range(2):
        command = STATE["last"][k]
        if abs(command) > 0.3 and abs(wheels[k]) < 0.995:
            STATE["gains"][k] = min(max(wheels[k] / command, 0.8), 1.2)


def reset(obs):
    """Plans the way from everywhere to the goal."""
    STATE.update(people=[], last=np.zeros(2), gains=np.ones(2), pose=None, way=None)
    STATE["goal"] = obs["goal"].astype(float)
    STATE["grid"] = times_to(STATE["goal"])


def policy(obs):
    """Wheel speeds for an observation."""
    pose = tuple(float(value) for value in obs["pose"])
    if STATE["pose"] is not None:
        measure(pose)
    STATE["pose"] = pose
    STATE["people"] = track(
        STATE["people"],
        (*scanner_at(*pose), pose[2]),
        obs["ranges"].astype(float),
    )
    wheels = chosen(STATE["people"], pose)
    STATE["last"] = np.clip(wheels / STATE["gains"], -1.0, 1.0)
    return STATE["last"].astype(np.float32)
