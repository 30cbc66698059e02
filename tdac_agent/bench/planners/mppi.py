"""Model predictive path integral control on a grid with a navigation function.

G. Williams, A. Aldrich and E. A. Theodorou, "Model predictive path integral control:
from theory to parallel computation", Journal of Guidance, Control, and Dynamics 40(2),
2017, with a global plan as in ROS move_base (E. Marder-Eppstein et al., "The office
marathon", ICRA 2010).

An obstacle layer holds the hits of the scans, marked and cleared, over the map if one
is given; what has not been seen counts as free. Dijkstra's costs of the way to the goal
over it are the navigation function. In each step, noise is added to the last sequence
of commands; the new one is the mean of all samples, weighted by the exponential of
their costs: way that is left, walls that are near, contacts. If the robot gets no
further, it clears the obstacle layer and turns on the spot. It drives backwards only if
it sees all around or has a map. Without a pose, it is located by dead reckoning.
"""

import json
import math

import numpy as np

with open("params.json") as file:
    PARAMS = json.load(file)
ROBOT = PARAMS["robot"]
RADIUS, AXLE, RANGE = ROBOT["radius"], ROBOT["axle_length"], ROBOT["range_max"]
SPEED, DT = ROBOT["max_wheel_speed"], PARAMS["dt"]
DELAY, RAYS = PARAMS["disturbances"]["delay"], ROBOT["n_rays"]
VIEW = math.radians(ROBOT["field_of_view_deg"])
FAN = np.linspace(-VIEW / 2.0, VIEW / 2.0, RAYS)

NOISE_AHEAD = 0.4
"""Standard deviation of the noise of the speed ahead, as a share of the full speed."""
NOISE_TURN = 0.3
"""Standard deviation of the noise of the turn, as a share of the full turn."""
TEMPERATURE = 1.0
"""Difference of costs for which the weight of a sample is less by a factor of e, px."""
STAGE = 1.0
"""Weight of the mean way that is left during a sample; that at its end weighs 1."""
WALL = 10.0
"""Cost of driving beside a wall, px."""
CONTACT = 1000.0
"""Cost of touching an obstacle from the first step on, px."""
MARGIN = 0.3
"""Room that a sample keeps to obstacles, px."""
ROOM = 6.0
"""Clearance beyond the body from which obstacles cost nothing, px."""
INFLATION = 1.0
"""How much more the way costs beside an obstacle, as a factor."""
MEMORY = 1000.0
"""Time after which a hit is forgotten, s; looked at after each plan."""

SAMPLES = 128
"""Sequences of commands that are tried out in a step."""
STEPS = 12
"""Steps of a sequence."""
HOLD = 3
"""Steps for which a random number stays the same."""
SHARE = 16
"""Samples around standing still instead of the last sequence."""

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

    def ahead(self, commands):
        """The pose after commands that have not taken effect yet."""
        later = Odometer()
        later.x, later.y, later.heading = self.x, self.y, self.heading
        for left, right in commands:
            later.move(
                (left + right) / 2.0 * SPEED * DT, (left - right) * SPEED * DT / AXLE
            )
        return later


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

    def scan(self, x, y, heading, ranges, now):
        """Clears what the rays pass, and marks what they hit."""
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
        hit = ranges < RANGE - 1e-3
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
        price = 1.0 + INFLATION * np.clip(1.0 - room / ROOM, 0.0, 1.0) ** 2
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


SEES = PARAMS["map"] or ROBOT["field_of_view_deg"] > 300.0  # also behind
LEAST = -math.inf if SEES else 0.0  # speed ahead, as a share
STATE = {}


def sampled(nominal):
    """Sequences of (ahead, turn) as shares around the last one: SAMPLES x STEPS x 2."""
    blocks = -(-STEPS // HOLD)
    noise = STATE["rng"].standard_normal((SAMPLES, blocks, 2))
    noise = np.repeat(noise, HOLD, axis=1)[:, :STEPS] * (NOISE_AHEAD, NOISE_TURN)
    noise[0] = 0.0  # the last sequence itself
    noise[:-SHARE] += nominal
    ahead = np.maximum(noise[..., 0], LEAST)
    left = np.clip(ahead + noise[..., 1], -1.0, 1.0)
    right = np.clip(ahead - noise[..., 1], -1.0, 1.0)
    return np.stack([left + right, left - right], axis=2) / 2.0


def costs(grid, pose, sequences):
    """Costs of sequences, px."""
    turns = sequences[..., 1] * (2.0 * SPEED * DT / AXLE)
    heading = pose.heading + np.cumsum(turns, axis=1) - turns / 2.0
    length = sequences[..., 0] * SPEED * DT
    dx, dy = length * np.cos(heading), length * np.sin(heading)
    x, y = pose.x + np.cumsum(dx, axis=1), pose.y + np.cumsum(dy, axis=1)
    here = grid.clearance(np.array([pose.x]), np.array([pose.y]))[0]
    least = min(RADIUS + MARGIN, float(here) - 1e-3)
    room = np.minimum(grid.clearance(x, y), grid.clearance(x - dx / 2.0, y - dy / 2.0))
    there = np.hypot(x - grid.goal[0], y - grid.goal[1]) < PARAMS["goal_tolerance"]
    there = np.logical_or.accumulate(there, axis=1)
    contact = np.logical_or.accumulate((room < least) & ~there, axis=1)
    left = np.where(there, 0.0, grid.to_go(x, y))
    wall = np.where(there, 0.0, np.clip(1.0 - (room - RADIUS) / ROOM, 0.0, 1.0) ** 2)
    return (
        left[:, -1]
        + STAGE * left.mean(axis=1)
        + WALL * wall.mean(axis=1)
        + CONTACT * contact.mean(axis=1)
    )


def next_command(grid, pose):
    """The next command (ahead, turn), as shares; renews the sequence."""
    sequences = sampled(STATE["nominal"])
    cost = costs(grid, pose, sequences)
    weights = np.exp(-(cost - cost.min()) / TEMPERATURE)
    mean = np.tensordot(weights / weights.sum(), sequences, axes=1)
    STATE["nominal"] = np.vstack([mean[1:], mean[-1:]])
    return float(mean[0, 0]), float(mean[0, 1])


def recovers(grid, pose):
    """Whether the robot turns on the spot, since it got no further."""
    trail = STATE["trail"] = [*STATE["trail"][-STUCK:], (pose.x, pose.y)]
    if len(trail) > STUCK and np.ptp(trail, axis=0).max() < 3.0:
        STATE["trail"], STATE["turns"] = [], math.ceil(math.pi * AXLE / SPEED / DT)
        STATE["nominal"] = np.zeros((STEPS, 2))
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
    STATE.update(trail=[], turns=0, commands=[(0.0, 0.0)] * DELAY)
    STATE.update(nominal=np.zeros((STEPS, 2)), rng=np.random.default_rng(1))


def policy(obs):
    """The fractions of the wheels' full speed, left and right."""
    pose, grid, commands = STATE["pose"], STATE["grid"], STATE["commands"]
    pose.update(obs)
    STATE["time"] += DT
    ranges = np.asarray(obs["ranges"], float)
    grid.scan(pose.x, pose.y, pose.heading, ranges, STATE["time"])
    later = pose.ahead(commands)
    grid.replan(later.x, later.y)
    if recovers(grid, pose):
        left, right = 1.0, -1.0
    else:
        ahead, turn = next_command(grid, later)
        left, right = ahead + turn, ahead - turn
    STATE["commands"] = [*commands, (left, right)][1:] if DELAY else []
    return left, right
