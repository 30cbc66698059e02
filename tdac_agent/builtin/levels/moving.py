"""Drives to a goal without a map, among discs that move straight on and bounce.

Walls are pixels: what rays hit lies on lines of their lattice. The first scan gives the
direction of the lattice, and from then on, a hit beside all lines is of a disc, and all
others say exactly which pixels are walls. A Kalman filter for each disc estimates its
place, velocity and radius, and bounces off known walls are predicted. A field of times
to the goal takes unseen space for free. In each step, a search in space and time around
the robot, backwards from a few seconds ahead, finds what each place is worth soon, by
where the discs will be. Courses of the next steps are tried out: the one that costs
least, up to its end and from there on, is driven, forwards or backwards.
"""

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

HALF = 330  # px from the start to the border of the map
SIDE = 2 * HALF + 1
REACH = 20  # px up to which clearances are known
ON_LINE = 5e-4  # px from a line of the lattice within which a hit is on it
TURNS = np.arange(15708) * (0.5 * math.pi / 15708)  # rad, of the lattice
LINE = 34.0  # px between two hits on a line that are taken for one wall, at most
BETWEEN = np.linspace(0.0, 1.0, 35)[1:-1]
SAMPLES = np.arange(0.0, RANGE, 1.5)  # px along a ray
SMALLEST, LARGEST, USUAL = 4.9, 9.1, 7.0  # px, radii of discs
FASTEST = 3.1  # px that a disc moves in a step, at most
HIT_NOISE = 4e-4  # px^2, variance of the distance of a hit from a circle
NEW = np.diag([9.0, 9.0, 3.0, 3.0, 2.0])  # covariance of a disc that is new
DRIFT = np.diag([1e-5, 1e-5, 1e-5, 1e-5, 1e-7])  # what a step adds to it
BOUNCE = np.diag([0.04, 0.04, 0.04, 0.04, 0.0])  # what a bounce adds to it
SURPRISE = np.diag([4.0, 4.0, 4.0, 4.0, 0.1])  # what hits elsewhere add to it
GATE = 5.0  # px from a circle within which a hit may be of its disc, at most
JUMP = 11.0  # px between two neighbouring hits of a disc, at most
APART = 4.0  # px between the centres of a disc that is seen and one that is not
COAST = 40  # steps for which a disc is remembered that is not seen
MARGIN = 0.2  # px that are kept from walls
COARSE = 4  # px between the nodes of the field
ROOM, CROWDED = 16.0, 0.2  # px from walls below which a step costs more, and how much
BUCKET = 2.0  # steps to the goal that differ among nodes which are settled at once
REPLAN = 5  # steps between two fields
FAR = np.float32(2e3)  # steps, where there is no way
NODE = 2  # px between the nodes of the search in space and time
LAYER = 2  # steps between two layers; within them, the robot drives three nodes
LAYERS, BEGIN = 18, 3  # layers, and the one in which courses end
WINDOW = 44  # nodes from the robot to the border of the search
STAMP = 16  # nodes from a disc within which it matters
BLOCKED, DEEPER = 250.0, 100.0  # steps that a step too near to a wall costs, and a px
RISK, FADE = 60.0, 0.94  # steps that a layer in contact costs; by how much less later
TOUCH = 1.0  # px from a disc at which a contact is as likely as not
SHARP, BLUR = 0.3, 0.02  # px by which gaps are uncertain now, and more with each step
BOUNCED = 0.1  # px more with each step after a bounce
WIDEST = 3.0  # px
VAGUE = 8.0  # px by which a place is uncertain where little is known
HIT, HIT_STEPS = 0.3, 6  # px below which a gap counts as a contact, in the first steps
STRUCK, STRUCK_DEEPER = 150.0, 20.0  # steps that such a contact costs, and a px
VEER, REVERSE = 1.0, 0.5  # steps that another direction, and another gear, costs
TURNING = 1.0  # steps that a rad costs which is left to turn at the end of a course
FIRST = 3  # steps of the first part of a course
FINE = 3.0, -3.0, 6.0, -6.0  # deg, turns that are tried beside those by tens
FURTHER = 0.0, -0.5, 0.5, -1.1, 1.1  # rad, turns after the first part
FACING = 1.2  # rad to the direction of a course from which the robot drives
SQUARE = NODE * np.arange(-WINDOW - 3, WINDOW + 4)
# Moves of the field, and points from which a slope is taken.
MOVES = np.array(
    [(i, j) for i in range(-2, 3) for j in range(-2, 3) if math.gcd(i, j) == 1]
)
CROSS = np.array([(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
STATE = {}


def kernel():
    """Distances to a pixel from the pixels around it."""
    steps = np.maximum(np.abs(np.arange(-REACH, REACH + 1)) - 0.5, 0.0)
    return np.minimum(np.hypot(steps[:, None], steps), REACH).astype(np.float32)


KERNEL = kernel()


def lattice(x, y):
    """The direction of the lattice of pixels by hits; the start is in one's middle."""
    hits = []
    for part in np.array_split(TURNS, 16):
        cos, sin = np.cos(part)[:, None], np.sin(part)[:, None]
        both = cos * x + sin * y, cos * y - sin * x
        on = [np.abs(each % 1.0 - 0.5) < 0.02 for each in both]
        hits.append((on[0] | on[1]).sum(axis=1))
    turn = TURNS[int(np.concatenate(hits).argmax())]
    for near in (0.05, 0.02, 0.01, 0.004, 0.002):
        u, v = turned(x, y, turn)
        arms = np.concatenate([v, -u])
        off = np.concatenate([u, v]) % 1.0 - 0.5
        on = np.abs(off) < near
        turn -= float((arms[on] * off[on]).sum() / max((arms[on] ** 2).sum(), 1e-9))
    return turn


def turned(x, y, turn):
    """Points in a frame that is turned."""
    cos, sin = math.cos(turn), math.sin(turn)
    return cos * x + sin * y, cos * y - sin * x


def pixels(x, y):
    """Columns and rows of the pixels of points."""
    i, j = np.rint(x).astype(int) + HALF, np.rint(y).astype(int) + HALF
    return np.clip(i, REACH + 1, SIDE - REACH - 2), np.clip(
        j, REACH + 1, SIDE - REACH - 2
    )


def between(values, u, v):
    """Values at points between nodes, by column and row."""
    height, width = values.shape
    u, v = np.clip(u, 0.0, width - 1.001), np.clip(v, 0.0, height - 1.001)
    i, j = u.astype(np.int32), v.astype(np.int32)
    a, b, at, flat = u - i, v - j, j * width + i, values.ravel()
    low = flat[at] + a * (flat[at + 1] - flat[at])
    high = flat[at + width] + a * (flat[at + width + 1] - flat[at + width])
    return low + b * (high - low)


class Map:
    """What is known of walls.

    Attributes:
        walls: Pixels that have been hit, or lie between two hits of a wall.
        crossed: Pixels that a ray has crossed: they are free.
        clear: Distances of pixels to the nearest wall, at most REACH px.
    """

    def __init__(self):
        self.walls, self.crossed = np.zeros((2, SIDE, SIDE), bool)
        self.clear = np.full((SIDE, SIDE), REACH, np.float32)

    def add(self, x, y, cos, sin, ranges):
        """Adds a scan; returns which rays have hit discs."""
        inside = (ranges - 0.05)[:, None] > SAMPLES
        i, j = pixels(
            (x + SAMPLES * cos[:, None])[inside], (y + SAMPLES * sin[:, None])[inside]
        )
        self.crossed[j, i] = True
        wrong = self.walls[j, i].any()
        hit = ranges < RANGE - 1e-3
        at_x, at_y = x + ranges * cos, y + ranges * sin
        on_x = np.abs(at_x % 1.0 - 0.5) < ON_LINE
        on_y = np.abs(at_y % 1.0 - 0.5) < ON_LINE
        i, j = pixels(at_x + 0.02 * cos, at_y + 0.02 * sin)
        of_walls = hit & (on_x | on_y) & ~self.crossed[j, i]
        new_i, new_j = [i[of_walls]], [j[of_walls]]
        # Discs may stand before a wall, between two hits of it.
        rays, free = np.flatnonzero(of_walls), np.cumsum(~hit)
        a, b = rays[:-1], rays[1:]
        one = (np.abs(at_x[a] - at_x[b]) < ON_LINE) & on_x[a]
        one |= (np.abs(at_y[a] - at_y[b]) < ON_LINE) & on_y[a]
        one &= (free[a] == free[b]) & (
            np.hypot(at_x[a] - at_x[b], at_y[a] - at_y[b]) < LINE
        )
        for k, to in zip(a[one].tolist(), b[one].tolist(), strict=True):
            new_i.append(np.rint(i[k] + BETWEEN * (i[to] - i[k])).astype(int))
            new_j.append(np.rint(j[k] + BETWEEN * (j[to] - j[k])).astype(int))
        i, j = np.concatenate(new_i), np.concatenate(new_j)
        fresh = ~self.walls[j, i] & ~self.crossed[j, i]
        new = np.unique(j[fresh] * SIDE + i[fresh])
        self.walls.ravel()[new] = True
        if wrong:
            self.walls &= ~self.crossed
            self.clear[:] = REACH
            new = np.flatnonzero(self.walls)
        for k in new.tolist():
            j, i = divmod(k, SIDE)
            part = self.clear[j - REACH : j + REACH + 1, i - REACH : i + REACH + 1]
            np.minimum(part, KERNEL, out=part)
        return hit & ~of_walls

    def clear_at(self, x, y):
        """Clearances at points, interpolated, px."""
        return between(self.clear, x + HALF, y + HALF)

    def ahead(self, places, rates, radii):
        """Places, velocities and normals of bounces (or 0) a step later, (n, 2)."""
        there = places + rates
        normals = np.zeros_like(there)
        i, j = pixels(there[:, 0], there[:, 1])
        for k in np.flatnonzero(self.clear[j, i] < radii + 1.0).tolist():
            clear = self.clear_at(*(there[k] + CROSS).T)
            lack = radii[k] - clear[0]
            if lack <= 0.0:
                continue
            normal = np.array([clear[1] - clear[2], clear[3] - clear[4]])
            normal /= max(math.hypot(*normal), 1e-6)
            into = float(rates[k] @ normal)
            if into < 0.0:
                rates = rates.copy()
                rates[k] = rates[k] - 2.0 * into * normal
                there[k] = there[k] + 2.0 * min(lack, -into) * normal
                normals[k] = normal
        return there, rates, normals


class Disc:
    """A disc: place (px), velocity (px per step) and radius (px) with covariance."""

    def __init__(self, x, y, radius):
        self.mean, self.covariance = np.array([x, y, 0.0, 0.0, radius]), NEW.copy()
        self.unseen, self.denied = 0, 0

    def expect(self, place, rate, normal):
        """Goes on by a step, with a bounce or without."""
        self.mean[:2], self.mean[2:4] = place, rate
        self.covariance = MOTION @ self.covariance @ MOTION.T + DRIFT
        if normal.any():
            mirror = np.eye(5)
            mirror[:2, :2] -= 2.0 * np.outer(normal, normal)
            mirror[2:4, 2:4] = mirror[:2, :2]
            self.covariance = mirror @ self.covariance @ mirror.T + BOUNCE
        self.unseen += 1

    def meet(self, hits):
        """Corrects the estimates: there are points on the circle."""
        off = np.hypot(*(hits - self.mean[:2]).T) - self.mean[4]
        if np.abs(off).max() > 0.3 + 4.0 * self.spread(0):
            self.covariance = self.covariance + SURPRISE
        before, mean = self.mean, self.mean
        for _ in range(4):
            away = hits - mean[:2]
            far = np.maximum(np.hypot(*away.T), 1e-6)
            slope = np.zeros((len(hits), 5))
            slope[:, :2], slope[:, 4] = -away / far[:, None], -1.0
            spread = self.covariance @ slope.T
            noise = HIT_NOISE * np.eye(len(hits))
            gain = np.linalg.solve(slope @ spread + noise, spread.T).T
            mean = before + gain @ (mean[4] - far - slope @ (before - mean))
            mean[4] = min(max(mean[4], SMALLEST), LARGEST)
        fast = math.hypot(mean[2], mean[3])
        if fast > FASTEST:
            mean[2:4] *= FASTEST / fast
        self.mean = mean
        covariance = self.covariance - gain @ spread.T
        self.covariance = 0.5 * (covariance + covariance.T)
        self.unseen = self.denied = 0

    def spread(self, steps):
        """Standard deviation of the place some steps ahead, px."""
        c = self.covariance
        place, both = c[0, 0] + c[1, 1], c[0, 2] + c[1, 3]
        total = place + 2.0 * steps * both + steps**2 * (c[2, 2] + c[3, 3])
        return np.sqrt(np.maximum(0.5 * total, 0.0))


MOTION = np.eye(5)
MOTION[0, 2] = MOTION[1, 3] = 1.0


def circle_through(points):
    """Centre and radius of the circle through three points; None if there is none."""
    (ax, ay), (bx, by), (cx, cy) = points.tolist()
    ux, uy, vx, vy = bx - ax, by - ay, cx - ax, cy - ay
    twice = 2.0 * (ux * vy - uy * vx)
    if abs(twice) < 1e-3:
        return None
    u, v = ux * ux + uy * uy, vx * vx + vy * vy
    px, py = (vy * u - uy * v) / twice, (ux * v - vx * u) / twice
    return ax + px, ay + py, math.hypot(px, py)


def new_discs(hits, x, y):
    """Discs that explain neighbouring hits."""
    n = len(hits)
    if n >= 3:
        circle = circle_through(hits[[0, n // 2, n - 1]])
        if circle is not None and SMALLEST - 0.1 < circle[2] < LARGEST + 0.1:
            off = np.hypot(*(hits - circle[:2]).T) - circle[2]
            if np.abs(off).max() < 0.05:
                return [met(Disc(*circle), hits)]
        cut = int(np.hypot(*np.diff(hits, axis=0).T).argmax()) + 1
        return [d for part in (hits[:cut], hits[cut:]) for d in new_discs(part, x, y)]
    middle = hits.mean(axis=0)
    half = 0.5 * math.dist(hits[0], hits[-1])
    deep = math.sqrt(max(USUAL**2 - half**2, 0.0)) if n == 2 else 0.85 * USUAL
    away = (middle - (x, y)) / max(math.dist(middle, (x, y)), 1e-6)
    return [met(Disc(*(middle + deep * away), USUAL), hits)]


def met(disc, hits):
    """A disc after its first hits."""
    disc.meet(hits)
    return disc


def scanner_at(x, y, heading):
    """The place where the rays start, for the robot's centre at a place."""
    cosine, sine = math.cos(heading), math.sin(heading)
    ahead, aside = OFFSET
    return x + ahead * cosine - aside * sine, y + ahead * sine + aside * cosine


def track(discs, chart, pose, hits, numbers, ranges):
    """The discs after this step, by the hits that are of discs.

    The rays start at this pose.
    """
    if discs:
        for disc, *now in zip(discs, *chart.ahead(*motion(discs)), strict=True):
            disc.expect(*now)
        places, _, radii = motion(discs)
        gates = np.array([min(0.5 + 4.0 * disc.spread(0), GATE) for disc in discs])
        gates = np.maximum(gates, 2.0)
        off = np.hypot(*(hits[:, None] - places).transpose(2, 0, 1)) - radii
        off = np.where(np.abs(off) < gates, np.abs(off) / gates**0.5, np.inf)
        owner = np.where(off.min(axis=1) < np.inf, off.argmin(axis=1), -1)
        for k, disc in enumerate(discs):
            if (owner == k).any():
                disc.meet(hits[owner == k])
    else:
        owner = np.full(len(hits), -1)
    kept = [disc for disc in discs if is_there(disc, chart, pose, ranges)]
    group = []
    for k in [*np.flatnonzero(owner < 0).tolist(), None]:
        if group and (
            k is None
            or numbers[k] - numbers[group[-1]] > 2
            or math.dist(hits[k], hits[group[-1]]) > JUMP
        ):
            kept += new_discs(hits[group], *pose[:2])
            group = []
        group.append(k)
    seen = [disc for disc in kept if not disc.unseen]
    return seen + [
        disc
        for disc in kept
        if disc.unseen
        and all(math.dist(disc.mean[:2], other.mean[:2]) > APART for other in seen)
    ]


def is_there(disc, chart, pose, ranges):
    """Whether a disc may still be there, by the rays that pass its place."""
    if not disc.unseen:
        return True
    x, y, heading = pose
    off_x, off_y = disc.mean[0] - x, disc.mean[1] - y
    far = math.hypot(off_x, off_y)
    bearing = FAN + heading - math.atan2(off_y, off_x)
    bearing = np.abs(np.remainder(bearing + math.pi, 2.0 * math.pi) - math.pi)
    wide = math.asin(min(0.7 * disc.mean[4] / max(far, 0.1), 1.0))
    disc.denied += bool((ranges[bearing < wide] > far).any())
    clear = float(chart.clear_at(*disc.mean[:2]))
    known = disc.covariance[2, 2] + disc.covariance[3, 3] < 0.5
    return (
        disc.denied < 2
        and disc.unseen <= (COAST if known else 8)
        and clear > disc.mean[4] - 3.0
    )


def motion(discs):
    """Places, velocities (px per step) and radii of some discs."""
    means = np.array([disc.mean for disc in discs])
    return means[:, :2], means[:, 2:4], means[:, 4]


def forecast(discs, chart):
    """Places of discs in each step ahead, (steps, n, 2), and how uncertain they are."""
    steps = LAYERS * LAYER + 1
    at, rates, radii = motion(discs)
    places, since = np.empty((steps, *at.shape)), np.zeros((steps, len(at)))
    bounced = np.zeros(len(at), bool)
    for step in range(steps):
        places[step] = at
        since[step] = since[step - 1] + bounced if step else 0.0
        at, rates, normals = chart.ahead(at, rates, radii)
        bounced |= normals.any(axis=1)
    ahead = np.arange(steps)
    spread = np.array([disc.spread(ahead) for disc in discs]).T
    spread = spread + BLUR * ahead[:, None] + BOUNCED * since
    doubts = np.log1p((spread / VAGUE) ** 2)
    return places, np.minimum(SHARP + spread, WIDEST), doubts, radii


def risks(gaps, layers):
    """Costs of a layer by gaps to discs in units of what is unknown."""
    price = (RISK * FADE**layers).astype(gaps.dtype)
    return price / (1.0 + np.exp(np.clip(gaps, -15.0, 15.0)))


class Field:
    """Steps to the goal from the nodes of a lattice.

    Attributes:
        times: The steps.
    """

    def __init__(self, goal):
        self.goal, self.times = goal, None

    def replan(self, chart, x, y):
        """Finds the times from the goal to somewhat beyond the robot, in buckets."""
        clear = chart.clear[::COARSE, ::COARSE]
        width = clear.shape[1]
        price = price_at(clear)
        price = np.where(clear < RADIUS + 1.0, 12.0, price)
        price[clear < RADIUS - 3.0] = np.inf
        price[[0, 1, -2, -1]] = price[:, [0, 1, -2, -1]] = np.inf
        price = price.ravel()
        times = np.full(price.size, np.inf)
        begin, end = (
            round((b + HALF) / COARSE) * width + round((a + HALF) / COARSE)
            for a, b in (self.goal, (x, y))
        )
        price[begin] = min(price[begin], 1.0)
        offsets = MOVES[:, 1] * width + MOVES[:, 0]
        lengths = 0.5 * COARSE / STEP * np.hypot(*MOVES.T)
        times[begin] = 0.0
        todo, most = np.array([begin]), np.inf
        while len(todo):
            bound = times[todo].min() + BUCKET
            if bound > most:
                break
            soon = times[todo] <= bound
            now, later = todo[soon], [todo[~soon]]
            while len(now):
                to = now[:, None] + offsets
                time = times[now, None] + lengths * (price[now, None] + price[to])
                better = time < times[to]
                to, time = to[better], time[better]
                np.minimum.at(times, to, time)
                soon = times[to] <= bound
                now = np.unique(to[soon])
                later.append(to[~soon])
            todo = np.unique(np.concatenate(later))
            todo = todo[times[todo] > bound]
            if times[end] < np.inf:
                most = min(most, times[end] + NODE * WINDOW * 1.5 / STEP)
        self.times = np.minimum(times, FAR).reshape(clear.shape)

    def around(self, x, y):
        """Steps to the goal from the nodes of the search."""
        u, v = (x + SQUARE + HALF) / COARSE, (y + SQUARE + HALF) / COARSE
        times = between(self.times, *np.meshgrid(u, v))
        off = np.hypot(x + SQUARE - self.goal[0], (y + SQUARE - self.goal[1])[:, None])
        direct = np.maximum(off - TOLERANCE, 0.0) / STEP
        times = np.where((off < 20.0) & (times < 30.0), direct, times)
        return times.astype(np.float32), off < TOLERANCE


def price_at(clear):
    """What a step costs by the clearance: it is more beside walls."""
    return 1.0 + CROWDED * np.clip((ROOM - clear) / (ROOM - RADIUS), 0.0, 1.0)


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


def values_ahead(field, chart, future, x, y):
    """Steps that are left at each node in layer BEGIN."""
    times, at_goal = field.around(x, y)
    clear = chart.clear[np.ix_(*(pixels(x + SQUARE, y + SQUARE)[::-1]))]
    blocked = clear < RADIUS + MARGIN
    base = np.where(blocked, FAR, LAYER * price_at(clear))[3:-3, 3:-3]
    base = base.astype(np.float32)
    values = np.where(blocked, FAR, times)
    # Who leaves the square at its border goes on as if there were no discs.
    inner, at_goal = values[3:-3, 3:-3], at_goal[3:-3, 3:-3]
    costs = layer_costs(future, x, y) if future is not None else np.zeros(LAYERS)
    for layer in range(LAYERS - 1, BEGIN - 1, -1):
        after = base + least_around(values) + costs[layer - BEGIN]
        np.minimum(after, FAR, out=after)
        after[at_goal] = 0.0
        inner[:] = after
    return inner


def layer_costs(future, x, y):
    """Costs of discs at each node, layers BEGIN to LAYERS - 1."""
    layers = np.arange(BEGIN, LAYERS)
    places, widths, doubts = (each[layers * LAYER] for each in future[:3])
    places = places - (x, y)
    nodes = np.rint(places / NODE).astype(int)
    near = np.abs(nodes).max(axis=2) <= WINDOW + STAMP
    off = (nodes * NODE - places)[..., None] + NODE * np.arange(-STAMP, STAMP + 1)
    square, side = 2 * (WINDOW + 2 * STAMP) + 1, 2 * STAMP + 1
    costs = np.zeros((len(layers), square, square), np.float32)
    for m, radius in enumerate(future[3]):
        on = np.flatnonzero(near[:, m])
        far = (off[on, m].astype(np.float32)) ** 2
        gaps = np.sqrt(far[:, 1, :, None] + far[:, 0, None, :])
        gaps -= np.float32(radius + RADIUS + TOUCH)
        gaps /= widths[on, m, None, None].astype(np.float32)
        gaps += doubts[on, m, None, None].astype(np.float32)
        stamps = risks(gaps, layers[on, None, None])
        for layer, stamp in zip(on.tolist(), stamps, strict=True):
            i, j = (nodes[layer, m] + WINDOW + STAMP).tolist()
            part = costs[layer, j : j + side, i : i + side]
            np.maximum(part, stamp, out=part)
    return costs[:, 2 * STAMP : -2 * STAMP, 2 * STAMP : -2 * STAMP]


def candidates():
    """Headings and speeds to try: first turn and further one (rad), speeds, gear."""
    rows = []
    for angle in np.radians([0.0, *FINE, *range(10, 360, 10)]).tolist():
        rows += [(angle, b, 1.0, 1.0, 1.0) for b in FURTHER]
        rows += [(angle, b, 1.0, 1.0, -1.0) for b in FURTHER]
        for first, then in ((0.5, 0.5), (1.0, 0.0), (0.0, 1.0)):
            rows += [(angle, 0.0, first, then, gear) for gear in (1.0, -1.0)]
    rows.append((0.0, 0.0, 0.0, 0.0, 1.0))
    # The last ones go on in the direction of the course that is driven.
    rows += [
        (0.0, b, v, 1.0, g) for b in FURTHER for v in (1.0, 0.0) for g in (1.0, -1.0)
    ]
    return np.array(rows).T


CANDIDATES = candidates()
STEPS = BEGIN * LAYER


def roll(pose, ways):
    """Drives all candidates: x, y after each step, headings and first wheel speeds."""
    _, further, speed_1, speed_2, gear = CANDIDATES
    x, y, heading = pose
    limit = 2.0 * STEP / AXLE
    aim = ways + np.where(gear < 0.0, math.pi, 0.0)
    x, y = np.full(len(gear), x), np.full(len(gear), y)
    heading = np.full(len(gear), heading)
    xs, ys = [], []
    for step in range(STEPS):
        goal, speed = (aim, speed_1) if step < FIRST else (aim + further, speed_2)
        off = np.remainder(goal - heading + math.pi, 2.0 * math.pi) - math.pi
        turn = np.clip(off, -limit, limit)
        wheel = 0.5 * AXLE / STEP * turn
        drive = np.minimum(speed, 1.0 - np.abs(wheel))
        drive = gear * np.where(np.abs(off) > FACING, 0.0, drive)
        if step == 0:
            wheels = np.column_stack([drive + wheel, drive - wheel])
        length = STEP * drive * (1.0 - turn * turn / 24.0)
        x = x + length * np.cos(heading + 0.5 * turn)
        y = y + length * np.sin(heading + 0.5 * turn)
        heading = heading + turn
        xs.append(x)
        ys.append(y)
    return np.array(xs), np.array(ys), heading, wheels


def costs_of(xs, ys, chart, future):
    """Costs of each step of all candidates, by walls and discs."""
    clear = chart.clear_at(xs, ys)
    costs = price_at(clear)
    lack = RADIUS + MARGIN - clear
    costs += np.where(lack > 0.0, BLOCKED + DEEPER * lack, 0.0)
    if future is None:
        return costs
    places, widths, doubts, radii = future
    ahead = np.arange(1, STEPS + 1)[:, None]
    for m, radius in enumerate(radii):
        at = places[1 : STEPS + 1, m]
        if math.dist(at[0], (xs[0, 0], ys[0, 0])) > radius + RADIUS + 50.0:
            continue
        gaps = np.hypot(xs - at[:, :1], ys - at[:, 1:]) - radius - RADIUS
        scaled = (gaps - TOUCH) / widths[1 : STEPS + 1, m, None]
        scaled += doubts[1 : STEPS + 1, m, None]
        costs += risks(scaled, ahead / LAYER) / LAYER
        lack = HIT - gaps[:HIT_STEPS]
        costs[:HIT_STEPS] += np.where(lack > 0.0, STRUCK + STRUCK_DEEPER * lack, 0.0)
    return costs


def chosen(field, chart, discs, pose):
    """The wheel speeds of the candidate that costs least."""
    x, y, heading = pose
    future = forecast(discs, chart) if discs else None
    mid_x, mid_y = round(x), round(y)
    values = values_ahead(field, chart, future, mid_x, mid_y)
    ways = heading + CANDIDATES[0]
    if STATE["way"] is not None:
        ways[-4 * len(FURTHER) :] = STATE["way"][0]
    xs, ys, facing, wheels = roll(pose, ways)
    costs = costs_of(xs, ys, chart, future)
    done = np.hypot(xs - field.goal[0], ys - field.goal[1]) < TOLERANCE
    done = np.logical_or.accumulate(done, axis=0)
    costs[1:][done[:-1]] = 0.0
    u, v = (xs[-1] - mid_x) / NODE + WINDOW, (ys[-1] - mid_y) / NODE + WINDOW
    left = between(values, u, v)
    cap = values[values < 0.5 * FAR].max(initial=0.0) + 1.0
    low = np.minimum(values, cap)
    slope_x = between(low, u + 1.5, v) - between(low, u - 1.5, v)
    slope_y = between(low, u, v + 1.5) - between(low, u, v - 1.5)
    turn = np.arctan2(-slope_y, -slope_x) - facing
    turn = np.abs(np.remainder(turn + 0.5 * math.pi, math.pi) - 0.5 * math.pi)
    total = costs.sum(axis=0) + np.where(done[-1], 0.0, left + TURNING * turn)
    if STATE["way"] is not None:
        total += VEER * (1.0 - np.cos(ways - STATE["way"][0]))
        total += np.where(CANDIDATES[4] != STATE["way"][1], REVERSE, 0.0)
    best = int(total.argmin())
    if CANDIDATES[2, best] > 0.0:
        STATE["way"] = ways[best], CANDIDATES[4, best]
    return wheels[best]


def reset(obs):
    """Finds the lattice of pixels; from here on, all is in its frame."""
    ranges = obs["ranges"].astype(float)
    hit = ranges < RANGE - 1e-3
    angles = float(obs["pose"][2]) + FAN[hit]
    turn = lattice(ranges[hit] * np.cos(angles), ranges[hit] * np.sin(angles))
    goal = turned(*obs["goal"].astype(float), turn)
    STATE.update(turn=turn, chart=Map(), discs=[], field=Field(goal), step=0, way=None)


def policy(obs):
    """Wheel speeds for an observation."""
    x, y = turned(*obs["pose"][:2].astype(float), STATE["turn"])
    pose = x, y, float(obs["pose"][2]) - STATE["turn"]
    ranges = obs["ranges"].astype(float)
    chart, field = STATE["chart"], STATE["field"]
    cos, sin = np.cos(pose[2] + FAN), np.sin(pose[2] + FAN)
    at_x, at_y = scanner_at(*pose)
    numbers = np.flatnonzero(chart.add(at_x, at_y, cos, sin, ranges))
    points = np.column_stack([at_x + ranges * cos, at_y + ranges * sin])[numbers]
    seen_from = at_x, at_y, pose[2]
    STATE["discs"] = track(STATE["discs"], chart, seen_from, points, numbers, ranges)
    if STATE["step"] % REPLAN == 0:
        field.replan(chart, x, y)
    STATE["step"] += 1
    return chosen(field, chart, STATE["discs"], pose).astype(np.float32)
