"""Drives to a goal without a map, among discs that move straight on and bounce.

A grid keeps where rays have hit and what they have crossed. A hit in the midst of cells
that were free is of a disc: such hits are grouped, tracked, and extrapolated with their
bounces. A field of path lengths to the goal takes unseen space for free. In each step,
a search in space and time around the robot finds the course of the next seconds that
ends nearest to the goal and keeps away from where the discs will be; it may also wait
or withdraw. The robot drives backwards as well as forwards.
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
FASTEST = ROBOT["max_wheel_speed"]  # px/s
RAYS = ROBOT["n_rays"]
VIEW = math.radians(ROBOT["field_of_view_deg"])
FAN = np.linspace(-0.5 * VIEW, 0.5 * VIEW, RAYS)

CELL = 2.0  # px
HALF = 480.0  # px from the start to the border of the grid
SIDE = int(2 * HALF / CELL)  # cells
FREE, SOLID = -3, 3  # evidence below which a cell is free, and from which it is a wall
LEAST, MOST = -8, 8  # evidence never goes beyond
SAMPLES = np.arange(0.0, RANGE, CELL)  # px along a ray
KEEP = RADIUS + 2.2  # px from a robot's centre to the nearest wall
DISC = 7.0  # px, radius of a disc as long as nothing else is known
NEAR = 4.0  # px from a wall within which a hit may be of the wall
JOIN = 9.0  # px between two hits of one disc, at most
GATE = 9.0  # px from where a disc is expected to where it is found, at most
COAST = 15  # steps for which a disc is remembered that is not seen
NODE = 4.0  # px between the nodes of both searches
LAYER = 2  # steps between two layers of the search in space and time
LAYERS = 18
WINDOW = 20  # nodes from the robot to the border of the search
TOUCH, SHY = 1.5, 6.0  # px from a disc that are forbidden; that are avoided
REPLAN = 6  # steps between two fields of path lengths
COLUMNS, ROWS = np.meshgrid(
    NODE * np.arange(-WINDOW, WINDOW + 1), NODE * np.arange(-WINDOW, WINDOW + 1)
)
MOVES = [(0, 0), (0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)]
HELD = 2  # layers for which wheel speeds are held
LEVELS = np.array([-1.0, -0.7, -0.4, -0.15, 0.0, 0.15, 0.4, 0.7, 1.0])
PAIRS = np.array([(left, right) for left in LEVELS for right in LEVELS])
ANGLES = np.array([math.atan2(row, column) for row, column in MOVES])
HURRY = 0.1  # price of a layer, as a part of the length that is left
TURNING, HABIT = 5.0, 0.3  # px that a rad costs; that a change of a wheel costs
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


def apart(ranges, cos, sin):
    """Which rays hit something narrow in front of what is around it."""
    out = np.zeros(RAYS, bool)
    jumps = np.flatnonzero(np.abs(np.diff(ranges)) > 8.0) + 1
    for begin, end in zip(jumps[:-1].tolist(), jumps[1:].tolist(), strict=True):
        nearer = ranges[begin - 1] > ranges[begin] and ranges[end] > ranges[end - 1]
        wide = math.hypot(
            ranges[end - 1] * cos[end - 1] - ranges[begin] * cos[begin],
            ranges[end - 1] * sin[end - 1] - ranges[begin] * sin[begin],
        )
        out[begin:end] = nearer and wide < 2.2 * DISC
    return out


class Map:
    """What is known of walls.

    Attributes:
        evidence: Above 0 for walls, below 0 for free space, 0 where nothing was seen.
        blocked: Cells where the centre of the robot cannot be.
    """

    def __init__(self):
        self.evidence = np.zeros((SIDE, SIDE), np.int8)
        self.blocked = np.zeros((SIDE, SIDE), bool)

    def add(self, x, y, heading, ranges):
        """Adds a scan; returns the hits of discs: numbers of the rays, and points."""
        angles = heading + FAN
        cos, sin = np.cos(angles), np.sin(angles)
        hit = ranges < RANGE - 1e-3
        rows, columns = cells(x + (ranges + 0.7) * cos, y + (ranges + 0.7) * sin)
        (top, bottom), (left, right) = self.window(x, y, RANGE + 12.0)
        part = self.evidence[top:bottom, left:right]
        solid = part >= SOLID
        beside = grown(solid, BESIDE)
        known = part[rows - top, columns - left]
        moving = hit & (known <= FREE) & ~beside[rows - top, columns - left]
        narrow = hit & apart(ranges, cos, sin) & ~beside[rows - top, columns - left]
        far = SAMPLES[None, :]
        crossed = far < (ranges - 1.5)[:, None]
        free_rows, free_columns = cells(
            (x + far * cos[:, None])[crossed], (y + far * sin[:, None])[crossed]
        )
        seen = np.zeros(part.shape, np.int8)
        seen[free_rows - top, free_columns - left] = -1
        still = hit & ~moving
        seen[rows[still] - top, columns[still] - left] = 1
        seen[rows[moving] - top, columns[moving] - left] = 0
        np.clip(part + seen, LEAST, MOST, out=part)
        solid = part >= SOLID
        self.blocked[top:bottom, left:right] = grown(solid, BODY)
        at = np.column_stack([x + ranges * cos, y + ranges * sin])
        maybe = moving | narrow
        return np.flatnonzero(maybe), at[maybe]

    def window(self, x, y, reach):
        """First and last rows and columns within a distance of a point."""
        rows, columns = cells([x - reach, x + reach], [y - reach, y + reach])
        return (rows[0], rows[1] + 1), (columns[0], columns[1] + 1)


class Disc:
    """A disc that moves: place (px), velocity (px/s), steps since it was seen."""

    def __init__(self, place):
        self.place, self.velocity = place, np.zeros(2)
        self.age, self.unseen = 0, 0

    def meet(self, place):
        """Corrects place and velocity by what was seen in this step."""
        off = place - self.place
        if self.age == 0:
            self.velocity = off / DT
        else:
            self.velocity = self.velocity + (0.5 if self.age < 4 else 0.25) / DT * off
        speed = float(np.hypot(*self.velocity))
        if speed > 1.1 * FASTEST:
            self.velocity *= 1.1 * FASTEST / speed
        self.place = self.place + (0.6 if self.age else 1.0) * off
        self.age, self.unseen = self.age + 1, 0


def groups(numbers, points):
    """Groups of hits of one disc each: neighbours in number and in place."""
    found = []
    for number, point in zip(numbers.tolist(), points, strict=True):
        if found:
            last_number, last = found[-1][-1]
            if number - last_number <= 2 and np.hypot(*(point - last)) <= JOIN:
                found[-1].append((number, point))
                continue
        found.append([(number, point)])
    return [np.array([point for _, point in group]) for group in found]


def centre_of(points, x, y):
    """The centre of a disc of which some points were hit from (x, y)."""
    away = points.mean(axis=0) - (x, y)
    away /= np.hypot(*away)
    centre = points.mean(axis=0) + 0.8 * DISC * away
    for _ in range(4):
        off = centre - points
        far = np.maximum(np.hypot(*off.T), 1e-6)
        centre = centre - ((1.0 - DISC / far)[:, None] * off).mean(axis=0)
    ahead = (points - (x, y)) @ away
    # It lies behind what was hit.
    if (centre - (x, y)) @ away < ahead.min():
        centre = points.mean(axis=0) + DISC * away
    return centre


def track(discs, found, chart, pose, ranges):
    """Assigns what was found to discs; returns the discs that are kept."""
    x, y, heading = pose
    for disc in discs:
        disc.place, disc.velocity = moved(disc.place, disc.velocity, DT, chart)
    pairs = sorted(
        (float(np.hypot(*(place - disc.place))), k, m)
        for k, place in enumerate(found)
        for m, disc in enumerate(discs)
    )
    taken, met = set(), set()
    for far, k, m in pairs:
        if far <= GATE + (6.0 if discs[m].age < 2 else 0.0) and not (
            k in taken or m in met
        ):
            discs[m].meet(found[k])
            taken.add(k)
            met.add(m)
    kept = []
    for m, disc in enumerate(discs):
        if m not in met:
            disc.unseen += 1
            off = disc.place - (x, y)
            far, bearing = float(np.hypot(*off)), math.atan2(off[1], off[0]) - heading
            bearing = math.remainder(bearing, 2.0 * math.pi)
            ray = int(np.argmin(np.abs(FAN - bearing)))
            in_sight = far < RANGE and ranges[ray] > far + 2.0
            if disc.unseen > (3 if in_sight else COAST):
                continue
        kept.append(disc)
    return kept + [Disc(place) for k, place in enumerate(found) if k not in taken]


def is_wall(chart, x, y):
    """Whether a disc at a point would touch a wall."""
    column, row = int((x + HALF) / CELL), int((y + HALF) / CELL)
    if not (4 < column < SIDE - 5 and 4 < row < SIDE - 5):
        return True
    return bool((chart.evidence[row - 2 : row + 3, column - 2 : column + 3] > 0).any())


def moved(place, velocity, seconds, chart):
    """Place and velocity of a disc after a time; it bounces off walls."""
    x, y = place
    vx, vy = velocity
    if is_wall(chart, x + vx * seconds, y + vy * seconds) and not is_wall(chart, x, y):
        if is_wall(chart, x + vx * seconds, y):
            vx = -vx
        if is_wall(chart, x, y + vy * seconds):
            vy = -vy
    return np.array([x + vx * seconds, y + vy * seconds]), np.array([vx, vy])


def futures(discs, chart):
    """Places of the discs in each layer, shape (LAYERS + 1, n, 2), px."""
    places = np.empty((LAYERS + 1, len(discs), 2))
    for m, disc in enumerate(discs):
        place, velocity = disc.place, disc.velocity
        for layer in range(LAYERS + 1):
            places[layer, m] = place
            place, velocity = moved(place, velocity, LAYER * DT, chart)
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


def shifted(values, row, column, fill):
    """Values of the neighbours at an offset."""
    out = np.full_like(values, fill)
    height, width = values.shape
    out[
        max(-row, 0) : height - max(row, 0), max(-column, 0) : width - max(column, 0)
    ] = values[
        max(row, 0) : height + min(row, 0), max(column, 0) : width + min(column, 0)
    ]
    return out


def risks(places, discs, x, y):
    """Price of each node in each layer, for being near to discs."""
    price = np.zeros((LAYERS + 1, *COLUMNS.shape))
    for m, disc in enumerate(discs):
        # Nothing is known of the motion of a disc that was seen only once.
        off = 0.0 if disc.age else 4.0
        for layer in range(LAYERS + 1):
            at_x, at_y = places[layer, m] - (x, y)
            reach = RADIUS + DISC + 1.5
            if abs(at_x) > 120.0 or abs(at_y) > 120.0:
                continue
            far = np.hypot(COLUMNS - at_x, ROWS - at_y) - reach
            # What is far ahead is not known well.
            fade = 0.93**layer
            spread = 0.25 * layer + off
            price[layer] += fade * np.where(
                far < TOUCH, 400.0, np.clip(SHY + spread - far, 0.0, None) * 1.5
            )
    return price


def values(field, chart, places, discs, x, y):
    """What is left to pay at each node in layer HELD, and the move from there."""
    rows, columns = cells(x + COLUMNS, y + ROWS)
    walls = np.where(chart.blocked[rows, columns], 400.0, 0.0)
    left = field.at(x + COLUMNS, y + ROWS)
    # Whoever is early is better off than who arrives at last.
    price = risks(places, discs, x, y) + walls + HURRY * left
    value = left + price[LAYERS]
    choice = np.zeros(value.shape, np.int8)
    for layer in range(LAYERS - 1, HELD - 1, -1):
        best = shifted(value, 0, 0, 1e6) + 0.6
        choice = np.zeros(value.shape, np.int8)
        for k, (row, column) in enumerate(MOVES[1:], 1):
            other = shifted(value, row, column, 1e6)
            better = other < best
            best[better], choice[better] = other[better], k
        value = best + price[layer]
    return value, choice


def chosen(field, chart, discs, pose):
    """The best wheel speeds, held up to layer HELD, by what they lead to."""
    x, y, heading = pose
    places = futures(discs, chart)
    value, choice = values(field, chart, places, discs, x, y)
    place = np.tile([x, y], (len(PAIRS), 1))
    facing = np.full(len(PAIRS), heading)
    forward = 0.5 * (PAIRS[:, 0] + PAIRS[:, 1]) * FASTEST * DT
    turn = (PAIRS[:, 0] - PAIRS[:, 1]) * FASTEST * DT / AXLE
    cost = np.zeros(len(PAIRS))
    now = [(disc.place, disc.velocity) for disc in discs]
    for _ in range(HELD * LAYER):
        middle = facing + 0.5 * turn
        place = place + forward[:, None] * np.column_stack(
            [np.cos(middle), np.sin(middle)]
        )
        facing = facing + turn
        rows, columns = cells(*place.T)
        cost += np.where(chart.blocked[rows, columns], 400.0, 0.0)
        now = [moved(*each, DT, chart) for each in now]
        for at, _velocity in now:
            far = np.hypot(*(place - at).T) - (RADIUS + DISC + 1.5)
            cost += np.where(far < TOUCH, 400.0, np.clip(SHY - far, 0.0, None) * 0.75)
    u, v = ((place - (x, y)) / NODE + WINDOW).T
    cost += between(value, u, v)
    moves = choice[np.rint(v).astype(int), np.rint(u).astype(int)]
    off = np.abs(
        np.remainder(ANGLES[moves] - facing + 0.5 * math.pi, math.pi) - 0.5 * math.pi
    )
    cost += np.where(moves > 0, TURNING * off, 0.0)
    cost += HABIT * np.abs(PAIRS - STATE["last"]).sum(axis=1)
    return PAIRS[int(np.argmin(cost))]


def reset(obs):
    """Starts an episode."""
    STATE.update(chart=Map(), discs=[], field=None, step=0, last=np.zeros(2))
    STATE["goal"] = [float(v) for v in obs["goal"]]


def policy(obs):
    """Wheel speeds for an observation."""
    x, y, heading = (float(v) for v in obs["pose"])
    ranges = np.asarray(obs["ranges"], float)
    chart, pose = STATE["chart"], (x, y, heading)
    numbers, points = chart.add(x, y, heading, ranges)
    found = [centre_of(group, x, y) for group in groups(numbers, points)]
    STATE["discs"] = track(STATE["discs"], found, chart, pose, ranges)
    if STATE["field"] is None:
        STATE["field"] = Field(STATE["goal"])
    if STATE["step"] % REPLAN == 0:
        STATE["field"].replan(chart, x, y)
    STATE["step"] += 1
    pair = chosen(STATE["field"], chart, STATE["discs"], pose)
    STATE["last"] = pair
    return pair.astype(np.float32)
