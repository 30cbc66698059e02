"""Drives on a map it is given, close to the least time.

Turning by a rad takes as long as driving HALF px. At first, the costs of the way to the
goal, its length and turns, are found: coarsely everywhere, finely near the best way. In
each step, courses are tried out: of those that touch nothing, the one is driven whose
costs, and those of the way from its end, are least.
"""

import json
import math

import numpy as np

with open("params.json") as file:
    PARAMS = json.load(file)
ROBOT = PARAMS["robot"]
RADIUS, AXLE = ROBOT["radius"], ROBOT["axle_length"]
HALF = AXLE / 2.0  # px that a turn by a rad costs
TOLERANCE = 0.998 * PARAMS["goal_tolerance"]
STEP = ROBOT["max_wheel_speed"] * PARAMS["dt"]  # px at full speed
MARGIN = 0.02  # px that are kept from walls; also for errors of interpolation
EDGE = 6  # occupied pixels that are added around the map
REACH = int(RADIUS) + 4  # px up to which clearances are known
NEARBY = 2500  # pixels about the way that are searched finely
BESIDE = 1.5  # px that costs beside the nodes are higher
FAR = np.float32(1e5)  # costs where there is no way, px
STEPS, PARTS = 12, 4  # steps of a course, and parts of a step that are looked at
VARIED = 150  # variations of a course that are tried at a time


def clearances(cells):
    """Distances to the nearest obstacle, at most REACH px, at every half pixel.

    Entry [2 j + 1, 2 i + 1] is that of the centre of pixel (i, j).
    """
    far = np.float32(REACH**2)
    found = np.where(np.pad(cells, REACH, constant_values=True), np.float32(0.0), far)
    for _ in range(2):  # first along the rows, then along the columns
        width = found.shape[1] - 2 * REACH
        best = np.full((found.shape[0], 2 * width + 1), far)
        for d in range(1 - REACH, REACH):
            for odd, gap in ((1, max(abs(d) - 0.5, 0.0)), (0, d if d >= 0 else -d - 1)):
                seen = found[:, REACH + d : REACH + d + width + 1 - odd] + gap * gap
                np.minimum(best[:, odd::2], seen, out=best[:, odd::2])
        found = np.ascontiguousarray(best.T)
    return np.sqrt(found)


def moves_up_to(longest, apart):
    """Moves (dx, dy) by heading in [0, pi), with at least `apart` rad between them."""
    kept = []
    for _, heading, dx, dy in sorted(
        (math.hypot(dx, dy), math.atan2(dy, dx), dx, dy)
        for dx in range(-longest, longest + 1)
        for dy in range(longest + 1)
        if math.gcd(dx, dy) == 1 and (dy > 0 or dx > 0)
    ):
        if all(apart <= abs(heading - h) <= math.pi - apart for h, _, _ in kept):
            kept.append((heading, dx, dy))
    return np.array([(dx, dy) for _, dx, dy in sorted(kept)])


def headings_of(moves):
    """The headings of moves, and the angle from each to the next one."""
    headings = np.arctan2(moves[:, 1], moves[:, 0])
    return headings, np.diff(headings, append=math.pi)


COARSE, FINE = 2 * moves_up_to(4, 0.1), moves_up_to(12, 0.022)  # in half pixels
HEADINGS, GAPS = headings_of(FINE)
TABLE = np.linspace(0.0, math.pi, 2049)  # headings whose neighbours are looked up
BELOW = np.searchsorted(HEADINGS, TABLE, "right") - 1
WITHIN = (TABLE - HEADINGS[BELOW]) / GAPS[BELOW]


def corners(x, y, width):
    """The four entries around points in a grid, and the share of each."""
    i, j = x.astype(np.int32), y.astype(np.int32)
    u, v, at = x - i, y - j, j * width + i
    shares = (1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v
    return (at, at + 1, at + width, at + width + 1), shares


def between(field, x, y):
    """The field between its entries, by bilinear interpolation."""
    around = zip(*corners(x, y, field.shape[1]), strict=True)
    return sum(field.ravel()[at] * share for at, share in around)


def links(clear, nodes, numbers, moves):
    """The nodes after each move from each node, and before it; itself if none."""
    y, x = np.divmod(nodes, clear.shape[1])
    room = clear.ravel()[nodes] - RADIUS - MARGIN
    after = np.tile(np.arange(len(nodes), dtype=np.int32), (len(moves), 1))
    before = after.copy()
    for k, (dx, dy) in enumerate(moves):
        to, length = numbers[nodes + dy * clear.shape[1] + dx], math.hypot(dx, dy) / 2.0
        fits, count = to >= 0, math.ceil(length / 0.6)
        tight = np.flatnonzero(fits & (room < length))
        for n in range(1, count):
            i, j = x[tight] + dx * n / count, y[tight] + dy * n / count
            fits[tight] &= between(clear, i, j) >= RADIUS + MARGIN
        good = np.flatnonzero(fits)
        after[k, good], before[k, to[good]] = to[good], good
    return after.ravel(), before.ravel()


def costs_from(clear, nodes, moves, first, target):
    """Costs of the ways between a place and all nodes, px.

    The nodes are entries of `clear`. The first costs are those at the place, inf
    elsewhere: shape (moves or 1, entries). The search ends when the surroundings of
    the entry `target` are done. Returns the costs for each heading and node, and the
    numbers of the nodes of all entries, -1 where there is none.
    """
    size, count, numbers = len(nodes), len(moves), np.full(clear.size, -1, np.int32)
    numbers[nodes] = np.arange(size)
    after, before = links(clear, nodes, numbers, moves)
    lengths = (0.5 * np.hypot(*moves.T)).astype(np.float32)
    up = (HALF * headings_of(moves)[1]).astype(np.float32)
    costs = np.broadcast_to(first[:, nodes], (count, size)).astype(np.float32).ravel()
    expanded, mark = np.full_like(costs, np.inf), np.zeros(len(costs), np.int32)
    here = numbers[target] + size * np.arange(count)
    # What waits is in buckets of a px of costs; the same may be there twice.
    waiting, level, end = {0: [np.flatnonzero(np.isfinite(costs))]}, 0, math.inf
    while waiting and level < end:
        while level in waiting:
            at = np.concatenate(waiting.pop(level))
            at = at[costs[at] < expanded[at]]
            mark[at] = np.arange(len(at))
            at = at[mark[at] == np.arange(len(at))]
            cost = expanded[at] = costs[at]
            k, base = at // size, at // size * size
            for to, price in (
                (np.where(k == count - 1, at - base, at + size), up[k]),
                (np.where(k == 0, at + (count - 1) * size, at - size), up[k - 1]),
                (after[at] + base, lengths[k]),
                (before[at] + base, lengths[k]),
            ):
                further = cost + price
                better = further < costs[to]
                found, further = to[better], further[better]
                costs[found] = further
                bucket = further.astype(np.int32)
                for b in np.flatnonzero(np.bincount(bucket)):
                    waiting.setdefault(int(b), []).append(found[bucket == b])
        level += 1
        if end == math.inf and np.isfinite(costs[here]).any():
            end = costs[here].min() + HALF * math.pi / 2.0 + 6.0
    return costs.reshape(count, size), numbers


def turn_between(one, other):
    """Angle between headings, forwards or backwards, rad."""
    return np.abs((one - other + math.pi / 2.0) % math.pi - math.pi / 2.0)


class Way:
    """The costs of the way to the goal, and the course that is driven."""

    def __init__(self, obs):
        """Finds the costs, coarsely and then finely about the way."""
        cells = np.load("occupancy.npy")
        self.clear = clear = clearances(np.pad(cells, EDGE, constant_values=True))
        free = (clear >= RADIUS + MARGIN).ravel()
        y, x = np.indices(clear.shape) * 0.5 - 0.5 - EDGE
        to_goal = np.hypot(x - obs["goal"][0], y - obs["goal"][1]).ravel()
        to_start = np.hypot(x - obs["pose"][0], y - obs["pose"][1]).ravel()
        odd = (np.indices(clear.shape) % 2 == 1).all(axis=0).ravel()
        pixels = np.flatnonzero(free & odd)
        start, goal = (pixels[to[pixels].argmin()] for to in (to_start, to_goal))
        at_goal = np.maximum(to_goal - TOLERANCE, 0.0)[None]
        at_goal[at_goal > 1.0] = np.inf
        at_start = np.full((len(COARSE), clear.size), np.inf)
        ways = headings_of(COARSE)[0]
        at_start[:, start] = HALF * turn_between(ways, obs["pose"][2])
        whole, _ = costs_from(clear, pixels, COARSE, at_goal, start)
        whole += costs_from(clear, pixels, COARSE, at_start, goal)[0]
        whole = whole.min(axis=0) - whole.min()
        limit = np.clip(np.sort(whole)[: NEARBY + 1][-1], 2.0, 20.0)
        inside = np.zeros(clear.size, bool)
        for k in range(25):
            shift = (k // 5 - 2) * clear.shape[1] + k % 5 - 2
            inside[pixels[whole <= limit] + shift] = True
        nodes = np.flatnonzero(inside & free)
        start = nodes[to_start[nodes].argmin()]
        costs, numbers = costs_from(clear, nodes, FINE, at_goal, start)
        # The last column is for all entries that are no nodes.
        self.costs = np.minimum(np.insert(costs, len(nodes), FAR, axis=1), FAR)
        self.numbers = np.where(numbers < 0, len(nodes), numbers)
        self.course, self.random = COURSES[0], np.random.default_rng(0)

    def on_grid(self, x, y):
        """Columns and rows of points among the clearances."""
        height, width = self.clear.shape
        x = np.clip(2.0 * (x + EDGE) + 1.0, 0.0, width - 1.001)
        return x, np.clip(2.0 * (y + EDGE) + 1.0, 0.0, height - 1.001)

    def costs_left(self, x, y, heading):
        """Costs of the way from poses to the goal, px, interpolated."""
        entry = np.rint(np.mod(heading, math.pi) / TABLE[1]).astype(np.int32)
        k, weight = BELOW[entry], WITHIN[entry]
        around, shares = corners(*self.on_grid(x, y), self.clear.shape[1])
        around, shares = self.numbers[np.stack(around)], np.stack(shares)
        found = 0.0
        for layer, part in ((k, 1.0 - weight), ((k + 1) % len(HEADINGS), weight)):
            costs = self.costs[layer, around]
            costs = np.minimum(costs, costs.min(axis=0) + BESIDE)
            found = found + part * (shares * costs).sum(axis=0)
        return found

    def learn(self, pose, price):
        """Raises costs about a pose to its price, so that nothing is tried for ever."""
        lack = price - float(self.costs_left(*pose[:, None])[0])
        if lack > 0.3:
            around, _ = corners(*self.on_grid(*pose[:2]), self.clear.shape[1])
            k = np.flatnonzero(turn_between(HEADINGS, pose[2]) < 0.1)
            self.costs[k[:, None], self.numbers[list(around)]] += np.float32(lack)

    def best(self, pose, goal, courses, ways, margin):
        """The course with the least price: steps to the goal. Returns price, course."""
        cosine, sine = math.cos(pose[2]), math.sin(pose[2])
        x = pose[0] + cosine * ways[0] - sine * ways[1]
        y = pose[1] + sine * ways[0] + cosine * ways[1]
        fits = between(self.clear, *self.on_grid(x, y)) >= RADIUS + margin
        fits = np.logical_and.accumulate(fits.reshape(len(x), -1), axis=1)
        left = self.costs_left(x[..., -1], y[..., -1], pose[2] + ways[2][..., -1])
        left = left / STEP + np.arange(1, STEPS + 1)
        left = np.where(fits[:, PARTS - 1 :: PARTS], left, np.inf).min(axis=1)
        away = np.hypot(x - goal[0], y - goal[1]).reshape(fits.shape) - TOLERANCE
        time = np.arange(1, STEPS * PARTS + 1) / PARTS + away / STEP
        time = np.where(fits & (away <= 0.0), time, np.inf).min(axis=1)
        price = np.minimum(left, time)
        k = int(price.argmin())
        return float(price[k]), courses[k]

    def varied(self, course):
        """Courses that differ from one in some successive steps, at full speed."""
        start = self.random.integers(0, STEPS, VARIED)[:, None]
        stop = start + self.random.integers(1, 7, VARIED)[:, None]
        changed = (np.arange(STEPS) >= start) & (np.arange(STEPS) < stop)
        size = 10.0 ** self.random.uniform(-3.0, 0.0, (VARIED, 1, 1))
        many = course + size * self.random.normal(size=(VARIED, 1, 2))
        many /= np.maximum(np.abs(many).max(axis=2, keepdims=True), 1e-6)
        return np.where(changed[..., None], many, course)


def courses_to_try():
    """Courses of an arc, or a turn on the spot, and then a straight line."""
    ends = np.concatenate([np.linspace(-1.0, 0.4, 8), np.linspace(0.5, 1.0, 11)])
    tries = [(1.0, e, n) for e in ends for n in (1, 2, 3, 4, 6, 9, 12)]
    tries += [(right, left, n) for left, right, n in tries]
    tries += [(e, -e, n) for e in np.arange(-1.0, 1.01, 0.125) for n in (1, 2)]
    found = np.ones((len(tries), STEPS, 2))
    for course, (left, right, steps) in zip(found, tries, strict=True):
        course[:steps] = left, right
    return np.unique(np.concatenate([found, -found]), axis=0)


def driven(courses):
    """x, y and heading after each part of each step, from a pose at the origin."""
    turn = STEP / AXLE * (courses[..., :1] - courses[..., 1:])
    forward = 0.5 * STEP * courses.sum(axis=2, keepdims=True)
    facing = np.cumsum(turn, axis=1) - turn
    shares = np.arange(1, PARTS + 1) / PARTS
    half = 0.5 * turn * shares
    chord = forward * shares * np.sinc(half / math.pi)
    x, y = chord * np.cos(facing + half), chord * np.sin(facing + half)
    x[:, 1:] += np.cumsum(x[:, :-1, -1:], axis=1)
    y[:, 1:] += np.cumsum(y[:, :-1, -1:], axis=1)
    return x, y, facing + 2.0 * half


COURSES, STATE = courses_to_try(), {}
DRIVEN = driven(COURSES)


def reset(obs):
    """Plans the way to the goal."""
    STATE["way"] = Way(obs)


def policy(obs):
    """Wheel speeds (left, right)."""
    way, goal = STATE["way"], obs["goal"].astype(float)
    pose = obs["pose"].astype(float)
    room = float(between(way.clear, *way.on_grid(*pose[:2, None]))[0]) - RADIUS
    margin = min(max(room - 0.004, 0.002), MARGIN)
    price, course = way.best(pose, goal, COURSES, DRIVEN, margin)
    for k, old in enumerate((way.course, way.course, None, None)):
        many = way.varied(course if old is None else old) if k > 0 else old[None]
        # What was planned is kept also if rounding brings it nearer to a wall.
        limit = min(margin, MARGIN - 0.004) if k == 0 else margin
        other, changed = way.best(pose, goal, many, driven(many), limit)
        if other < price:
            price, course = other, changed
    way.learn(pose, STEP * price)
    way.course = np.roll(course, -1, axis=0)
    way.course[-1] = 1.0 if course[-1].sum() >= 0.0 else -1.0
    return tuple(np.clip(course[0], -1.0, 1.0).tolist())
