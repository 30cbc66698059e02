"""Drives to a goal without a map, among discs that move straight on and bounce.

A grid keeps where rays have hit and what they have crossed. Ranges are exact, so the
circle through hits of a disc gives its centre and radius, and two centres its velocity;
where it will be follows from that, bounces included. A field of path lengths to the
goal takes unseen space for free. In each step, a search in space and time around the
robot finds the course of the next seconds that ends nearest to the goal and keeps away
from where the discs will be; it may also wait or withdraw. The robot drives backwards
as well as forwards.
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
RAYS = ROBOT["n_rays"]
FAN = math.radians(ROBOT["field_of_view_deg"]) * np.linspace(-0.5, 0.5, RAYS)

CELL = 2.0  # px
HALF = 480.0  # px from the start to the border of the grid
SIDE = int(2 * HALF / CELL)  # cells
FREE, SOLID = -3, 3  # evidence below which a cell is free, and from which it is a wall
LEAST, MOST = -8, 8  # evidence never goes beyond
SAMPLES = np.arange(0.0, RANGE, CELL)  # px along a ray
KEEP = RADIUS + 2.2  # px from a robot's centre to the nearest wall
NEAR = 4.0  # px from a wall within which a hit may be of the wall
SMALLEST, LARGEST, USUAL = 4.5, 9.5, 7.0  # px, radii of discs
SAME = 0.05  # px between the centres of two circles that are of one disc
FASTEST = 3.3  # px that a disc moves in a step, at most
GATE = 4.0  # px from where a disc is expected to where it is found, at most
COAST = 30  # steps for which a disc is remembered that is not seen
TALL = 3  # cells around a bounce whose walls say how it goes
NODE = 4.0  # px between the nodes of both searches
LAYER = 2  # steps between two layers of the search in space and time
LAYERS = 18
HELD = 2  # layers for which wheel speeds are held
WINDOW = 18  # nodes from the robot to the border of the search
TOUCH, WIDTH = 0.5, 0.5  # px from a disc at which a contact is as likely as not
SPREAD, FADE = 0.1, 0.95  # by how much less is known of discs with each layer
LOST = 800.0  # px that a contact costs
HURRY = 0.3  # price of a layer, as a part of the length that is left
PAUSE = 0.6  # px that a layer of waiting costs
TURNING, HABIT = 5.0, 0.3  # px that a rad costs; that a change of a wheel costs
REPLAN = 6  # steps between two fields of path lengths
STEPS = NODE * np.arange(-WINDOW, WINDOW + 1)
COLUMNS, ROWS = np.meshgrid(STEPS, STEPS)
MOVES = [(0, 0), (0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)]
ANGLES = np.array([math.atan2(row, column) for row, column in MOVES])
SPEEDS = np.array([-1.0, -0.7, -0.4, -0.15, 0.0, 0.15, 0.4, 0.7, 1.0])
PAIRS = np.array([(left, right) for left in SPEEDS for right in SPEEDS])
STATE = {}


def disk(radius):
    """Offsets (row, column) of the cells whose centre is within a radius, px."""
    reach = int(radius / CELL) + 1
    steps = np.arange(-reach, reach + 1)
    rows, columns = np.meshgrid(steps, steps, indexing="ij")
    inside = CELL * np.hypot(rows, columns) <= radius
    return np.column_stack([rows[inside], columns[inside]]).tolist()


BODY, BESIDE = disk(KEEP), disk(NEAR)


def cells(x, y):
    """Rows and columns of points, px."""
    columns = np.floor((np.asarray(x) + HALF) / CELL).astype(int)
    rows = np.floor((np.asarray(y) + HALF) / CELL).astype(int)
    return np.clip(rows, 1, SIDE - 2), np.clip(columns, 1, SIDE - 2)


def grown(mask, offsets):
    """The cells within some offsets of those of a mask, but for its border."""
    reach = max(max(abs(row), abs(column)) for row, column in offsets)
    height, width = mask.shape
    padded = np.zeros((height + 2 * reach, width + 2 * reach), bool)
    padded[reach:-reach, reach:-reach] = mask
    out = np.zeros_like(mask)
    for row, column in offsets:
        top, left = reach + row, reach + column
        out |= padded[top : top + height, left : left + width]
    return out


class Map:
    """What is known of walls.

    Attributes:
        evidence: Above 0 for walls, below 0 for free space, 0 where nothing was seen.
        blocked: Cells where the centre of the robot cannot be.
        beside: Cells at a wall.
    """

    def __init__(self):
        self.evidence = np.zeros((SIDE, SIDE), np.int8)
        self.blocked = np.zeros((SIDE, SIDE), bool)
        self.beside = np.zeros((SIDE, SIDE), bool)

    def surprising(self, hits):
        """Which hits lie where free space was seen, and not at a wall."""
        rows, columns = cells(*hits.T)
        return (self.evidence[rows, columns] <= FREE) & ~self.beside[rows, columns]

    def add(self, x, y, angles, ranges, of_discs):
        """Adds a scan; some of its rays have hit discs."""
        cos, sin = np.cos(angles), np.sin(angles)
        (top, bottom), (left, right) = window(x, y, RANGE + 12.0)
        part = self.evidence[top:bottom, left:right]
        far = SAMPLES[None, :]
        crossed = far < (ranges - 1.5)[:, None]
        rows, columns = cells(
            (x + far * cos[:, None])[crossed], (y + far * sin[:, None])[crossed]
        )
        seen = np.zeros(part.shape, np.int8)
        seen[rows - top, columns - left] = -1
        still = (ranges < RANGE - 1e-3) & ~of_discs
        rows, columns = cells(x + (ranges + 0.7) * cos, y + (ranges + 0.7) * sin)
        seen[rows[still] - top, columns[still] - left] = 1
        np.clip(part + seen, LEAST, MOST, out=part)
        solid = part >= SOLID
        self.blocked[top:bottom, left:right] = grown(solid, BODY)
        self.beside[top:bottom, left:right] = grown(solid, BESIDE)

    def bounced(self, place, rate):
        """The velocity after a bounce off the walls near a place."""
        row, column = (int(each) for each in cells(*place))
        part = self.evidence[
            row - TALL : row + TALL + 1, column - TALL : column + TALL + 1
        ]
        rows, columns = np.nonzero(part > 0)
        if not len(rows):
            return -rate
        at_x = (columns + column - TALL + 0.5) * CELL - HALF
        at_y = (rows + row - TALL + 0.5) * CELL - HALF
        off_x, off_y = place[0] - at_x, place[1] - at_y
        weight = 1.0 / np.maximum(off_x**2 + off_y**2, 1.0)
        away = np.array([(off_x * weight).sum(), (off_y * weight).sum()])
        away /= max(math.hypot(*away), 1e-9)
        into = float(rate @ away)
        return rate - 2.0 * into * away if into < 0.0 else rate


def window(x, y, reach):
    """First and last rows and columns within a distance of a point."""
    rows, columns = cells([x - reach, x + reach], [y - reach, y + reach])
    return (rows[0], rows[1] + 1), (columns[0], columns[1] + 1)


class Disc:
    """A disc that moves.

    Attributes:
        place: Its centre, px.
        rate: Its velocity, px per step; zero if it is not known.
        radius: px.
        seen: Steps in which its centre was found.
        unseen: Steps since it was hit by a ray.
    """

    def __init__(self, place, radius):
        self.place, self.radius = np.array(place), radius
        self.rate, self.seen, self.unseen = np.zeros(2), 0, 0

    def meet(self, place, radius):
        """Corrects place and velocity by the circle that was found in this step."""
        off = np.array(place) - self.place  # from where it was expected
        self.rate = self.rate + off if self.seen else off
        fast = math.hypot(*self.rate)
        if fast > FASTEST:
            self.rate *= FASTEST / fast
        self.place, self.radius = np.array(place), radius
        self.seen, self.unseen = self.seen + 1, 0

    def guess(self, place):
        """Corrects them by a place that is not exact."""
        off = np.array(place) - self.place
        self.rate = self.rate + 0.4 * off
        self.place, self.unseen = self.place + 0.6 * off, 0


def circles(numbers, points, x, y):
    """Circles through three hits each, as lists of centre, radius and hits."""
    found = []
    for k in range(len(numbers) - 2):
        if numbers[k + 2] - numbers[k] > 5:
            continue
        (ax, ay), (bx, by), (cx, cy) = points[k : k + 3].tolist()
        ux, uy, vx, vy = bx - ax, by - ay, cx - ax, cy - ay
        twice = 2.0 * (ux * vy - uy * vx)
        if abs(twice) < 1e-3:
            continue
        u, v = ux * ux + uy * uy, vx * vx + vy * vy
        px, py = (vy * u - uy * v) / twice, (ux * v - vx * u) / twice
        radius, px, py = math.hypot(px, py), ax + px, ay + py
        behind = math.hypot(px - x, py - y) > math.hypot(bx - x, by - y)
        if not (SMALLEST < radius < LARGEST and behind):
            continue
        for other in found:
            if math.hypot(px - other[0][0], py - other[0][1]) < SAME:
                other[2].update((k, k + 1, k + 2))
                break
        else:
            found.append(((px, py), radius, {k, k + 1, k + 2}))
    return found


def track(discs, chart, numbers, hits, pose):
    """Finds discs in the hits; returns which hits are of discs.

    Args:
        discs: The discs; new ones are added.
        chart: What is known of walls.
        numbers: Numbers of the rays that have hit something.
        hits: Where, shape (n, 2), px.
        pose: Pose of the robot.
    """
    taken = np.zeros(len(hits), bool)
    if len(hits):
        surprising = chart.surprising(hits)
        find_circles(discs, numbers, hits, pose, surprising, taken)
        find_known(discs, hits, pose, taken)
        left = np.flatnonzero(~taken & surprising).tolist()
        find_others(discs, groups(left, numbers, hits), hits, pose, taken)
    return taken


def find_circles(discs, numbers, hits, pose, surprising, taken):
    """Finds discs by circles.

    Four hits on one circle are of a disc. Three may be of a wall: their circle counts
    where a disc is expected, or where free space was seen.
    """
    x, y, _ = pose
    met = set()
    found = circles(numbers, hits, x, y)
    for place, radius, on_circle in sorted(found, key=lambda each: -len(each[2])):
        own, k = sorted(on_circle), expected(discs, place, radius, met)
        sure = len(own) > 3 or surprising[own].all()
        if taken[own].any() or (k is None and not sure):
            continue
        if k is None:
            k = len(discs)
            discs.append(Disc(place, radius))
        discs[k].meet(place, radius)
        taken[own] = True
        met.add(k)


def find_known(discs, hits, pose, taken):
    """Finds discs whose radius is known by one or two hits."""
    x, y, _ = pose
    for disc in discs:
        if not disc.seen or not disc.unseen:
            continue
        off = np.abs(np.hypot(*(hits - disc.place).T) - disc.radius)
        own = np.flatnonzero(~taken & (off < 1.5))
        if len(own) == 2 and own[1] == own[0] + 1:
            place = behind(*hits[own], disc.radius, x, y)
            if place is not None and math.dist(place, disc.place) < 3.0:
                disc.meet(place, disc.radius)
                taken[own] = True
        elif len(own) and off[own].min() < 0.5:
            disc.unseen = 0
            taken[own] = True


def find_others(discs, groups_of_hits, hits, pose, taken):
    """Finds discs by hits where free space was seen, about where they are."""
    x, y, _ = pose
    for own in groups_of_hits:
        taken[own] = True
        middle = hits[own].mean(axis=0)
        away = (middle - (x, y)) / max(math.dist(middle, (x, y)), 1e-6)
        place = middle + 0.8 * USUAL * away
        near = [disc for disc in discs if math.dist(disc.place, place) < GATE + FASTEST]
        if not near:
            discs.append(Disc(place, USUAL))
        elif not any(disc.seen for disc in near):
            near[0].guess(place)


def expected(discs, place, radius, met):
    """The disc that is expected nearest to a circle, not yet met; None if none is."""
    best, least = None, math.inf
    for k, disc in enumerate(discs):
        if k in met or (disc.seen and abs(disc.radius - radius) > 0.1):
            continue
        off = math.dist(place, disc.place)
        if off < min(least, GATE if disc.seen > 1 else GATE + FASTEST):
            best, least = k, off
    return best


def behind(one, two, radius, x, y):
    """The centre of a disc with two points on its border, behind them; or None."""
    half = 0.5 * math.dist(one, two)
    if not 0.0 < half < radius:
        return None
    along = (two - one) / (2.0 * half)
    across = np.array([-along[1], along[0]])
    middle = 0.5 * (one + two)
    if across @ (middle - (x, y)) < 0.0:
        across = -across
    return middle + math.sqrt(radius**2 - half**2) * across


def groups(left, numbers, hits):
    """Hits that are neighbours in number and in place."""
    found = []
    for k in left:
        last = found[-1][-1] if found else k
        near = numbers[k] - numbers[last] <= 2
        if last < k and near and math.dist(hits[k], hits[last]) < USUAL:
            found[-1].append(k)
        else:
            found.append([k])
    return found


def forget(discs, pose, ranges):
    """The discs that are still there, as far as the robot can see."""
    x, y, heading = pose
    kept = []
    for disc in discs:
        off, far = disc.place - (x, y), math.dist(disc.place, (x, y))
        bearing = math.remainder(math.atan2(off[1], off[0]) - heading, 2.0 * math.pi)
        ray = int(np.argmin(np.abs(FAN - bearing)))
        seen_past = far < RANGE and ranges[ray] > far + 1.0
        if disc.unseen <= (1 if seen_past else COAST if disc.seen else 4):
            kept.append(disc)
    return kept


def advance(discs, chart):
    """Moves the discs to where they are expected a step later."""
    places, rates = advanced(*motion(discs)[:2], chart)
    for disc, place, rate in zip(discs, places, rates, strict=True):
        disc.place, disc.rate, disc.unseen = place, rate, disc.unseen + 1


def advanced(places, rates, chart):
    """Places and velocities after a step, shape (n, 2); walls are bounced off."""
    there = places + rates
    now, then = chart.beside[cells(*places.T)], chart.beside[cells(*there.T)]
    for k in np.flatnonzero(then & ~now).tolist():
        rates = rates.copy()
        rates[k] = chart.bounced(there[k], rates[k])
        there[k] = places[k] + rates[k]
    return there, rates


def motion(discs):
    """Places, velocities (px per step) and radii of some discs."""
    places = np.array([disc.place for disc in discs]).reshape(-1, 2)
    rates = np.array([disc.rate for disc in discs]).reshape(-1, 2)
    return places, rates, np.array([disc.radius for disc in discs])


def futures(discs, chart):
    """Places in each step, shape (LAYERS * LAYER + 1, n, 2), px."""
    at, rates, _ = motion(discs)
    places = np.empty((LAYERS * LAYER + 1, *at.shape))
    for step in range(len(places)):
        places[step] = at
        at, rates = advanced(at, rates, chart)
    return places


def between(values, u, v):
    """Values at points between nodes, by column and row."""
    i, j = (
        np.clip(each.astype(int), 0, count - 2)
        for each, count in ((u, values.shape[1]), (v, values.shape[0]))
    )
    a, b = u - i, v - j
    return (1 - b) * ((1 - a) * values[j, i] + a * values[j, i + 1]) + b * (
        (1 - a) * values[j + 1, i] + a * values[j + 1, i + 1]
    )


class Field:
    """Lengths of the shortest paths to the goal from the nodes of a lattice."""

    def __init__(self, goal):
        self.goal = goal
        self.count = int(2 * HALF / NODE)
        self.lengths = np.full((self.count, self.count), np.inf)

    def replan(self, chart, x, y):
        """Dijkstra from the goal to somewhat beyond the robot."""
        step = int(NODE / CELL)
        blocked = chart.blocked[::step, ::step]
        close = grown(blocked, disk(1.5 * CELL))
        count = self.count
        price = np.where(blocked, 25.0, np.where(close, 1.4, 1.0))
        price[[0, -1]] = price[:, [0, -1]] = np.inf
        price = price.ravel().tolist()
        begin, end = self.node(*self.goal), self.node(x, y)
        lengths = [math.inf] * (count * count)
        lengths[begin] = 0.0
        heap, most = [(0.0, begin)], math.inf
        steps = [(1, 1.0), (-1, 1.0), (count, 1.0), (-count, 1.0)]
        steps += [
            (row + side, math.sqrt(2)) for row in (count, -count) for side in (1, -1)
        ]
        while heap:
            length, node = heapq.heappop(heap)
            if length > lengths[node]:
                continue
            if length > most:
                break
            if node == end:
                most = length + NODE * WINDOW
            for offset, far in steps:
                other = node + offset
                longer = length + NODE * far * price[other]
                if longer < lengths[other]:
                    lengths[other] = longer
                    heapq.heappush(heap, (longer, other))
        self.lengths = np.array(lengths).reshape(count, count)
        self.lengths[~np.isfinite(self.lengths)] = 2.0 * np.nanmax(
            np.where(np.isfinite(self.lengths), self.lengths, 0.0)
        )

    def node(self, x, y):
        """Number of the node nearest to a point."""
        column, row = round((x + HALF) / NODE), round((y + HALF) / NODE)
        return row * self.count + column

    def at(self, x, y):
        """Lengths at points, between nodes."""
        return between(self.lengths, (x + HALF) / NODE, (y + HALF) / NODE)


def danger(gaps, layers):
    """Probability of a contact in a layer, by the gap that is expected then, px."""
    # What is far ahead is not known well.
    width = WIDTH + SPREAD * layers
    return FADE**layers / (1.0 + np.exp(np.clip((gaps - TOUCH) / width, -30.0, 30.0)))


def dangers(places, discs, x, y):
    """Probability of a contact at each node in each layer."""
    if not discs:
        return np.zeros((LAYERS + 1, *COLUMNS.shape))
    reach = RADIUS + np.array([disc.radius for disc in discs], np.float32)
    off = (places[::LAYER] - (x, y)).astype(np.float32)
    steps = STEPS.astype(np.float32)
    dx, dy = (steps - off[:, :, :1]) ** 2, (steps - off[:, :, 1:]) ** 2
    far = np.sqrt(dy[:, :, :, None] + dx[:, :, None, :]) - reach[:, None, None]
    return danger(far.min(axis=1), np.arange(LAYERS + 1)[:, None, None])


def around(values):
    """Values of the nodes to which MOVES lead, shape (moves, rows, columns)."""
    padded, side = np.pad(values, 1, constant_values=LOST), 2 * WINDOW + 1
    return np.stack(
        [padded[1 + j : 1 + j + side, 1 + i : 1 + i + side] for j, i in MOVES]
    )


def values(field, chart, places, discs, x, y):
    """What is left to pay at each node in layer HELD, and the move from there."""
    left = field.at(x + COLUMNS, y + ROWS)
    left = np.minimum(left - left[WINDOW, WINDOW], 0.5 * LOST)
    walls = chart.blocked[cells(x + COLUMNS, y + ROWS)]
    risks = dangers(places, discs, x, y)
    # Whoever is early is better off than who arrives at last.
    value = np.where(walls, LOST, left + risks[LAYERS] * (LOST - left))
    for layer in range(LAYERS - 1, HELD - 1, -1):
        options = around(value)
        options[0] += PAUSE
        choice = options.argmin(axis=0)
        further = np.minimum(options.min(axis=0) + HURRY * left, LOST)
        value = further + risks[layer] * (LOST - further)
        value[walls] = LOST
    # Wheel speeds are tested by themselves for walls.
    value = np.where(walls, around(value).min(axis=0) + NODE, value)
    return value, choice


def chosen(field, chart, discs, pose):
    """The best wheel speeds, held up to layer HELD, by what they lead to."""
    x, y, heading = pose
    places = futures(discs, chart)
    value, choice = values(field, chart, places, discs, x, y)
    wheels = PAIRS * STEP
    forward = 0.5 * wheels.sum(axis=1)
    turn = (wheels[:, 0] - wheels[:, 1]) / AXLE
    facing = np.full(len(PAIRS), heading)
    px, py = np.full(len(PAIRS), x), np.full(len(PAIRS), y)
    safe = np.ones(len(PAIRS))
    reach = RADIUS + np.array([disc.radius for disc in discs])
    for step in range(1, HELD * LAYER + 1):
        for part in (0.5, 0.5):
            middle = facing + 0.5 * part * turn
            px = px + part * forward * np.cos(middle)
            py = py + part * forward * np.sin(middle)
            facing = facing + part * turn
            safe[chart.blocked[cells(px, py)]] = 0.0
        if discs:
            off_x, off_y = (
                px[:, None] - places[step, :, 0],
                py[:, None] - places[step, :, 1],
            )
            gaps = (np.hypot(off_x, off_y) - reach).min(axis=1)
            safe *= 1.0 - danger(gaps, step / LAYER)
    cost = between(value, (px - x) / NODE + WINDOW, (py - y) / NODE + WINDOW)
    column = np.rint((px - x) / NODE).astype(int) + WINDOW
    row = np.rint((py - y) / NODE).astype(int) + WINDOW
    moves = choice[row, column]
    off = np.remainder(ANGLES[moves] - facing + 0.5 * math.pi, math.pi) - 0.5 * math.pi
    cost += np.where(moves > 0, TURNING * np.abs(off), 0.0)
    cost += HABIT * np.abs(PAIRS - STATE["last"]).sum(axis=1)
    cost = LOST + safe * (cost - LOST)
    return PAIRS[int(np.argmin(cost))]


def reset(obs):
    """Starts an episode."""
    STATE.update(chart=Map(), discs=[], step=0, last=np.zeros(2))
    STATE["field"] = Field([float(value) for value in obs["goal"]])


def policy(obs):
    """Wheel speeds for an observation."""
    pose = x, y, heading = tuple(float(value) for value in obs["pose"])
    ranges = np.asarray(obs["ranges"], float)
    chart, field, angles = STATE["chart"], STATE["field"], heading + FAN
    numbers = np.flatnonzero(ranges < RANGE - 1e-3)
    points = np.column_stack([x + ranges * np.cos(angles), y + ranges * np.sin(angles)])
    discs = STATE["discs"]
    advance(discs, chart)
    of_discs = track(discs, chart, numbers.tolist(), points[numbers], pose)
    STATE["discs"] = forget(discs, pose, ranges)
    rays = np.zeros(RAYS, bool)
    rays[numbers[of_discs]] = True
    chart.add(x, y, angles, ranges, rays)
    if STATE["step"] % REPLAN == 0:
        field.replan(chart, x, y)
    STATE["step"] += 1
    STATE["last"] = pair = chosen(field, chart, STATE["discs"], pose)
    return pair.astype(np.float32)
