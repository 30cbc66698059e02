"""Drives to a goal without a map, and never into space that it has not seen free.

Two maps grow: the distance to the nearest point that a ray has hit, and the space that
rays and the body have found free. A search finds the way to the goal, on which unseen
space costs a little more. In each step, arcs are tried out: the next step of an arc
must lie in free space, what comes then must not touch a hit. With rays all around, the
robot drives backwards as well as forwards, and each arc is followed by a turn and a
straight line to a place of the way, as far ahead as is best: from there, what lines
and turns to the goal cost is known. Otherwise, or if there is no such line, an arc is
followed by a straight line, and its end has the cost of the search. If the best arc
leads into unseen space, the robot first turns on the spot to look there.
"""

import json
import math

import numpy as np

with open("params.json") as file:
    PARAMS = json.load(file)
ROBOT = PARAMS["robot"]
RADIUS, AXLE, RANGE = ROBOT["radius"], ROBOT["axle_length"], ROBOT["range_max"]
NOISE = PARAMS["disturbances"]["range_noise"]
SHARP = min(RANGE, 0.6 / NOISE) if NOISE else RANGE  # px up to which rays are trusted
DT, TOLERANCE = PARAMS["dt"], PARAMS["goal_tolerance"]
STEP = ROBOT["max_wheel_speed"] * DT  # px at full speed
FAN = np.array(ROBOT["ray_angles"])  # rad from the heading, an even fan
FAN = np.where(np.abs(FAN) > math.pi, FAN - np.copysign(2.0 * math.pi, FAN), FAN)
ORDER = np.argsort(FAN)  # of the rays, from the left to the right
FAN = FAN[ORDER]
VIEW = float(FAN[-1] - FAN[0])
GAP = VIEW / max(FAN.size - 1, 1)  # rad between two rays
OFFSET = ROBOT.get("scanner_offset") or (0.0, 0.0)  # where the rays start: ahead,
# and to positive angles, px
ROUND = 2.0 * math.pi - VIEW < 1.01 * GAP  # whether the robot sees behind itself
MARGIN = 0.06  # px that are kept from walls
WISH, FEAR = 0.5, 1.0  # px that are kept where there is room; price of a px less
LOOSE = 0.45  # px by which the search may come too near to a hit
SLIVER = 1.6  # px around walls in which a px must be crossed to be free
STALE = 8  # steps after which new walls lead to a new plan, if they are not in the way
ROOM = 1.5 * RADIUS  # clearance from which a px costs nothing extra
REACH = int(ROOM) + 2
PRICE = 0.15  # how much more a px beside a wall costs
UNSEEN = 0.3  # how much more an unseen px costs
PEEK = 6.0  # px that a look costs
WAIT, STUCK = 25, 6.0  # steps within so many px after which the search goes another way
CELL = 2  # px between the places of the search
BEYOND = 48.0  # px beyond the robot up to which the search goes
HALF = AXLE / 2.0  # px that a turn by a rad costs
LINKS = 40  # places of the way to which lines are tried
BINS = 90  # bearings of lines to a place that are told apart, over pi
SCOUTS = 16  # ends of arcs from which it is found out which places are in sight
BATCH, BATCHES = 128, 24  # lines that are looked at together; how often, at most
LOOK, TURN = 6.0, 10.0  # px ahead; px that a turn by a right angle costs
WINDOW = 36  # px around the robot in which arcs lie
# Steps after which an arc is looked at: often in the first ones, which will be driven.
TIMES = np.array(
    [0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0]
)
NEXT, SOON = 5, 11  # entries of TIMES up to one step and up to four steps
SPIN = 2.0 * STEP / AXLE  # rad of a step on the spot
# Directions of lines from the heading, and the spins into them.
TURNS = np.arange(120) * (2.0 * math.pi / 120)
FULL_SPINS = np.remainder(TURNS + math.pi, 2.0 * math.pi) - math.pi
LENGTHS = np.arange(1, 33) * 0.75  # px
SAMPLES = np.arange(0.0, SHARP, 0.5)  # px along a ray
STEPS = np.maximum(np.abs(np.arange(-REACH, REACH + 1)) - 0.5, 0.0)
BEND = np.abs(np.arange(BINS)[:, None] - np.arange(BINS))
BEND = HALF * math.pi / BINS * np.minimum(BEND, BINS - BEND)  # price between bearings
KERNEL = np.hypot(STEPS[:, None], STEPS)  # distance to a px from the px around it


class Maps:
    """What is known in a square around the start.

    Attributes:
        half: Index of the start.
        walls: Which px are walls.
        crossed: Which px a ray or the body has been in: they are free.
        filled: Which px lie between two rays that went further.
        away: Distance to the nearest wall, at most REACH px.
        extra: How much more a px costs if it is unseen or closed, for every CELL-th px.
        cost: Cost of the way to the goal, for every CELL-th px.
        closed: Places at which the robot got no further.
        way: Indices of the places of the way from where it was planned to the goal.
        chain: Lines and turns along the way; None if there is none.
    """

    def __init__(self, goal):
        self.goal = goal
        half = int(max(320.0, max(map(abs, goal)) + 160.0)) // CELL * CELL
        self.half, self.side = half, 2 * half + 1
        self.walls, self.crossed, self.filled = np.zeros(
            (3, self.side, self.side), bool
        )
        self.away = np.full((self.side, self.side), float(REACH))
        self.cost = np.full((half + 1, half + 1), np.inf)
        self.extra = np.zeros_like(self.cost)
        self.closed = np.zeros_like(self.cost, bool)
        self.way, self.trail = np.zeros(0, int), []
        self.age, self.news = 0, False
        self.looks = 0
        self.chain = None

    def square(self, x, y, reach):
        """Slices of the px around a place, and their x and y relative to it."""
        i, j = round(x) + self.half, round(y) + self.half
        i = min(max(i, reach), self.side - 1 - reach)
        j = min(max(j, reach), self.side - 1 - reach)
        around = np.arange(-reach, reach + 1)
        rows, columns = slice(j - reach, j + reach + 1), slice(i - reach, i + reach + 1)
        return rows, columns, around + (i - self.half - x), around + (j - self.half - y)

    def indices(self, x, y):
        """Rows and columns of the px of places."""
        i = np.clip(np.rint(x).astype(int) + self.half, 0, self.side - 1)
        return np.clip(np.rint(y).astype(int) + self.half, 0, self.side - 1), i

    def add(self, x, y, heading, ranges):
        """Adds what the rays tell; returns whether any wall is new."""
        ranges = np.minimum(ranges, SHARP)
        cosines, sines = np.cos(heading + FAN), np.sin(heading + FAN)
        along = np.minimum(SAMPLES, ranges[:, None] - 0.02)
        along = np.maximum(along, 0.0)
        from_x, from_y = scanner_at(x, y, heading)
        rows, columns = self.indices(
            from_x + along * cosines[:, None], from_y + along * sines[:, None]
        )
        self.crossed[rows, columns] = True
        hit = ranges < SHARP - 1e-3
        tips = ranges + 1e-3
        rows, columns = self.indices(from_x + tips * cosines, from_y + tips * sines)
        rows, columns = rows[hit], columns[hit]
        fresh = {
            (j, i)
            for j, i in zip(rows.tolist(), columns.tolist(), strict=True)
            if not self.walls[j, i]
        }
        for j, i in fresh:
            self.walls[j, i] = True
            part = self.away[j - REACH : j + REACH + 1, i - REACH : i + REACH + 1]
            if part.shape == KERNEL.shape:
                np.minimum(part, KERNEL, out=part)
        self.fill(x, y, heading, ranges)
        return bool(fresh)

    def fill(self, x, y, heading, ranges):
        """Fills the px between two rays, as far as both went; and those of the body."""
        rows, columns, dx, dy = self.square(x, y, int(RADIUS) + 1)
        body = dx * dx + (dy * dy)[:, None] <= RADIUS * RADIUS
        self.crossed[rows, columns] |= body
        least = np.minimum(ranges, np.roll(ranges, -1))
        # Behind the last ray nothing is seen, unless the first one is next to it.
        least = np.append(least if ROUND else least[:-1], 0.0)
        far = float(least.max())
        from_x, from_y = scanner_at(x, y, heading)
        rows, columns, dx, dy = self.square(from_x, from_y, int(far) + 1)
        square = dx * dx + (dy * dy)[:, None]
        filled = self.filled[rows, columns]
        j, i = np.nonzero(~filled & (square <= far * far))
        place = np.arctan2(dy[j], dx[i]) - (heading + FAN[0])
        place = np.remainder(place, 2.0 * math.pi) * (1.0 / GAP)
        k = np.minimum(place.astype(int), least.size - 1)
        new = square[j, i] <= least[k] ** 2
        filled[j[new], i[new]] = True

    def replan(self, x, y, new):
        """Makes a new plan if a wall is in the way, or if walls are new for a while."""
        self.age += 1
        self.news |= new
        if self.way.size:
            away = self.away[::CELL, ::CELL].ravel()[self.way] if new else ROOM
            if np.min(away) >= RADIUS - LOOSE and not (self.news and self.age >= STALE):
                self.go_on()
                return
        self.plan(x, y)
        self.way = descent(self.cost, self.cell(x, y))
        if not self.way.size and self.closed.any():
            self.closed[:] = False
            self.plan(x, y)
            self.way = descent(self.cost, self.cell(x, y))
        self.age, self.news = 0, False
        self.chain = Chain(self) if ROUND and self.way.size else None

    def go_on(self):
        """Drops the part of the way that has been driven, if it is long."""
        done = 0 if self.chain is None else self.chain.at
        if done > LINKS // 2 and self.way.size > LINKS:
            self.way = self.way[done:]
            self.chain = Chain(self)

    def watch(self, x, y):
        """Closes the narrowest place ahead if the robot gets no further."""
        self.trail = [*self.trail[-WAIT:], (x, y)]
        if len(self.trail) <= WAIT or np.ptp(self.trail, axis=0).max() > STUCK:
            return
        self.trail = []
        ahead = self.way[3:16]
        if ahead.size:
            tight = ahead[self.away[::CELL, ::CELL].ravel()[ahead].argmin()]
            j, i = divmod(int(tight), self.cost.shape[1])
            self.closed[max(j - 2, 0) : j + 3, max(i - 2, 0) : i + 3] = True
            self.way, self.news, self.age = np.zeros(0, int), True, STALE

    def plan(self, x, y):
        """Costs of the way to the goal, up to somewhat beyond the robot."""
        away, free = self.away[::CELL, ::CELL], self.filled[::CELL, ::CELL]
        self.extra = np.where(self.closed, np.inf, UNSEEN * ~free)
        price = 1.0 + PRICE * np.clip((ROOM - away) / (ROOM - RADIUS), 0.0, 1.0) ** 2
        price += self.extra
        passable = (away >= RADIUS - LOOSE) & ~self.closed
        passable[:3], passable[-3:], passable[:, :3], passable[:, -3:] = (False,) * 4
        goal, robot = self.cell(*self.goal), self.cell(x, y)
        least = CELL * math.dist(goal, robot)
        if math.isfinite(self.cost[robot]):
            least = max(least, float(self.cost[robot]))
        for most in (least + BEYOND, 2.0 * least + BEYOND, math.inf):
            self.cost[:], found = wave(passable, price, goal, robot, most)
            if found:
                return

    def toll(self, x, y, to_x, to_y, apart, least):
        """What lines cost beyond their length; inf where a px is too near to a wall."""
        dx, dy = to_x - x, to_y - y
        length = np.hypot(dx, dy)
        shares = np.linspace(0.0, 1.0, max(int(length.max() / apart) + 1, 2))
        x = x[:, None] + dx[:, None] * shares + self.half
        y = y[:, None] + dy[:, None] * shares + self.half
        at = (y + 0.5).astype(int) * self.side + (x + 0.5).astype(int)
        fits = (self.away.ravel()[at] >= least).all(axis=1)
        i = (x[fits] * (1.0 / CELL) + 0.5).astype(int)
        j = (y[fits] * (1.0 / CELL) + 0.5).astype(int)
        extra = self.extra.ravel()[j * self.extra.shape[1] + i].mean(axis=1)
        found = np.full(length.shape, np.inf)
        found[fits] = length[fits] * extra
        return found

    def cell(self, x, y):
        """Row and column of the place of the search that is nearest."""
        half = self.half // CELL
        return round(y / CELL) + half, round(x / CELL) + half


def moves(width):
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
            found.append((shift, CELL * math.hypot(dx, dy), *over))
    return found


def wave(passable, price, goal, robot, most):
    """Costs to the goal over places, in bands of equal cost; inf where there is no way.

    Stops somewhat beyond the robot, and leaves out places over which the robot cannot
    get to the goal for at most `most`. No move is shorter than a band is wide, so each
    band is final when its turn comes. Also returns whether the robot was reached.
    """
    rows = np.arange(passable.shape[0]) - robot[0]
    columns = np.arange(passable.shape[1]) - robot[1]
    # A place that has not been reached has the cost that would be too much.
    cost = most - CELL * np.hypot(rows[:, None], columns).ravel()
    reached = np.zeros(cost.shape, bool)
    width = passable.shape[1]
    shifts, lengths, first, second = (
        np.array(each) for each in zip(*moves(width), strict=True)
    )
    lengths = 0.5 * lengths
    passable, price = passable.ravel(), np.where(passable, price, np.inf).ravel()
    start, until = goal[0] * width + goal[1], math.inf
    target = robot[0] * width + robot[1]
    around = target + np.array([0, 1, -1, width, -width])
    cost[start], reached[start] = 0.0, True
    last = np.zeros(cost.shape, int)  # where a place is in a band for the last time
    bands, band = {0: [np.array([start])]}, 0
    while bands and band * CELL < until:
        parts = bands.pop(band, None)
        band += 1
        if parts is None:
            continue
        at = np.concatenate(parts)
        at = at[cost[at] >= (band - 1) * CELL]
        last[at] = np.arange(at.size)
        at = at[last[at] == np.arange(at.size)]
        to = at[:, None] + shifts
        further = cost[at][:, None] + lengths * (price[at][:, None] + price[to])
        some, move = np.nonzero(further < cost[to])
        free = passable[at[some] + first[move]] & passable[at[some] + second[move]]
        some, move = some[free], move[free]
        if not some.size:
            continue
        to, further = to[some, move], further[some, move]
        np.minimum.at(cost, to, further)
        reached[to] = True
        where = (further * (1.0 / CELL)).astype(int)
        for k in range(int(where.min()), int(where.max()) + 1):
            some = to[where == k]
            if some.size:
                bands.setdefault(k, []).append(some)
        near = around[reached[around]]
        if until == math.inf and near.size:
            until = float(cost[near].min()) + BEYOND
    cost[~reached] = np.inf
    return cost.reshape(-1, width), until < math.inf


def descent(cost, robot):
    """Indices of the places on the way from the robot to the goal."""
    width, flat = cost.shape[1], cost.ravel()
    shifts, lengths = (
        np.array(each) for each in list(zip(*moves(width), strict=True))[:2]
    )
    at, found = robot[0] * width + robot[1], []
    for _ in range(600):
        to = at + shifts
        k = int((flat[to] + lengths).argmin())
        if flat[at] <= flat[to[k]] or not math.isfinite(flat[to[k]]):
            break
        at = int(to[k])
        found.append(at)
    return np.array(found, int)


def extended(cost, turns):
    """The costs, also of places a little beyond, so that one can interpolate."""
    for _ in range(turns):
        padded = np.pad(cost, 1, constant_values=np.inf)
        height, width = cost.shape
        around = [
            padded[j : j + height, i : i + width]
            + CELL * 1.5 * math.hypot(i - 1, j - 1)
            for i in range(3)
            for j in range(3)
        ]
        cost = np.where(np.isfinite(cost), cost, np.min(around, axis=0))
    return np.where(np.isfinite(cost), cost, 1e5)


def between(field, x, y, half, half_y=None, scale=1.0):
    """The field between its places, by bilinear interpolation."""
    height, width = field.shape
    x = np.clip(x / scale + half, 0.0, width - 1.001)
    y = np.clip(y / scale + (half if half_y is None else half_y), 0.0, height - 1.001)
    i, j = x.astype(int), y.astype(int)
    u, v = x - i, y - j
    flat, at = (
        field.ravel(),
        j * width + i,
    )
    top = flat[at] * (1.0 - u) + flat[at + 1] * u
    return (
        top * (1.0 - v) + (flat[at + width] * (1.0 - u) + flat[at + width + 1] * u) * v
    )


class Near:
    """The maps around the robot, as the arcs need them."""

    def __init__(self, maps, x, y):
        self.maps = maps
        rows, columns, dx, dy = maps.square(x, y, WINDOW)
        self.x0, self.y0 = dx[0] + x, dy[0] + y
        self.hits = maps.away[rows, columns].copy()
        free = maps.filled[rows, columns] & (self.hits > SLIVER * (maps.looks < 2))
        unseen = ~(free | maps.crossed[rows, columns])
        self.places = np.argwhere(unseen)[:, ::-1] + [self.x0, self.y0]
        self.unseen = clearances(unseen, int(RADIUS) + 1)
        half, reach = maps.half // CELL, WINDOW // CELL + 6
        j, i = maps.cell(x, y)
        i, j = max(i - reach, 0), max(j - reach, 0)
        part = maps.cost[j : j + 2 * reach + 1, i : i + 2 * reach + 1]
        self.part, self.i, self.j = extended(part, 4), half - i, half - j

    def room(self, x, y):
        """Room between the body and hits, px."""
        return between(self.hits, x, y, -self.x0, -self.y0) - RADIUS

    def seen(self, x, y):
        """Room between the body and unseen space, px."""
        return between(self.unseen, x, y, -self.x0, -self.y0) - RADIUS

    def left(self, x, y):
        """Cost of the way to the goal."""
        return between(self.part, x, y, self.i, self.j, CELL)


class Chain:
    """Places on the way, and what lines and turns from each of them to the goal cost.

    Attributes:
        x, y: The places; the last one is the goal if the way is short enough.
        rest: Cost after a line that gets to a place at one of BINS bearings, px.
        at: The place that the robot is near.
    """

    def __init__(self, maps):
        self.maps, self.at = maps, 0
        tail = self.place()
        count = self.x.size
        self.rest = np.full((count, BINS), tail)
        dx, dy = self.x - self.x[:, None], self.y - self.y[:, None]
        bins = bins_of(np.arctan2(dy, dx))
        cost = self.between_places(np.hypot(dx, dy))
        for k in range(count - 1, 0, -1):
            cost[:k, k] += self.rest[k, bins[:k, k]]
            after = cost[k - 1, k:] + BEND[:, bins[k - 1, k:]]
            self.rest[k - 1] = after.min(axis=1)

    def place(self):
        """Sets the places, with some room if that is near; cost at the last one."""
        maps = self.maps
        j, i = np.divmod(maps.way[:LINKS], maps.cost.shape[1])
        down, right = (shift.ravel() - 2 for shift in np.indices((5, 5)))
        rows, columns = CELL * j[:, None] + down, CELL * i[:, None] + right
        # Of equals, the nearest one is taken.
        room = np.minimum(maps.away[rows, columns], RADIUS + 1.0)
        room -= 0.01 * np.hypot(down, right)
        best = np.arange(j.size), room.argmax(axis=1)
        x, y = columns[best] - float(maps.half), rows[best] - float(maps.half)
        self.x, self.y = x, y
        if maps.way.size > LINKS:
            return float(maps.cost[j[-1], i[-1]])
        x[-1], y[-1] = maps.goal
        return 0.0

    def between_places(self, lengths):
        """Costs of lines from each place to later ones; inf if they touch a wall."""
        cost = np.full(lengths.shape, np.inf)
        start, end = np.triu_indices(self.x.size, 1)
        group = np.digitize(lengths[start, end], (20.0, 50.0))
        for k in np.unique(group):
            i, j = start[group == k], end[group == k]
            toll = self.maps.toll(
                self.x[i], self.y[i], self.x[j], self.y[j], 1.5, RADIUS - 0.1
            )
            cost[i, j] = lengths[i, j] + toll
        # The way itself leads on, even if it seems a little too narrow.
        i = np.arange(self.x.size - 1)
        step = cost[i, i + 1]
        cost[i, i + 1] = np.where(np.isfinite(step), step, lengths[i, i + 1] + 1.0)
        return cost

    def in_sight(self, x, y):
        """Places ahead that are in sight from some of the poses."""
        window = slice(self.at, self.at + 12)
        gaps = np.hypot(self.x[window] - x[0], self.y[window] - y[0])
        self.at += int(gaps.argmin())
        gaps = np.hypot(self.x[self.at :] - x[0], self.y[self.at :] - y[0])
        gaps[-1] = np.inf
        ahead = self.at + np.flatnonzero(gaps > 1.5)
        some = np.unique(np.linspace(0, x.size - 1, SCOUTS).astype(int))
        pose, place = np.repeat(some, ahead.size), np.tile(ahead, some.size)
        toll = self.maps.toll(
            x[pose], y[pose], self.x[place], self.y[place], 2.0, RADIUS - 0.75
        )
        return ahead[np.isfinite(toll.reshape(some.size, -1)).any(axis=0)]

    def best(self, x, y, heading, before):
        """The least price of a way over one of the poses, and the number of the pose.

        Lines are looked at in the order of the price that they have if nothing is in
        their way.
        """
        places = self.in_sight(x, y)
        dx, dy = self.x[places] - x[:, None], self.y[places] - y[:, None]
        bearing = np.arctan2(dy, dx)
        turn = bearing - heading[:, None]
        turn = np.abs(turn - math.pi * np.rint(turn * (1.0 / math.pi)))
        price = before[:, None] + np.hypot(dx, dy) + HALF * turn
        price = (price + self.rest[places, bins_of(bearing)]).ravel()
        order = np.argsort(price)[: BATCH * BATCHES]
        best = math.inf, 0
        for first in range(0, order.size, BATCH):
            some = order[first : first + BATCH]
            if price[some[0]] >= best[0]:
                break
            pose, place = np.divmod(some, places.size)
            line = x[pose], y[pose], self.x[places[place]], self.y[places[place]]
            worth = price[some] + self.maps.toll(*line, 1.0, RADIUS - 0.75)
            for k in np.argsort(worth):
                if worth[k] >= best[0]:
                    break
                if self.fits(*(float(ends[k]) for ends in line)):
                    best = float(worth[k]), int(pose[k])
        return best

    def fits(self, x, y, to_x, to_y):
        """Whether there is room for the body on a line, beyond its start."""
        count = int(2.0 * math.hypot(to_x - x, to_y - y)) + 2
        shares = np.linspace(0.0, 1.0, count)[1:]
        px, py = x + (to_x - x) * shares, y + (to_y - y) * shares
        room = between(self.maps.away, px, py, self.maps.half)
        return bool(room.min() >= RADIUS + MARGIN)


def bins_of(bearing):
    """Numbers of bearings, forwards or backwards alike."""
    return np.rint(bearing * (BINS / math.pi)).astype(int) % BINS


def clearances(cells, reach):
    """Distance from each px to the nearest one that is set, at most reach."""
    padded = np.pad(cells, reach)
    height, width = cells.shape
    away = np.full((padded.shape[0], width), float(reach))
    for k in range(reach, -1, -1):
        for shift in (-k, k):
            away[padded[:, reach + shift : reach + shift + width]] = max(k - 0.5, 0.0)
    away *= away
    best = np.full((height, width), float(reach) ** 2)
    for k in range(-reach, reach + 1):
        np.minimum(
            best,
            away[reach + k : reach + k + height] + max(abs(k) - 0.5, 0.0) ** 2,
            out=best,
        )
    return np.sqrt(best)


def wheel_pairs():
    """Actions to try: one wheel at full speed, forward or back, or both slower."""
    ends = np.concatenate([np.linspace(-1.0, 0.6, 9), np.linspace(0.7, 1.0, 13)])
    pairs = [(1.0, e) for e in ends] + [(e, 1.0) for e in ends]
    pairs += [(-a, -b) for a, b in pairs]
    pairs += [(0.5 * a, 0.5 * b) for a, b in pairs[::4]]
    return np.array(pairs)


def courses():
    """An arc of one, two, four or all steps and then a straight line, at TIMES.

    Returns the action of each course, the steps of its arc, and x, y, heading from a
    pose at the origin.
    """
    pairs, parts, lengths = [], [], []
    for left, right in wheel_pairs():
        forward, turn = 0.5 * STEP * (left + right), STEP * (left - right) / AXLE
        for steps in (1.0, 2.0, 4.0, TIMES[-1]):
            on_arc = np.minimum(TIMES, steps)
            half = 0.5 * turn * on_arc
            chord = forward * on_arc * np.sinc(half / math.pi)
            after = math.copysign(STEP, forward) * (TIMES - on_arc)
            facing = turn * on_arc
            pairs.append((left, right))
            lengths.append(steps)
            parts.append(
                (
                    chord * np.cos(half) + after * np.cos(facing),
                    chord * np.sin(half) + after * np.sin(facing),
                    facing,
                )
            )
    x, y, facing = np.array(parts).transpose(1, 0, 2)
    return np.array(pairs), np.array(lengths), x, y, facing


PAIRS, ARC_STEPS, AHEAD, ASIDE, FACING = courses()
FORWARD = PAIRS.sum(axis=1) > 0.0
ARCS = np.flatnonzero(TIMES[-1] > ARC_STEPS)  # those before lines to places
STATE = {}


def reset(obs):  # noqa: ARG001
    """Forgets everything."""
    STATE["maps"], STATE["scans"], STATE["turn"] = None, [], 0.0


def lattice(tips):
    """Angle of the map's rows in the start frame; None if the hits do not tell.

    Walls are px, and a start is in the middle of one: hits lie between two px.
    """
    if len(tips) < 7:
        return None
    angles = np.arange(0.0, 0.5 * math.pi, 4e-4)
    for step in (4e-4, 2e-5, 1e-6):
        cosines, sines = np.cos(angles)[:, None], np.sin(angles)[:, None]
        x = cosines * tips[:, 0] - sines * tips[:, 1]
        y = sines * tips[:, 0] + cosines * tips[:, 1]
        x, y = np.abs(x - np.floor(x) - 0.5), np.abs(y - np.floor(y) - 0.5)
        gaps = np.minimum(x, y)
        score = np.minimum(gaps, 0.05).sum(axis=1)
        best = int(score.argmin())
        angle = float(angles[best])
        angles = angle + step * np.arange(-1.5, 1.5, 0.05)
    return angle if (gaps[best] < 3e-4).mean() > 0.99 else None


def turns_left(near, x, y, facing, left):
    """Price of the turn into the way that is still to come."""
    dx, dy = LOOK * np.cos(facing), LOOK * np.sin(facing)
    ahead = near.left(x + dx, y + dy)
    if ROUND:
        ahead = np.minimum(ahead, near.left(x - dx, y - dy))
    return TURN * np.clip((ahead - left) / LOOK + 1.0, 0.0, 2.0)


def fears(room, seen):
    """Price of courses that come near to hits or unseen space."""
    close = np.clip(WISH - room, 0.0, WISH).max(axis=1)
    return FEAR * (close + np.clip(0.3 - seen, 0.0, WISH).max(axis=1))


def best_arc(near, x, y, heading, slack):
    """The best course that begins with an arc: price, action, unseen place or None."""
    goal = near.maps.goal
    cosine, sine = math.cos(heading), math.sin(heading)
    px, py = x + cosine * AHEAD - sine * ASIDE, y + sine * AHEAD + cosine * ASIDE
    room, seen = near.room(px, py), near.seen(px, py)
    fits = np.logical_and.accumulate(room >= MARGIN, axis=1)
    fear = fears(room[:, :SOON], seen[:, :NEXT])
    seen = seen >= -slack
    ready = seen[:, :NEXT].all(axis=1)
    if not ROUND:
        fits[~FORWARD] &= np.logical_and.accumulate(seen[~FORWARD], axis=1)
    there = fits & ready[:, None]
    there &= np.hypot(px - goal[0], py - goal[1]) <= 0.97 * TOLERANCE
    if there.any():
        first = np.where(there.any(axis=1), there.argmax(axis=1), len(TIMES))
        return -1.0, PAIRS[int(first.argmin())], None
    left = near.left(px, py)
    worth = left + STEP * TIMES + turns_left(near, px, py, heading + FACING, left)
    worth = np.where(fits, worth, np.inf)[:, SOON - 1 :].min(axis=1)
    worth += PEEK * ~ready + fear
    k = int(worth.argmin())
    unseen = None if ready[k] else (px[k, :NEXT], py[k, :NEXT])
    return float(worth[k]), PAIRS[k], unseen


def exact_turns(chain, x, y, heading):
    """Steps that turn to places of the way and, at various speeds, drive on.

    Returns the actions, and x, y, heading at TIMES from a pose at the origin.
    """
    dx, dy = chain.x[chain.at :] - x, chain.y[chain.at :] - y
    turn = np.arctan2(dy, dx) - heading
    back = np.rint(turn / math.pi)
    turn = np.clip(turn - math.pi * back, -SPIN, SPIN)
    drive = np.where(back % 2 == 0, 1.0, -1.0) * np.minimum(
        1.0 - np.abs(turn) / SPIN, np.hypot(dx, dy) / STEP
    )
    drive, turn = np.concatenate([drive, 0.4 * drive, 0.0 * drive]), np.tile(turn, 3)
    time = np.minimum(TIMES, 1.0)
    half = 0.5 * turn[:, None] * time
    chord = STEP * drive[:, None] * time * np.sinc(half / math.pi)
    pairs = np.column_stack([drive + turn / SPIN, drive - turn / SPIN])
    return pairs, chord * np.cos(half), chord * np.sin(half), 2.0 * half


def best_chain(near, x, y, heading, slack):
    """The best arc before a turn and a line to a place of the way; as `best_arc`."""
    chain = near.maps.chain
    exact = exact_turns(chain, x, y, heading)
    courses = PAIRS[ARCS], AHEAD[ARCS], ASIDE[ARCS], FACING[ARCS]
    pairs, ahead, aside, facing = (
        np.concatenate(both) for both in zip(courses, exact, strict=True)
    )
    steps = np.append(ARC_STEPS[ARCS], np.ones(len(exact[0])))
    cosine, sine = math.cos(heading), math.sin(heading)
    px, py = x + cosine * ahead - sine * aside, y + sine * ahead + cosine * aside
    on_arc = steps[:, None] >= TIMES
    room, seen = near.room(px, py), near.seen(px, py)
    fits = ((room >= MARGIN) | ~on_arc).all(axis=1)
    some = np.flatnonzero(fits & (np.abs(pairs).max(axis=1) > 0.02))  # none that waits
    if not some.size:
        return math.inf, None, None
    fear = fears(np.where(on_arc, room, WISH)[:, :SOON], seen[:, :NEXT])
    ready = (seen[:, :NEXT] >= -slack).all(axis=1)
    before = STEP * steps + PEEK * ~ready + fear
    end = some, np.searchsorted(TIMES, steps)[some]
    price, k = chain.best(px[end], py[end], heading + facing[end], before[some])
    k = some[k]
    unseen = None if ready[k] else (px[k, :NEXT], py[k, :NEXT])
    return price, pairs[k], unseen


def best_line(near, x, y, heading, slack):
    """The best turn on the spot and straight line: price, action, unseen or None."""
    bearings = heading + TURNS
    px = x + np.outer(np.cos(bearings), LENGTHS)
    py = y + np.outer(np.sin(bearings), LENGTHS)
    room, seen = near.room(px, py), near.seen(px, py)
    fits = np.logical_and.accumulate(room >= MARGIN, axis=1)
    fear = fears(room[:, 1:16], seen[:, 1:4])
    seen = seen >= -slack
    left = near.left(px, py)
    best = math.inf, None, None
    for sign, spins in (1.0, FULL_SPINS), (-1.0, np.roll(FULL_SPINS, 60)):
        able = fits
        if sign < 0.0 and not ROUND:
            able = fits & np.logical_and.accumulate(seen, axis=1)
        spun = np.where(
            np.abs(spins) < 1e-6, 0.0, STEP * np.maximum(np.abs(spins) / SPIN, 1.0)
        )
        facing = bearings if sign > 0.0 else bearings + math.pi
        worth = left + LENGTHS + spun[:, None]
        worth += turns_left(near, px, py, facing[:, None], left)
        worth = np.where(able, worth, np.inf)[:, LENGTHS >= 6.0]
        ready = seen[:, LENGTHS <= STEP].all(axis=1)
        price = worth.min(axis=1) + PEEK * ~ready + fear
        k = int(price.argmin())
        if price[k] < best[0]:
            share = min(max(spins[k] / SPIN, -1.0), 1.0)
            pair, unseen = (share, -share), None
            if spun[k] == 0.0:
                pair = sign, sign
                if not ready[k]:
                    some = LENGTHS <= STEP
                    unseen = px[k, some], py[k, some]
            best = float(price[k]), np.array(pair), unseen
    return best


def look(near, x, y, heading, unseen):
    """A turn on the spot towards the unseen place that is in the way."""
    px, py = unseen
    places = near.places
    gaps = np.hypot(places[:, :1] - px, places[:, 1:] - py).min(axis=1)
    dx, dy = (places[int(gaps.argmin())] - (x, y)).tolist()
    bearing = math.remainder(math.atan2(dy, dx) - heading, 2.0 * math.pi)
    if ROUND:
        turn = bearing - FAN[np.abs(FAN - bearing).argmin()]
    else:
        turn = math.copysign(max(abs(bearing) - 0.48 * VIEW, 0.15), bearing)
    share = min(max(turn / SPIN, -1.0), 1.0)
    return share, -share


def scanner_at(x, y, heading):
    """The place where the rays start, for the robot's centre at a place."""
    cosine, sine = math.cos(heading), math.sin(heading)
    ahead, aside = OFFSET
    return x + ahead * cosine - aside * sine, y + ahead * sine + aside * cosine


def tips_of(x, y, heading, ranges):
    """The places that the rays of a scan hit."""
    x, y = scanner_at(x, y, heading)
    angles = heading + FAN
    tips = np.column_stack([x + ranges * np.cos(angles), y + ranges * np.sin(angles)])
    return tips[ranges < RANGE - 1e-3]


def observe(x, y, heading, ranges, goal):
    """Adds a scan; returns the maps, whether a wall is new, and the pose on them."""
    if STATE["maps"] is None:
        STATE["scans"].append((x, y, heading, ranges))
        places = [tips_of(*scan) for scan in STATE["scans"]]
        angle = 0.0 if NOISE else lattice(np.vstack(places))
        scans = STATE["scans"]
        if angle is not None:
            STATE["turn"] = angle
    else:
        scans = [(x, y, heading, ranges)]
    turn = STATE["turn"]
    cosine, sine = math.cos(turn), math.sin(turn)
    maps = STATE["maps"]
    if maps is None:
        maps = Maps(
            [cosine * goal[0] - sine * goal[1], sine * goal[0] + cosine * goal[1]]
        )
        if angle is not None:
            STATE["maps"] = maps
    new = False
    for from_x, from_y, facing, seen in scans:
        x, y = cosine * from_x - sine * from_y, sine * from_x + cosine * from_y
        heading = facing + turn
        new |= maps.add(x, y, heading, seen)
    return maps, new, (x, y, heading)


def best_course(near, x, y, heading, slack):
    """What is driven: price, action, unseen place or None."""
    best = math.inf, None, None
    maps = near.maps
    if math.dist((x, y), maps.goal) <= STEP * TIMES[-1] + TOLERANCE:
        best = best_arc(near, x, y, heading, slack)
        if best[0] < 0.0:
            return best
    if maps.chain is not None:
        chained = best_chain(near, x, y, heading, slack)
        if math.isfinite(chained[0]):
            return chained
    if not math.isfinite(best[0]):
        best = best_arc(near, x, y, heading, slack)
    line = best_line(near, x, y, heading, slack)
    return line if line[0] < best[0] else best


def policy(obs):
    """Wheel speeds (left, right)."""
    x, y, heading = (float(value) for value in obs["pose"])
    ranges = np.asarray(obs["ranges"], float)[ORDER]
    goal = [float(value) for value in obs["goal"]]
    maps, new, (x, y, heading) = observe(x, y, heading, ranges, goal)
    maps.watch(x, y)
    maps.replan(x, y, new)
    near = Near(maps, x, y)
    slack = 0.5 * max(maps.looks - 2, 0)
    price, pair, unseen = best_course(near, x, y, heading, slack)
    if not math.isfinite(price):
        return 0.6, -0.6
    if unseen is not None:
        maps.looks += 1
        return look(near, x, y, heading, unseen)
    if abs(pair[0] + pair[1]) > 0.1:
        maps.looks = 0
    return tuple(float(value) for value in pair)
