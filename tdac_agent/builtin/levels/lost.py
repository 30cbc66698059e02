"""Drives to a goal without a map and without a pose, on wheels that slip.

A Kalman filter holds the pose, the errors of the odometry and the gains of the wheels.
Each scan is matched with the robot's own map: cells that hold the mean of the hits in
them. Where walls are at right angles, lines of hits tell the heading, too. What is
planned, is planned from where the robot will be when the next action takes effect. Arcs
are tried out against the hits, and must begin in space that rays have found free; the
less room their way leaves, the dearer they are. Where the goal is missed, it is sought
where the errors of the pose make it likely.
"""

import json
import math

import numpy as np

with open("params.json") as file:
    PARAMS = json.load(file)
ROBOT, NOISES = PARAMS["robot"], PARAMS.get("disturbances", {})
RADIUS, AXLE, RANGE = ROBOT["radius"], ROBOT["axle_length"], ROBOT["range_max"]
DT, TOLERANCE = PARAMS["dt"], PARAMS["goal_tolerance"]
STEP = ROBOT["max_wheel_speed"] * DT  # px at full speed
FAN = np.array(ROBOT["ray_angles"])  # rad from the heading, an even fan
FAN = np.where(np.abs(FAN) > math.pi, FAN - np.copysign(2.0 * math.pi, FAN), FAN)
ORDER = np.argsort(FAN)  # of the rays, from the left to the right
FAN = FAN[ORDER]
OFFSET = ROBOT.get("scanner_offset") or (0.0, 0.0)  # where the rays start: ahead,
# and to positive angles, px
RAYS, VIEW = FAN.size, max(float(FAN[-1] - FAN[0]), 1e-9)
SLIP = max(NOISES.get("wheel_slip", 0.0) * math.sqrt(0.1 / DT), 0.01)
GAINS = max(NOISES.get("wheel_gains", 0.0), 0.01)
SCALE = max(NOISES.get("odometry_scale", 0.0), 0.005)
ODOMETRY = max(NOISES.get("odometry_noise", 0.0), 0.01)
RAY_NOISE = max(NOISES.get("range_noise", 0.0), 0.002)
DELAY = int(NOISES.get("delay", 0))
FAR = RANGE * (1.0 - 3.0 * RAY_NOISE) - 1e-3  # a ray that reads more has hit nothing
ROUGH = 0.3  # px by which walls differ from lines
PARALLEL, LINES = 0.9, 20  # agreement, and number, of lines that tell the walls' angle
ASKEW, OBLIQUE = 0.01, 0.12  # rad of the walls' angle when it is told; of odd lines
MARGIN, BOLDER = 0.15, 0.04  # px kept from hits, less so by BOLDER a step of waiting
MOVED = 4.0  # px; within less, the robot waits
NEARBY, TRIES = 3.0 * TOLERANCE, 20  # px to the goal, and steps spent there on a place
DRIFT = 0.03, 0.015  # deviation of the goal, aside and along, by its distance
WAIT, PATIENCE = 30, 200  # steps of waiting, after which it is STRICT for some steps
STRICT = -0.6
UNSEEN = 0.2  # how much more an unseen px costs
LOOSE = 0.65  # px by which the search may come too near to a hit
SQUEEZE = 3.0  # the same, where there is no way otherwise
SLIVER = 1.5  # px around hits in which unseen space is no matter
SLACK = 0.7  # px by which the body may come too near to the centre of an unseen px
CHORD = 5.0  # px between two hits that are taken for one borders
ROOM = 1.5 * RADIUS  # clearance from which a px costs nothing extra
REACH = int(ROOM) + 1
PRICE = 0.3  # how much more a px beside a wall costs
CARE = 0.5  # share of this that is saved by driving slowly
PEEK = 6.0  # px that a look costs
RISK = 40.0  # how much more a px costs that is driven in contact
DOUBT = 0.4  # share of the deviation of a hit, and px, that it is taken to be further
UNSURE = 0.3  # px by which pose and map may be wrong
COARSE = 0.6  # the same for the places of the search
CAPPED = 0.6  # share of the slip that is left at full speed
CELL = 2  # px between the places of the search, and the size of a cell of hits
LOOK, TURN = 6.0, 10.0  # px ahead; px that a turn by a right angle costs
WINDOW = 36  # px around the robot in which arcs lie
TRUST = 12.0  # the most hits of 1 px that a cell holds, before it forgets
# Steps after which an arc is looked at: often in the first ones, which will be driven.
TIMES = np.array(
    [0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0]
)
NEXT, SOON = 5, 11  # entries of TIMES up to one and four steps
TURNS = np.arange(120) * (2.0 * math.pi / 120)  # directions of lines from the heading
FULL_SPINS = np.remainder(TURNS + math.pi, 2.0 * math.pi) - math.pi
LENGTHS = np.arange(1, 33) * 0.75  # px
WAYS = np.linspace(0.0, 1.3, 131)  # speeds of a wheel if it could be so fast, in STEP


class Filter:
    """A Kalman filter over what the robot does not know.

    Attributes:
        state: x, y, heading, odometry factors of distance and turn, wheel gains, and
            the direction of the walls, up to right angles.
        spread: Its covariance.
        lines: Sum of the directions of walls, as unit vectors of four times the angle.
        count: How many they are.
    """

    def __init__(self):
        self.state = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0])
        bound = GAINS / math.sqrt(3.0)
        deviations = [1e-3, 1e-3, 1e-4, SCALE, SCALE, bound, bound, 0.0]
        self.spread = np.diag(np.square(deviations))
        self.lines, self.count = 0j, 0

    def pose(self):
        """x, y and heading."""
        return tuple(self.state[:3].tolist())

    def moved(self, wheels, odometry):
        """Takes a step by the command that was driven and what was measured of it."""
        if not np.any(wheels):
            return
        state = np.concatenate([self.state, [0.0, 0.0]])
        left, by_left, left_sd = wheel(float(wheels[0]), float(state[5]))
        right, by_right, right_sd = wheel(float(wheels[1]), float(state[6]))
        state[8], state[9] = 0.5 * (left + right), (left - right) / AXLE
        mix = np.array([[0.5, 0.5], [1.0 / AXLE, -1.0 / AXLE]])
        by_gain = mix * [by_left, by_right]
        spread = np.zeros((10, 10))
        spread[:8, :8] = self.spread
        spread[8:, :8] = by_gain @ self.spread[5:7]
        spread[:8, 8:] = spread[8:, :8].T
        slips = np.diag([left_sd**2 + 1e-4, right_sd**2 + 1e-4])
        spread[8:, 8:] = by_gain @ spread[5:7, 8:] + mix @ slips @ mix.T
        for factor, motion, value in (3, 8, odometry[0]), (4, 9, odometry[1]):
            row = np.zeros(10)
            row[factor], row[motion] = state[motion], state[factor]
            size = max(abs(state[motion]), abs(float(value)))
            noise = (ODOMETRY * size) ** 2 + 1e-5
            gain = spread @ row / (row @ spread @ row + noise)
            state += gain * (float(value) - state[factor] * state[motion])
            spread -= np.outer(gain, row @ spread)
        self.turn_by(state, spread)

    def turn_by(self, state, spread):
        """Moves the pose by distance and turn, the last two values of the state."""
        distance, turn = state[8:].tolist()
        middle = state[2] + 0.5 * turn
        cosine, sine = math.cos(middle), math.sin(middle)
        step = np.eye(10)
        step[0, 2], step[1, 2] = -distance * sine, distance * cosine
        step[0, 8:] = cosine, -0.5 * distance * sine
        step[1, 8:] = sine, 0.5 * distance * cosine
        step[2, 9] = 1.0
        state[:3] += distance * cosine, distance * sine, turn
        self.state = state[:8]
        self.spread = (step @ spread @ step.T)[:8, :8]
        self.spread = 0.5 * (self.spread + self.spread.T)

    def align(self, ranges, hit):
        """Corrects the heading where all walls are parallel or at right angles."""
        angles, sd = wall_angles(ranges, hit)
        known = self.count >= LINES and abs(self.lines) > PARALLEL * self.count
        self.lines += np.exp(4j * (self.state[2] + angles)).sum()
        self.count += angles.size
        if not known:
            self.state[7] = 0.25 * np.angle(self.lines)
            self.spread[7], self.spread[:, 7] = 0.0, 0.0
            self.spread[7, 7] = ASKEW**2
            return
        gaps = 0.25 * np.angle(np.exp(4j * (self.state[2] + angles - self.state[7])))
        near = np.abs(gaps) < 2.0 * OBLIQUE
        if not near.any():
            return
        weights = near / (sd**2 * (1.0 + (gaps / OBLIQUE) ** 2))
        row = np.zeros(8)
        row[2], row[7] = 1.0, -1.0
        gain = self.spread @ row
        gain /= row @ gain + 1.0 / weights.sum()
        self.state = self.state - gain * (weights @ gaps / weights.sum())
        self.spread -= np.outer(gain, row @ self.spread)
        self.spread = 0.5 * (self.spread + self.spread.T)

    def match(self, surfaces, ranges, hit):
        """Corrects the state by a scan and the surfaces that are known."""
        prior, spread = self.state.copy(), self.spread
        distances, fan = ranges[hit], FAN[hit]
        for turn in range(4):
            angles = self.state[2] + fan
            rays = np.column_stack([np.cos(angles), np.sin(angles)])
            offsets = distances[:, None] * rays + scanner_at(0.0, 0.0, self.state[2])
            means, normals, rough, good = surfaces.lines(self.state[:2] + offsets)
            gaps = ((self.state[:2] + offsets - means) * normals).sum(axis=1)
            slant = (rays * normals).sum(axis=1)
            sd = np.sqrt((RAY_NOISE * distances * slant) ** 2 + ROUGH**2 + rough)
            good &= np.abs(gaps) < 2.5 + 3.0 * sd
            if good.sum() < 3:
                return
            weights = good / sd**2 / np.maximum(1.0, np.abs(gaps) / (1.5 * sd)) * 0.6
            lever = normals[:, 1] * offsets[:, 0] - normals[:, 0] * offsets[:, 1]
            slopes = np.column_stack([normals, lever])
            shift = slopes @ (self.state[:3] - prior[:3]) - gaps
            known = slopes.T @ (weights[:, None] * slopes)
            pull = slopes.T @ (weights * shift)
            solved = np.linalg.solve(np.eye(3) + known @ spread[:3, :3], np.eye(3))
            change = prior + spread[:, :3] @ (solved @ pull) - self.state
            self.state = self.state + change
            if turn and np.abs(change[:3]).max() < 0.01:
                break
        self.spread = spread - spread[:, :3] @ solved @ known @ spread[:3]
        self.spread = 0.5 * (self.spread + self.spread.T)


def scanner_at(x, y, heading):
    """The place where the rays start, for the robot's centre at a place."""
    cosine, sine = math.cos(heading), math.sin(heading)
    ahead, aside = OFFSET
    return x + ahead * cosine - aside * sine, y + ahead * sine + aside * cosine


def wall_angles(ranges, hit):
    """Directions, from the heading, of lines of four hits in a row, and deviations."""
    x, y = ranges * np.cos(FAN), ranges * np.sin(FAN)
    dx, dy = x[3:] - x[:-3], y[3:] - y[:-3]
    length = np.maximum(np.hypot(dx, dy), 0.5)
    angles = np.arctan2(dy, dx)
    ends = np.stack([ranges[3:], ranges[:-3]])
    slants = np.sin(np.stack([FAN[3:], FAN[:-3]]) - angles)
    # A line may be off by so much at its ends, and its middle is no further aside.
    aside = np.sqrt(((RAY_NOISE * ends * slants) ** 2 + ROUGH**2).sum(axis=0))
    good = hit[3:] & hit[:-3] & (aside < 0.2 * length)
    for k in 1, 2:
        off = dx * (y[k : k - 3] - y[:-3]) - dy * (x[k : k - 3] - x[:-3])
        good &= hit[k : k - 3] & (np.abs(off) < 1.5 * aside * length)
    return angles[good], (aside / length)[good]


def wheel(command, gain):
    """Mean way of a wheel in a step, its derivative by the gain, and its deviation."""
    way = abs(command) * gain * STEP
    sd = SLIP * way + 1e-6
    z = (STEP - way) / sd
    below = 0.5 * (1.0 + math.erf(z / math.sqrt(2.0)))
    peak = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    mean = STEP - sd * (z * below + peak)
    sd *= CAPPED + (1.0 - CAPPED) * min(max(z, -1.0) / 1.5, 1.0)
    return math.copysign(mean, command), command * STEP * (below - SLIP * peak), sd


MEANS = np.array([wheel(1.0, way)[0] / STEP for way in WAYS])  # what comes of WAYS


class Surfaces:
    """Hits in cells of CELL px: their weight, and the sum of their places."""

    def __init__(self, half):
        self.half = half // CELL
        self.side = 2 * self.half + 1
        self.weight = np.zeros(self.side * self.side)
        self.sums = np.zeros((2, self.side * self.side))
        span = np.arange(-2, 3)
        self.around = (span[:, None] * self.side + span).ravel()

    def index(self, places):
        """Index of the cell of each place."""
        cells = np.rint(places / CELL).astype(int) + self.half
        cells = np.clip(cells, 3, self.side - 4)
        return cells[..., 1] * self.side + cells[..., 0]

    def lines(self, places):
        """Mean, normal and squared roughness of the hits around places, and if any."""
        near = self.index(places)[:, None] + self.around
        weight = self.weight[near]
        held = np.maximum(weight, 1e-9)
        x, y = self.sums[0][near] / held, self.sums[1][near] / held
        far = (x - places[:, :1]) ** 2 + (y - places[:, 1:]) ** 2
        weight = np.minimum(weight, 4.0) * np.exp(-far / 12.0)
        total = weight.sum(axis=1)
        weight /= np.maximum(total, 1e-9)[:, None]
        mx, my = (weight * x).sum(axis=1), (weight * y).sum(axis=1)
        dx, dy = x - mx[:, None], y - my[:, None]
        xx, yy = (weight * dx * dx).sum(axis=1), (weight * dy * dy).sum(axis=1)
        xy = (weight * dx * dy).sum(axis=1)
        root = np.sqrt(0.25 * (xx - yy) ** 2 + xy * xy)
        small, large = 0.5 * (xx + yy) - root, 0.5 * (xx + yy) + root
        angle = 0.5 * np.arctan2(2.0 * xy, xx - yy) + 0.5 * math.pi
        normals = np.column_stack([np.cos(angle), np.sin(angle)])
        good = (total > 0.2) & (large > 0.6) & (large > 6.0 * small)
        return np.column_stack([mx, my]), normals, np.maximum(small, 0.0), good

    def add(self, tips, sd):
        """Adds hits; old ones are forgotten where there are many."""
        at = self.index(tips)
        weight = 1.0 / (0.1 + sd**2) * 0.2
        np.add.at(self.weight, at, weight)
        np.add.at(self.sums[0], at, weight * tips[:, 0])
        np.add.at(self.sums[1], at, weight * tips[:, 1])
        share = np.minimum(TRUST / np.maximum(self.weight[at], 1e-9), 1.0)
        at, first = np.unique(at, return_index=True)
        self.weight[at] *= share[first]
        self.sums[:, at] *= share[first]

    def points(self, x, y, reach):
        """Places of the hits in a square, and the indices of their cells."""
        i, j = round(x / CELL) + self.half, round(y / CELL) + self.half
        k = int(reach / CELL)
        rows = np.arange(max(j - k, 0), min(j + k + 1, self.side))
        columns = np.arange(max(i - k, 0), min(i + k + 1, self.side))
        at = (rows[:, None] * self.side + columns).ravel()
        at = at[self.weight[at] > 0.05]
        return self.sums[:, at] / self.weight[at], at

    def doubt(self, at):
        """How far the hits in cells may be nearer than their walls, px."""
        return np.minimum(DOUBT * np.sqrt(0.2 / self.weight[at]), DOUBT)

    def drop(self, at):
        """Weakens hits that a ray has passed through."""
        self.weight[at] *= 0.6
        self.sums[:, at] *= 0.6
        gone = at[self.weight[at] < 0.05]
        self.weight[gone] = 0.0
        self.sums[:, gone] = 0.0


class Maps:
    """What is known in a square around the start, in px.

    Attributes:
        half: Index of the start.
        surfaces: The hits.
        free: Whether rays or the body have found a px free.
        cost: Cost of the way to the goal, for every CELL-th px.
    """

    def __init__(self, goal):
        self.goal = [float(value) for value in goal]
        half = int(max(320.0, max(map(abs, self.goal)) + 160.0)) // CELL * CELL
        self.half, self.side = half, 2 * half + 1
        self.surfaces = Surfaces(half)
        self.free = np.zeros((self.side, self.side), bool)
        self.cost = np.full((half + 1, half + 1), np.inf)
        self.age, self.rest, self.stale = 0, 0, False
        self.looks = 0

    def square(self, x, y, reach):
        """Slices of the px around a place, and their x and y relative to it."""
        i, j = round(x) + self.half, round(y) + self.half
        i = min(max(i, reach), self.side - 1 - reach)
        j = min(max(j, reach), self.side - 1 - reach)
        around = np.arange(-reach, reach + 1)
        rows, columns = slice(j - reach, j + reach + 1), slice(i - reach, i + reach + 1)
        return rows, columns, around + (i - self.half - x), around + (j - self.half - y)

    def carve(self, x, y, heading, ranges, hit):
        """Marks as free what the rays have crossed, and the place of the body."""
        rows, columns, dx, dy = self.square(x, y, int(RADIUS) + 1)
        within = dx[None, :] ** 2 + dy[:, None] ** 2 <= RADIUS * RADIUS
        self.free[rows, columns] |= within
        x, y = scanner_at(x, y, heading)
        rows, columns, dx, dy = self.square(x, y, int(RANGE) + 1)
        dx, dy = dx[None, :], dy[:, None]
        cosine, sine = math.cos(heading), math.sin(heading)
        ahead, aside = cosine * dx + sine * dy, cosine * dy - sine * dx
        distance = np.sqrt(ahead * ahead + aside * aside)
        part = self.free[rows, columns]
        seen = np.nonzero((ahead > -0.1 * distance) & (distance <= RANGE))
        ahead, aside, distance = ahead[seen], aside[seen], distance[seen]
        place = (np.arctan2(aside, ahead) - FAN[0]) * ((RAYS - 1) / VIEW)
        place = np.clip(place, 0.0, RAYS - 1)
        k = np.minimum(place.astype(int), RAYS - 2)
        least = np.minimum(ranges[:-1], ranges[1:])
        tx, ty = ranges * np.cos(FAN), ranges * np.sin(FAN)
        # A px is before the chord of two hits on one borders, or nearer than both hits.
        nx, ny = np.diff(ty), -np.diff(tx)
        gap = np.hypot(nx, ny)
        borders = hit[:-1] & hit[1:] & (gap < CHORD)
        before = nx[k] * (ahead - tx[k]) + ny[k] * (aside - ty[k]) <= 0.0
        is_free = np.where(borders[k], before, distance <= least[k])
        nearest = np.minimum((place + 0.5).astype(int), RAYS - 1)
        on_ray = np.abs(place - nearest) * distance * (VIEW / (RAYS - 1)) < 0.5
        is_free |= on_ray & (distance <= ranges[nearest] - 0.7)
        part[seen] |= is_free

    def clean(self, x, y, heading, ranges):
        """Weakens hits that rays pass through, and those within the body."""
        (px, py), at = self.surfaces.points(x, y, RANGE)
        within = np.hypot(px - x, py - y) < RADIUS - 1.0
        x, y = scanner_at(x, y, heading)
        dx, dy = px - x, py - y
        distance = np.hypot(dx, dy)
        bearing = np.remainder(np.arctan2(dy, dx) - heading + math.pi, 2.0 * math.pi)
        place = (bearing - math.pi - FAN[0]) * ((RAYS - 1) / VIEW)
        nearest = np.clip(np.rint(place).astype(int), 0, RAYS - 1)
        beside = np.abs(place - nearest) * distance * (VIEW / (RAYS - 1))
        reading = ranges[nearest]
        passed = (beside < 0.5) & (distance < reading - 1.5 - 3.0 * RAY_NOISE * reading)
        passed |= within
        if passed.any():
            self.surfaces.drop(at[passed])

    def plan(self, x, y, slack):
        """Costs of the way to the goal, up to somewhat beyond the robot."""
        (px, py), at = self.surfaces.points(0.0, 0.0, self.half)
        side = self.half + 1
        away = np.full(side * side, ROOM)
        dx, dy = px + self.half, py + self.half
        i, j = at % side, at // side
        some = (i > 6) & (j > 6) & (i < side - 7) & (j < side - 7)
        at, dx, dy = at[some], (dx - CELL * i)[some], (dy - CELL * j)[some]
        doubt = self.surfaces.doubt(at)
        for k in range(-6, 7):
            for m in range(-6, 7):
                if k * k + m * m > 40:
                    continue
                to = at + k * side + m
                far = np.hypot(CELL * m - dx, CELL * k - dy) + doubt
                away[to] = np.minimum(away[to], far)
        away = away.reshape(side, side)
        price = 1.0 + PRICE * np.clip((ROOM - away) / (ROOM - RADIUS), 0.0, 1.0) ** 2
        price += risk(away + LOOSE - RADIUS, COARSE)
        price += UNSEEN * ~self.free[::CELL, ::CELL]
        passable = away >= RADIUS - slack
        passable[:3], passable[-3:], passable[:, :3], passable[:, -3:] = (False,) * 4
        around = CELL * (np.arange(side) - self.half // CELL)
        gaps = np.hypot(around[None, :] - self.goal[0], around[:, None] - self.goal[1])
        least = max(TOLERANCE, float(gaps[passable].min()) + 1.0)
        starts = np.nonzero((passable & (gaps <= least)).ravel())[0]
        self.cost[:] = wave(
            passable, price, starts, gaps.ravel()[starts], self.cell(x, y)
        )

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


def wave(passable, price, starts, first_costs, robot, beyond=48.0):
    """Costs to the goal over places, in bands of equal cost; inf where there is no way.

    Stops somewhat beyond the robot. No move is shorter than a band is wide, so each
    band is final when its turn comes.
    """
    width = passable.shape[1]
    shifts, lengths, first, second = (
        np.array(each) for each in zip(*moves(width), strict=True)
    )
    lengths = 0.5 * lengths
    passable, price = passable.ravel(), price.ravel()
    cost = np.full(passable.shape, np.inf)
    until = math.inf
    target = robot[0] * width + robot[1]
    around = target + np.array([0, 1, -1, width, -width])
    cost[starts] = first_costs
    bands, band = {}, 0
    for k in np.unique((first_costs / CELL).astype(int)).tolist():
        bands[k] = [starts[(first_costs / CELL).astype(int) == k]]
    while bands and band * CELL < until:
        parts = bands.pop(band, None)
        band += 1
        if parts is None:
            continue
        at = np.concatenate(parts)
        so_far = cost[at]
        at = np.unique(at[so_far >= (band - 1) * CELL])
        to = at[:, None] + shifts
        further = cost[at][:, None] + lengths * (price[at][:, None] + price[to])
        better = passable[to] & (further < cost[to])
        better &= passable[at[:, None] + first] & passable[at[:, None] + second]
        to, further = to[better], further[better]
        if not to.size:
            continue
        np.minimum.at(cost, to, further)
        where = (further * (1.0 / CELL)).astype(int)
        for k in range(int(where.min()), int(where.max()) + 1):
            some = to[where == k]
            if some.size:
                bands.setdefault(k, []).append(some)
        if until == math.inf and np.isfinite(cost[around]).any():
            until = float(cost[around].min()) + beyond
    return cost.reshape(-1, width)


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


def between(field, x, y, half, half_y, scale=1.0):
    """The field between its places, by bilinear interpolation."""
    height, width = field.shape
    x = np.clip(x / scale + half, 0.0, width - 1.001)
    y = np.clip(y / scale + half_y, 0.0, height - 1.001)
    i, j = x.astype(int), y.astype(int)
    u, v = x - i, y - j
    flat, at = field.ravel(), j * width + i
    top = flat[at] * (1.0 - u) + flat[at + 1] * u
    at += width
    return top * (1.0 - v) + (flat[at] * (1.0 - u) + flat[at + 1] * u) * v


class Near:
    """The maps around the robot, as the arcs need them."""

    def __init__(self, maps, x, y):
        self.maps = maps
        rows, columns, dx, dy = maps.square(x, y, WINDOW)
        self.x0, self.y0 = dx[0] + x, dy[0] + y
        self.hits = self.distances(x, y)
        unseen = ~maps.free[rows, columns] & (self.hits > SLIVER)
        self.places = np.argwhere(unseen)[:, ::-1] + [self.x0, self.y0]
        self.unseen = clearances(unseen, int(RADIUS) + 1)
        half, reach = maps.half // CELL, WINDOW // CELL + 6
        j, i = maps.cell(x, y)
        i, j = max(i - reach, 0), max(j - reach, 0)
        part = maps.cost[j : j + 2 * reach + 1, i : i + 2 * reach + 1]
        self.part, self.i, self.j = extended(part, 4), half - i, half - j

    def distances(self, x, y):
        """Distance to the nearest hit from each px of the window, at most REACH."""
        points, at = self.maps.surfaces.points(x, y, WINDOW + REACH)
        doubts = self.maps.surfaces.doubt(at)
        side = 2 * WINDOW + 1
        pad = 2 * REACH
        field = np.full((side + 2 * pad, side + 2 * pad), float(REACH))
        span = np.arange(-REACH, REACH + 1)
        places = points.T - [self.x0, self.y0] + pad
        for (px, py), doubt in zip(places.tolist(), doubts.tolist(), strict=True):
            i, j = round(px), round(py)
            if not (REACH <= i < side + 3 * REACH and REACH <= j < side + 3 * REACH):
                continue
            part = field[j - REACH : j + REACH + 1, i - REACH : i + REACH + 1]
            across, down = (span + (i - px)) ** 2, (span + (j - py)) ** 2
            away = np.sqrt(across[None, :] + down[:, None]) + doubt
            np.minimum(part, away, out=part)
        return field[pad : pad + side, pad : pad + side]

    def room(self, x, y):
        """Room between the body and hits, px."""
        return between(self.hits, x, y, -self.x0, -self.y0) - RADIUS

    def seen(self, x, y):
        """Room between the body and unseen space, px."""
        return between(self.unseen, x, y, -self.x0, -self.y0) - RADIUS

    def left(self, x, y):
        """Cost of the way to the goal."""
        return between(self.part, x, y, self.i, self.j, CELL)


def clearances(cells, reach):
    """Distance from each px to the nearest one that is set, at most reach."""
    padded = np.pad(cells, reach)
    height, width = cells.shape
    away = np.full((padded.shape[0], width), float(reach))
    for k in range(reach, -1, -1):
        for shift in (-k, k):
            away[padded[:, reach + shift : reach + shift + width]] = k
    away *= away
    best = np.full((height, width), float(reach) ** 2)
    for k in range(-reach, reach + 1):
        np.minimum(best, away[reach + k : reach + k + height] + k * k, out=best)
    return np.sqrt(best)


def wheel_pairs():
    """Speeds of the wheels to try: one at full speed, or both slower."""
    ends = np.concatenate([np.linspace(-1.0, 0.6, 9), np.linspace(0.7, 1.0, 13)])
    pairs = [(1.0, e) for e in ends] + [(e, 1.0) for e in ends]
    pairs += [(0.6 * a, 0.6 * b) for a, b in pairs[::2]]
    pairs += [(0.3 * a, 0.3 * b) for a, b in pairs[:44:4]]
    return np.array(pairs + [(-a, -b) for a, b in pairs[::2]])


class Courses:
    """An arc of one, two, four or all steps and then a straight line, at TIMES.

    Attributes:
        pairs: Speeds of the wheels, as fractions of the robot's best speed.
        ahead, aside, facing: The pose, from one at the origin.
        spread: How far the body may be off by slip, px.
    """

    def __init__(self, step):
        self.step = step
        pairs, parts, sizes = [], [], []
        for left, right in wheel_pairs():
            forward, turn = 0.5 * step * (left + right), step * (left - right) / AXLE
            line = step * max(abs(left), abs(right))
            for steps in (1.0, 2.0, 4.0, TIMES[-1]):
                on_arc = np.minimum(TIMES, steps)
                half = 0.5 * turn * on_arc
                chord = forward * on_arc * np.sinc(half / math.pi)
                after = math.copysign(line, forward) * (TIMES - on_arc)
                facing = turn * on_arc
                pairs.append((left, right))
                ahead = chord * np.cos(half) + after * np.cos(facing)
                aside = chord * np.sin(half) + after * np.sin(facing)
                parts.append((ahead, aside, facing))
                sizes.append((0.5 * step * (abs(left) + abs(right)), abs(forward)))
        self.pairs = np.array(pairs)
        self.ahead, self.aside, self.facing = np.array(parts).transpose(1, 0, 2)
        size = np.array(sizes)[:, :1]
        slip = CAPPED * SLIP / math.sqrt(2.0)
        self.spread = slip * size * np.sqrt(np.minimum(TIMES, 3.0))
        steps = np.diff([self.ahead, self.aside], prepend=0.0)
        hurry = np.abs(self.pairs).max(axis=1)[:, None]
        self.ways = np.hypot(*steps) * (1.0 - CARE + CARE * hurry)
        self.forward = self.pairs.sum(axis=1) > 0.0


STATE = {}


def reset(obs):
    """Forgets everything."""
    goal = np.asarray(obs["goal"], float)
    steps = np.arange(-9, 10) * 0.5 * TOLERANCE
    aside, along = (each.ravel() for each in np.meshgrid(steps, steps))
    away = max(float(np.hypot(*goal)), 1.0)
    chance = np.hypot(aside / (2.0 + DRIFT[0] * away), along / (2.0 + DRIFT[1] * away))
    aside, along = aside[:, None] / away, along[:, None] / away
    STATE.update(
        places=goal + aside * (-goal[1], goal[0]) + along * goal,
        chance=np.exp(-0.5 * chance**2),
        maps=Maps(obs["goal"]),
        filter=Filter(),
        courses=Courses(STEP),
        queue=[(0.0, 0.0)] * DELAY,
        waits=0,
        strict=0,
        tries=0,
        place=(0.0, 0.0),
        steps=0,
    )


def turns_left(near, x, y, facing, left):
    """Price of the turn into the way that is still to come, forwards."""
    ahead = near.left(x + LOOK * np.cos(facing), y + LOOK * np.sin(facing))
    return TURN * np.clip((ahead - left) / LOOK + 1.0, 0.0, 2.0)


def risk(room, spread):
    """How much more a px costs on which the body may touch something."""
    return RISK * np.exp(-0.5 * (np.maximum(room, 0.0) / spread) ** 2)


def best_arc(near, courses, x, y, heading, slack, unsure):
    """The best course that begins with an arc: price, speeds, unseen place or None."""
    goal = near.maps.goal
    cosine, sine = math.cos(heading), math.sin(heading)
    px = x + cosine * courses.ahead - sine * courses.aside
    py = y + sine * courses.ahead + cosine * courses.aside
    room = near.room(px, py)
    fits = np.logical_and.accumulate(room >= near.margin, axis=1)
    seen = near.seen(px, py) >= -slack
    ready = seen[:, :NEXT].all(axis=1)
    back = ~courses.forward
    fits[back] &= np.logical_and.accumulate(seen[back], axis=1)
    danger = risk(room, np.hypot(courses.spread, unsure)) * courses.ways
    there = fits & ready[:, None]
    there &= np.hypot(px - goal[0], py - goal[1]) <= 0.6 * TOLERANCE
    left = near.left(px, py)
    worth = left + courses.step * TIMES + np.cumsum(danger, axis=1)
    worth += turns_left(near, px, py, heading + courses.facing, left)
    worth = np.where(there, worth - left - 20.0, worth)
    able = np.where(fits, worth, np.inf)
    worth = np.where(there, able, np.inf).min(axis=1)
    worth = np.minimum(able[:, SOON - 1 :].min(axis=1), worth) + PEEK * ~ready
    k = int(worth.argmin())
    unseen = None if ready[k] else (px[k, :NEXT], py[k, :NEXT])
    return float(worth[k]), courses.pairs[k], unseen


def best_line(near, courses, x, y, heading, slack, unsure):
    """The best turn on the spot and straight line: price, speeds, unseen or None."""
    bearings = heading + TURNS
    px = x + np.outer(np.cos(bearings), LENGTHS)
    py = y + np.outer(np.sin(bearings), LENGTHS)
    room = near.room(px, py)
    fits = np.logical_and.accumulate(room >= near.margin, axis=1)
    danger = np.cumsum(risk(room, math.hypot(unsure, 0.3)) * LENGTHS[0], axis=1)
    seen = near.seen(px, py) >= -slack
    left = near.left(px, py)
    spin = 2.0 * courses.step / AXLE
    best = math.inf, None, None
    for sign, spins in (1.0, FULL_SPINS), (-1.0, np.roll(FULL_SPINS, 60)):
        able = fits if sign > 0.0 else fits & np.logical_and.accumulate(seen, axis=1)
        spun = courses.step * np.maximum(np.abs(spins) / spin, 1.0)
        spun[np.abs(spins) < 1e-6] = 0.0
        facing = bearings if sign > 0.0 else bearings + math.pi
        worth = left + LENGTHS + spun[:, None] + danger
        worth += turns_left(near, px, py, facing[:, None], left)
        worth = np.where(able, worth, np.inf)[:, LENGTHS >= 6.0]
        ready = seen[:, courses.step >= LENGTHS].all(axis=1)
        price = worth.min(axis=1) + PEEK * ~ready
        k = int(price.argmin())
        if price[k] < best[0]:
            share = min(max(spins[k] / spin, -1.0), 1.0)
            pair, unseen = (share, -share), None
            if spun[k] == 0.0:
                pair = sign, sign
                if not ready[k]:
                    some = courses.step >= LENGTHS
                    unseen = px[k, some], py[k, some]
            best = float(price[k]), np.array(pair), unseen
    return best


def look(near, x, y, heading, unseen, spin):
    """A turn on the spot towards the unseen place that is in the way."""
    px, py = unseen
    places = near.places
    gaps = np.hypot(places[:, :1] - px, places[:, 1:] - py).min(axis=1)
    dx, dy = (places[int(gaps.argmin())] - (x, y)).tolist()
    bearing = math.remainder(math.atan2(dy, dx) - heading, 2.0 * math.pi)
    turn = math.copysign(max(abs(bearing) - 0.35 * VIEW, 0.15), bearing)
    share = min(max(turn / spin, -1.0), 1.0)
    return share, -share


def away_from_hits(near, courses, x, y, heading):
    """Speeds of the short arc that leaves most room at its end."""
    cosine, sine = math.cos(heading), math.sin(heading)
    ahead, aside = courses.ahead[:, :NEXT], courses.aside[:, :NEXT]
    px, py = x + cosine * ahead - sine * aside, y + sine * ahead + cosine * aside
    room = near.room(px, py)
    slow = np.abs(courses.pairs).max(axis=1) < 0.7
    value = room[:, -1] + np.minimum(room.min(axis=1) - float(room[0, 0]), 0.0)
    return courses.pairs[int(np.where(slow, value, -np.inf).argmax())]


def search(maps, x, y):
    """Chooses where to drive, of the places where the goal may be.

    The goal is none of the places that the robot has reached by its own belief.
    """
    places, chance = STATE["places"], STATE["chance"]
    gap = math.hypot(x - maps.goal[0], y - maps.goal[1])
    STATE["tries"] += gap < NEARBY
    reached = np.hypot(*(places - (x, y)).T) < 0.7 * TOLERANCE
    if STATE["tries"] > TRIES:
        STATE["tries"] = 0
        reached |= np.hypot(*(places - maps.goal).T) < 0.7 * TOLERANCE
    if not reached.any():
        return
    chance[reached] = 0.0
    if not chance.any():
        chance[:] = 1.0
    apart = np.hypot(*(places[:, None] - places).transpose(2, 0, 1))
    worth = (apart < TOLERANCE) @ chance / (TOLERANCE + np.hypot(*(places - (x, y)).T))
    worth[chance == 0.0] = 0.0
    target = places[int(worth.argmax())].tolist()
    if target != maps.goal:
        maps.goal, maps.stale, STATE["tries"] = target, True, 0


def expected(pose, gains, queue):
    """The pose after the actions that are still on their way, and how far slip goes."""
    x, y, heading = pose
    spread = 0.0
    for action in queue:
        left, right = (wheel(c, g)[0] for c, g in zip(action, gains, strict=True))
        way, turn = 0.5 * (left + right), (left - right) / AXLE
        x += way * math.cos(heading + 0.5 * turn)
        y += way * math.sin(heading + 0.5 * turn)
        heading += turn
        spread = math.hypot(spread, SLIP * 0.5 * (abs(left) + abs(right)))
    return x, y, heading, spread


def commands(pair, gains, best):
    """Commands that let the wheels turn at these shares of the best speed."""
    ways = np.interp(np.abs(pair) * best, MEANS, WAYS) / gains
    return np.copysign(np.minimum(ways, 1.0), pair).tolist()


def policy(obs):
    """Commands of the wheels (left, right)."""
    maps, filter_ = STATE["maps"], STATE["filter"]
    ranges = np.asarray(obs["ranges"], float)[ORDER]
    hit = ranges < FAR
    filter_.moved(np.asarray(obs["wheel_speeds"], float), obs["odometry"])
    filter_.align(ranges, hit)
    if STATE["steps"]:
        filter_.match(maps.surfaces, ranges, hit)
    STATE["steps"] += 1
    x, y, heading = filter_.pose()
    angles = heading + FAN
    from_x, from_y = scanner_at(x, y, heading)
    tips = np.column_stack(
        [from_x + ranges * np.cos(angles), from_y + ranges * np.sin(angles)]
    )
    maps.clean(x, y, heading, ranges)
    maps.surfaces.add(tips[hit], RAY_NOISE * ranges[hit])
    maps.carve(x, y, heading, ranges, hit)
    gains = filter_.state[5:7].tolist()
    best = min(wheel(1.0, gain)[0] for gain in gains) / STEP
    courses = STATE["courses"]
    if abs(courses.step - best * STEP) > 0.03 * STEP:
        courses = STATE["courses"] = Courses(best * STEP)
    if math.hypot(x - STATE["place"][0], y - STATE["place"][1]) > MOVED:
        STATE["place"], STATE["waits"] = (x, y), 0
    STATE["waits"] += 1
    if STATE["waits"] > WAIT:
        STATE["waits"], STATE["strict"] = 0, STATE["steps"] + PATIENCE
    x, y, heading, slipped = expected((x, y, heading), gains, STATE["queue"])
    search(maps, x, y)
    maps.age += 1
    if maps.age > maps.rest + (0 if maps.stale or STATE["steps"] < 3 else 3):
        maps.plan(x, y, LOOSE if STATE["steps"] > STATE["strict"] else STRICT)
        if not np.isfinite(maps.cost[maps.cell(x, y)]):
            maps.plan(x, y, SQUEEZE)
        maps.age, maps.stale = 0, False
        maps.rest = int(np.isfinite(maps.cost).sum()) // 6000
    pair = chosen(maps, courses, x, y, heading, math.hypot(UNSURE, slipped))
    left, right = commands(pair, gains, best)
    STATE["queue"] = [*STATE["queue"], (left, right)][1 if DELAY else 0 :][:DELAY]
    return float(left), float(right)


def chosen(maps, courses, x, y, heading, unsure):
    """Speeds of the wheels, as fractions of the robot's best speed."""
    near = Near(maps, x, y)
    near.margin = MARGIN - BOLDER * min(max(STATE["waits"] - 6, 0), 10)
    slack = SLACK + 0.4 * max(maps.looks - 2, 0)
    price, pair, unseen = best_arc(near, courses, x, y, heading, slack, unsure)
    other, line, hidden = best_line(near, courses, x, y, heading, slack, unsure)
    if other < price:
        price, pair, unseen = other, line, hidden
    if not math.isfinite(price):
        maps.stale = True
        return away_from_hits(near, courses, x, y, heading)
    if unseen is not None:
        maps.looks += 1
        return look(near, x, y, heading, unseen, 2.0 * courses.step / AXLE)
    if abs(pair[0] + pair[1]) > 0.1:
        maps.looks = 0
    return pair
