"""Drives on a map it is given, close to the least time.

The map becomes exact clearances, and these the costs of the way to the goal from every
pixel. In each step, arcs are tried out: those that touch nothing are ranked by the way
that is left at their end.
"""

import heapq
import json
import math

import numpy as np

with open("params.json") as file:
    PARAMS = json.load(file)
ROBOT = PARAMS["robot"]
RADIUS, AXLE = ROBOT["radius"], ROBOT["axle_length"]
DT, TOLERANCE = PARAMS["dt"], PARAMS["goal_tolerance"]
STEP = ROBOT["max_wheel_speed"] * DT  # px at full speed
MARGIN = 0.06  # px that are kept from walls
ROOM = 2.0 * RADIUS  # clearance from which a pixel costs nothing extra
REACH = int(ROOM) + 2
LOOK, TURN = 6.0, 10.0  # px ahead; px that a turn by a right angle costs
PRICE = 0.15  # how much more a px beside a wall costs
# Steps after which an arc is looked at: often in the first ones, which will be driven.
TIMES = np.array(
    [0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0]
)
SOON = 11  # entries of TIMES up to four steps
SPIN = 2.0 * STEP / AXLE  # rad of a step on the spot
# Directions of lines from the heading; the spins into them, forwards or backwards.
TURNS = np.arange(120) * (2.0 * math.pi / 120)
SPINS = np.array([(k + 30) % 60 - 30 for k in range(120)]) * (2.0 * math.pi / 120)
SPIN_PRICES = np.where(SPINS == 0.0, 0.0, STEP * np.maximum(np.abs(SPINS) / SPIN, 1.0))
LENGTHS = np.arange(1, 33) * 0.75  # px


def clearances(cells):
    """Distance from each pixel's centre to the nearest obstacle, at most REACH px."""
    padded = np.pad(cells, REACH, constant_values=True)
    height, width = cells.shape
    away = np.full(padded.shape, float(REACH))
    for k in range(REACH + 1):
        gap = max(k - 0.5, 0.0)
        for sign in (-1, 1):
            away = np.where(
                np.roll(padded, sign * k, axis=1), np.minimum(away, gap), away
            )
    best = np.full((height, width), float(REACH))
    for k in range(-REACH, REACH + 1):
        rows = away[REACH + k : REACH + k + height, REACH : REACH + width]
        best = np.minimum(best, np.hypot(rows, max(abs(k) - 0.5, 0.0)))
    return best


def passed(dx, dy, width):
    """Shifts of the pixels that a longer move passes between its ends."""
    count = max(abs(dx), abs(dy))
    if count == 1:
        return ()
    found = set()
    for k in range(1, 2 * count):
        x, y = dx * k / (2 * count), dy * k / (2 * count)
        for i in (math.floor(x), math.ceil(x)):
            for j in (math.floor(y), math.ceil(y)):
                found.add(j * width + i)
    return tuple(found - {0, dy * width + dx})


def costs_to(goal, clear):
    """Cost of the way from each pixel to the goal; inf where the body does not fit."""
    height, width = clear.shape
    price = 1.0 + PRICE * np.clip((ROOM - clear) / (ROOM - RADIUS), 0.0, 1.0) ** 2
    free = (clear >= RADIUS + 0.02).ravel().tolist()
    price, cost = price.ravel().tolist(), [math.inf] * (height * width)
    start = int(goal[1] + 0.5) * width + int(goal[0] + 0.5)
    moves = [
        (dx, dy, dy * width + dx, math.hypot(dx, dy), passed(dx, dy, width))
        for dx in range(-3, 4)
        for dy in range(-3, 4)
        if math.gcd(dx, dy) == 1
    ]
    cost[start], queue = 0.0, [(0.0, start)]
    while queue:
        so_far, at = heapq.heappop(queue)
        if so_far > cost[at]:
            continue
        y, x = divmod(at, width)
        # The border is never free, but longer moves could cross it.
        for dx, dy, shift, length, over in moves:
            if not (0 <= x + dx < width and 0 <= y + dy < height):
                continue
            to = at + shift
            if not free[to]:
                continue
            further = so_far + length * 0.5 * (price[at] + price[to])
            if further < cost[to] and all(free[at + each] for each in over):
                cost[to] = further
                heapq.heappush(queue, (further, to))
    return np.array(cost).reshape(height, width)


def extended(cost):
    """The costs, also of pixels a little beyond, so that one can interpolate."""
    for _ in range(4):
        padded = np.pad(cost, 1, constant_values=np.inf)
        height, width = cost.shape
        around = [
            padded[j : j + height, i : i + width] + math.hypot(i - 1, j - 1)
            for i in range(3)
            for j in range(3)
        ]
        cost = np.where(np.isfinite(cost), cost, np.min(around, axis=0))
    return np.where(np.isfinite(cost), cost, 1e6)


def between(field, x, y):
    """The field between pixel centres, by bilinear interpolation."""
    height, width = field.shape
    x, y = np.clip(x, 0.0, width - 1.001), np.clip(y, 0.0, height - 1.001)
    i, j = x.astype(int), y.astype(int)
    u, v = x - i, y - j
    top = field[j, i] * (1.0 - u) + field[j, i + 1] * u
    return top * (1.0 - v) + (field[j + 1, i] * (1.0 - u) + field[j + 1, i + 1] * u) * v


def wheel_pairs():
    """Actions to try: one wheel at full speed, forward or back, or both slower."""
    ends = np.concatenate([np.linspace(-1.0, 0.6, 9), np.linspace(0.7, 1.0, 13)])
    pairs = [(1.0, e) for e in ends] + [(e, 1.0) for e in ends]
    pairs += [(-a, -b) for a, b in pairs]
    pairs += [(0.5 * a, 0.5 * b) for a, b in pairs[::4]]
    return np.array(pairs)


CLEAR = clearances(np.load("occupancy.npy"))
COST = np.zeros_like(CLEAR)


def reset(obs):
    """Plans the way from everywhere to the goal."""
    COST[:] = extended(costs_to(obs["goal"], CLEAR))


def courses():
    """An arc of one, two, four or all steps and then a straight line, at TIMES.

    Returns the action of each course, and x, y, heading from a pose at the origin.
    """
    pairs, parts = [], []
    for left, right in wheel_pairs():
        forward, turn = 0.5 * STEP * (left + right), STEP * (left - right) / AXLE
        for steps in (1.0, 2.0, 4.0, TIMES[-1]):
            on_arc = np.minimum(TIMES, steps)
            half = 0.5 * turn * on_arc
            chord = forward * on_arc * np.sinc(half / math.pi)
            after = math.copysign(STEP, forward) * (TIMES - on_arc)
            facing = turn * on_arc
            pairs.append((left, right))
            parts.append(
                (
                    chord * np.cos(half) + after * np.cos(facing),
                    chord * np.sin(half) + after * np.sin(facing),
                    facing,
                )
            )
    x, y, facing = np.array(parts).transpose(1, 0, 2)
    return np.array(pairs), x, y, facing


PAIRS, AHEAD, ASIDE, FACING = courses()


def best_arc(x, y, heading, goal):
    """The best course that begins with an arc, as its price and its action."""
    cosine, sine = math.cos(heading), math.sin(heading)
    px, py = x + cosine * AHEAD - sine * ASIDE, y + sine * AHEAD + cosine * ASIDE
    facing = heading + FACING
    fits = np.logical_and.accumulate(between(CLEAR, px, py) - RADIUS >= MARGIN, axis=1)
    there = fits & (np.hypot(px - goal[0], py - goal[1]) <= 0.97 * TOLERANCE)
    if there.any():
        first = np.where(there.any(axis=1), there.argmax(axis=1), len(TIMES))
        return -1.0, PAIRS[int(first.argmin())]
    worth = between(COST, px, py) + STEP * TIMES + turns_left(px, py, facing)
    worth = np.where(fits, worth, np.inf)[:, SOON - 1 :].min(axis=1)
    return float(worth.min()), PAIRS[int(worth.argmin())]


def turns_left(x, y, facing):
    """Price of the turn into the way that is still to come, forwards or backwards."""
    left = between(COST, x, y)
    dx, dy = LOOK * np.cos(facing), LOOK * np.sin(facing)
    ahead = np.minimum(between(COST, x + dx, y + dy), between(COST, x - dx, y - dy))
    return TURN * np.clip((ahead - left) / LOOK + 1.0, 0.0, 1.5)


def best_line(x, y, heading):
    """The best turn on the spot with a straight line, as its price and its action."""
    bearings = heading + TURNS
    px = x + np.outer(np.cos(bearings), LENGTHS)
    py = y + np.outer(np.sin(bearings), LENGTHS)
    fits = np.logical_and.accumulate(between(CLEAR, px, py) - RADIUS >= MARGIN, axis=1)
    worth = between(COST, px, py) + LENGTHS + SPIN_PRICES[:, None]
    worth += turns_left(px, py, bearings[:, None])
    worth = np.where(fits, worth, np.inf)[:, LENGTHS >= 6.0]
    k = int(worth.min(axis=1).argmin())
    share = min(max(SPINS[k] / SPIN, -1.0), 1.0)
    pair = share, -share
    if SPINS[k] == 0.0:
        pair = (1.0, 1.0) if k == 0 else (-1.0, -1.0)
    return float(worth[k].min()), np.array(pair)


def policy(obs):
    """Wheel speeds (left, right)."""
    x, y, heading = (float(value) for value in obs["pose"])
    price, pair = best_arc(x, y, heading, obs["goal"])
    if price >= 0.0:
        other, line = best_line(x, y, heading)
        if other < price:
            pair = line
    return tuple(pair.tolist())
