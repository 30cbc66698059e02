"""Drives to a goal on a map it is given, among people.

A ray that ends away from all walls has hit a person. Ranges are exact: the circle
through three hits gives the centre of a person and its radius, and two centres give a
velocity. A field of path lengths to the goal is computed once. In each step, a search
in space and time around the robot finds the course of the next seconds that ends
nearest to the goal and keeps away from where the people will be; it may also wait or
withdraw. Wheel speeds are tried out with the gains of the wheels, which are measured.
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
FAN = math.radians(ROBOT["field_of_view_deg"]) * np.linspace(-0.5, 0.5, ROBOT["n_rays"])

BESIDE = 1.2  # px from a wall within which a hit is of the wall
SMALLEST, LARGEST, USUAL = 4.0, 10.0, 6.5  # px, radii of people
SAME = 0.3  # px between the centres of two circles that are of one person
GATE = 5.0  # px from where a person is expected to where it is found, at most
COAST = 20  # steps for which a person is remembered that is not seen
KEEP = 0.25  # px that are kept from walls
NODE = 4  # px between the nodes of the search in space and time
LAYER = 2  # steps between two layers
LAYERS = 18
HELD = 2  # layers for which wheel speeds are held
WINDOW = 18  # nodes from the robot to the border of the search
TOUCH, WIDTH = 0.5, 0.5  # px from a person at which a contact is as likely as not
SPREAD, FADE = 0.15, 0.87  # by how much less is known of people with each layer
LOST = 800.0  # px that a contact costs
HURRY = 0.35  # price of a layer, as a part of the length that is left
PAUSE = 0.6  # px that a layer of waiting costs
TURNING, HABIT = 5.0, 0.3  # px that a rad costs; that a change of a wheel costs
STEPS = NODE * np.arange(-WINDOW, WINDOW + 1)
COLUMNS, ROWS = np.meshgrid(STEPS, STEPS)
MOVES = [(0, 0), (0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)]
ANGLES = np.array([math.atan2(row, column) for row, column in MOVES])
SPEEDS = np.array([-1.0, -0.7, -0.4, -0.15, 0.0, 0.15, 0.4, 0.7, 1.0])
PAIRS = np.array([(left, right) for left in SPEEDS for right in SPEEDS])
STATE = {}


def clearances(cells, reach):
    """Distance from each pixel's centre to the nearest obstacle, at most `reach` px."""
    padded = np.pad(cells, reach, constant_values=True)
    height, width = cells.shape
    away = np.full(padded.shape, float(reach))
    for k in range(reach + 1):
        gap = max(k - 0.5, 0.0)
        for sign in (-1, 1):
            rolled = np.roll(padded, sign * k, axis=1)
            away = np.where(rolled, np.minimum(away, gap), away)
    best = np.full((height, width), float(reach))
    for k in range(-reach, reach + 1):
        rows = away[reach + k : reach + k + height, reach : reach + width]
        best = np.minimum(best, np.hypot(rows, max(abs(k) - 0.5, 0.0)))
    return best


def between(values, x, y):
    """Values between the entries of an array, by column and row."""
    i = np.clip(np.floor(x).astype(int), 0, values.shape[1] - 2)
    j = np.clip(np.floor(y).astype(int), 0, values.shape[0] - 2)
    u, v = np.clip(x - i, 0.0, 1.0), np.clip(y - j, 0.0, 1.0)
    top = (1.0 - u) * values[j, i] + u * values[j, i + 1]
    return (1.0 - v) * top + v * (
        (1.0 - u) * values[j + 1, i] + u * values[j + 1, i + 1]
    )


CLEAR = clearances(np.load("occupancy.npy"), int(2.0 * RADIUS) + 2)


def lengths_to(goal):
    """Length of the path to the goal from every second pixel, longer beside walls."""
    clear = CLEAR[::2, ::2]
    rows, columns = clear.shape
    free = clear >= RADIUS + KEEP
    price = 2.0 * (1.0 + 0.3 * np.clip(1.7 - clear / RADIUS, 0.0, 0.7))
    price = np.pad(np.where(free, price, 60.0), 1, constant_values=np.inf)
    width = columns + 2
    price, lengths = price.ravel().tolist(), [math.inf] * price.size
    begin = (round(float(goal[1]) / 2) + 1) * width + round(float(goal[0]) / 2) + 1
    steps = [(1, 1.0), (-1, 1.0), (width, 1.0), (-width, 1.0)]
    steps += [
        (row + side, math.sqrt(2.0)) for row in (width, -width) for side in (1, -1)
    ]
    lengths[begin], queue = 0.0, [(0.0, begin)]
    while queue:
        length, at = heapq.heappop(queue)
        if length > lengths[at]:
            continue
        for offset, far in steps:
            longer = length + far * price[at + offset]
            if longer < lengths[at + offset]:
                lengths[at + offset] = longer
                heapq.heappush(queue, (longer, at + offset))
    return np.array(lengths).reshape(rows + 2, width)[1:-1, 1:-1]


class Person:
    """A person: place (px), velocity (px/s), radius (px), steps since it was seen."""

    def __init__(self, place, radius):
        self.place, self.radius = np.array(place), radius
        self.velocity, self.seen, self.unseen = np.zeros(2), 0, 0

    def meet(self, place, exact):
        """Corrects place and velocity by what was seen in this step."""
        off = np.array(place) - self.place  # from where it was expected
        if self.seen == 0:
            self.velocity = off / DT
        else:
            self.velocity = self.velocity + (0.7 if exact else 0.3) / DT * off
        speed = float(np.hypot(*self.velocity))
        if speed > 0.9 * STEP / DT:
            self.velocity *= 0.9 * STEP / DT / speed
        self.place = self.place + (1.0 if exact or not self.seen else 0.6) * off
        self.seen, self.unseen = self.seen + 1, 0


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


def track(people, numbers, points, pose):
    """Finds people in the hits that are not of walls; updates the list of people."""
    x, y, _ = pose
    for person, place in zip(people, moved(*motion(people)), strict=True):
        person.place, person.unseen = place, person.unseen + 1
    found = circles(numbers, points, x, y)
    pairs = sorted(
        (math.dist(person.place, place), k, m)
        for k, (place, _, _) in enumerate(found)
        for m, person in enumerate(people)
    )
    met = {}
    for far, k, m in pairs:
        gate = GATE + (4.0 if people[m].seen < 2 else 0.0) + 0.5 * people[m].unseen
        if far <= gate and k not in met and m not in met.values():
            met[k] = m
    left = set(range(len(numbers)))
    for k, (place, radius, hits) in enumerate(found):
        left -= hits
        if k in met:
            people[met[k]].meet(place, True)
            people[met[k]].radius = radius
        else:
            people.append(Person(place, radius))
    known = list(people)
    for group in groups(sorted(left), numbers, points):
        middle = group.mean(axis=0)
        away = (middle - (x, y)) / max(math.dist(middle, (x, y)), 1e-6)
        by_distance = [
            (abs(math.dist(middle, each.place) - each.radius), k)
            for k, each in enumerate(known)
        ]
        off, k = min(by_distance, default=(math.inf, -1))
        if off > GATE:
            people.append(Person(middle + 0.8 * USUAL * away, USUAL))
        elif known[k].unseen:
            known[k].meet(middle + 0.8 * known[k].radius * away, False)
    return people


def groups(left, numbers, points):
    """Hits that are neighbours in number and in place."""
    found = []
    for k in left:
        last = found[-1][-1] if found else k
        near = numbers[k] - numbers[last] <= 2
        if last < k and near and math.dist(points[k], points[last]) < SMALLEST:
            found[-1].append(k)
        else:
            found.append([k])
    return [points[group] for group in found]


def forget(people, pose, ranges):
    """The people that are still there, as far as the robot can see."""
    x, y, heading = pose
    kept = []
    for person in people:
        off = person.place - (x, y)
        far = math.dist(person.place, (x, y))
        bearing = math.remainder(math.atan2(off[1], off[0]) - heading, 2.0 * math.pi)
        ray = int(np.argmin(np.abs(FAN - bearing)))
        seen_past = far < RANGE and RANGE - 1e-3 > ranges[ray] > far + 2.0
        if person.unseen <= (2 if seen_past else COAST):
            kept.append(person)
    return kept


def clear_at(points):
    """Clearances of the pixels of some points, shape (n, 2)."""
    columns, rows = np.rint(points).astype(int).T
    height, width = CLEAR.shape
    return CLEAR[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]


def moved(places, rates, radii):
    """Places after a step, shape (n, 2); walls stop the motion towards them."""
    after, done = places.copy(), np.zeros(len(places), bool)
    for along in ((1.0, 1.0), (1.0, 0.0), (0.0, 1.0)):
        there = places + rates * along
        fits = ~done & (clear_at(there) >= radii - 1.0)
        after[fits] = there[fits]
        done |= fits
    return after


def motion(people):
    """Places, velocities (px per step) and radii of some people."""
    places = np.array([person.place for person in people]).reshape(-1, 2)
    rates = DT * np.array([person.velocity for person in people]).reshape(-1, 2)
    return places, rates, np.array([person.radius for person in people])


def futures(people):
    """Places in each step, shape (LAYERS * LAYER + 1, n, 2), px."""
    at, rates, radii = motion(people)
    places = np.empty((LAYERS * LAYER + 1, *at.shape))
    for step in range(len(places)):
        places[step] = at
        at = moved(at, rates, radii)
    return places


def danger(gaps, layers):
    """Probability of a contact in a layer, by the gap that is expected then, px."""
    # What is far ahead is not known well.
    width = WIDTH + SPREAD * layers
    return FADE**layers / (1.0 + np.exp(np.clip((gaps - TOUCH) / width, -30.0, 30.0)))


def dangers(places, people, x, y):
    """Probability of a contact at each node in each layer."""
    if not people:
        return np.zeros((LAYERS + 1, *COLUMNS.shape))
    reach = RADIUS + np.array([person.radius for person in people], np.float32)
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


def values(lengths, places, people, x, y):
    """What is left to pay at each node in layer HELD, and the move from there."""
    left = between(lengths, (x + COLUMNS) / 2.0, (y + ROWS) / 2.0)
    left = np.minimum(left - left[WINDOW, WINDOW], 0.5 * LOST)
    walls = between(CLEAR, x + COLUMNS, y + ROWS) < RADIUS + KEEP
    risks = dangers(places, people, x, y)
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


def chosen(lengths, people, pose):
    """The best wheel speeds, held up to layer HELD, by what they lead to."""
    x, y, heading = pose
    places = futures(people)
    value, choice = values(lengths, places, people, x, y)
    wheels = np.clip(PAIRS * STATE["gains"], -1.0, 1.0) * STEP
    forward = 0.5 * wheels.sum(axis=1)
    turn = (wheels[:, 0] - wheels[:, 1]) / AXLE
    facing = np.full(len(PAIRS), heading)
    px, py = np.full(len(PAIRS), x), np.full(len(PAIRS), y)
    safe = np.ones(len(PAIRS))
    reach = RADIUS + np.array([person.radius for person in people])
    for step in range(1, HELD * LAYER + 1):
        for part in (0.5, 0.5):
            middle = facing + 0.5 * part * turn
            px = px + part * forward * np.cos(middle)
            py = py + part * forward * np.sin(middle)
            facing = facing + part * turn
            safe[between(CLEAR, px, py) < RADIUS + KEEP] = 0.0
        if people:
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
    STATE.update(people=[], last=np.zeros(2), gains=np.ones(2), pose=None)
    STATE["lengths"] = lengths_to(obs["goal"])


def policy(obs):
    """Wheel speeds for an observation."""
    pose = x, y, heading = tuple(float(value) for value in obs["pose"])
    ranges = np.asarray(obs["ranges"], float)
    if STATE["pose"] is not None:
        measure(pose)
    STATE["pose"] = pose
    points = np.column_stack(
        [x + ranges * np.cos(heading + FAN), y + ranges * np.sin(heading + FAN)]
    )
    hits = np.flatnonzero((ranges < RANGE - 1e-3) & (clear_at(points) > BESIDE))
    people = track(STATE["people"], hits.tolist(), points[hits], pose)
    STATE["people"] = forget(people, pose, ranges)
    STATE["last"] = pair = chosen(STATE["lengths"], STATE["people"], pose)
    return pair.astype(np.float32)
