"""Drives an e-puck to a goal without a map and without a pose, by feel.

The floor is a grid of cells: all plates lie on lines that cross at right angles, and
each plate spans a whole side of a cell. So a few hits tell where a line is, a few more
that a whole side is closed, and a ray that passes through it that it is open. Start and
goal are in the middles of their cells, which tells of lines that no ray has seen.

A Kalman filter adds up the angles of the wheels, and corrects the pose by directions of
plates and by the lines, which it estimates as well. A search finds the way to the goal
that is cheapest if sides that are neither closed nor open are open, but cost something.
The robot drives straight to the farthest point of it that it can, along the arc that
leads there best and leaves room.
"""

import heapq
import itertools
import json
import math

import numpy as np

with open("params.json") as file:
    PARAMS = json.load(file)
ROBOT, NOISES = PARAMS["robot"], PARAMS.get("disturbances", {})
RADIUS, AXLE, RIM = ROBOT["radius"], ROBOT["axle_length"], ROBOT["wheel_radius"]
TOLERANCE = PARAMS["goal_tolerance"]
STEP = ROBOT["max_wheel_speed"] * RIM * PARAMS["dt"]  # m at full speed
SLIP = max(NOISES.get("wheel_slip", 0.0) * math.sqrt(0.1 / PARAMS["dt"]), 0.005)
WHEEL = max(NOISES.get("wheel_radius_error", 0.0), 0.002)
AXLE_ERROR = max(NOISES.get("axle_error", 0.0), 0.002)

# Rays of ps0 to ps7: x ahead, y to the left, azimuth; and readings by their lengths.
RAYS = np.array(
    [
        (0.030, -0.010, -0.3008),
        (0.022, -0.025, -0.8008),
        (0.000, -0.031, -1.5708),
        (-0.030, -0.015, -2.6440),
        (-0.030, 0.015, 2.6392),
        (0.000, 0.031, 1.5708),
        (0.022, 0.025, 0.7992),
        (0.030, 0.010, 0.2992),
    ]
)
LENGTHS = np.array([0.0, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07])
READINGS = np.array(
    [4095.0, 2133.33, 1465.73, 601.46, 383.84, 234.93, 158.03, 120.0, 104.09, 67.19]
)
FLAT = 0.987  # length on the floor of a ray of length 1
SEEN = 84.0  # a lower reading may be noise
FORWARD = (0, 1, 5, 6, 7)  # sensors whose next one looks much the same way
CLEAR = 0.06  # m that a ray without a hit is free
SHARP = 0.058  # m, longer rays are too rough for lines

FINE = 0.01  # m, cells of hits and of free space
CELL = 0.015  # m, cells of the search
HALF = 3.2  # m from the start to the borders of the map
SIDE = 2.03  # m, longest side of the floor
PITCH = 0.275  # m between two lines, mostly
NARROW, WIDE = 0.12, 0.165  # m between two lines at least; half of it at most
THICK = 0.015  # m, plates, mostly
SAME = 0.05  # m, faces that are not farther apart are the same
LONGEST = 0.08  # m, no side of a thing is so long
SHORTEST = 0.04  # m, runs of hits that tell the direction of a plate
FIRST = 0.065  # m, the same for the first one, from which the frame follows
TILT = 0.12  # rad, plates seem to be turned by less
GATE = 16.0  # squared SDs by which a measurement may be off
# Prices of a m of way, by the room between body and hits, m.
ROOMS = np.array([0.002, 0.006, 0.010, 0.015, 0.02, 0.025, 0.032])
PRICES = np.array([301.0, 9.0, 6.0, 4.0, 2.5, 1.7, 1.3, 1.0])
GUESSED = 30.0  # most that a m costs near a part of a plate that no ray has seen
DOUBT = 1.0  # how much more a m costs on a line where nothing is known
RECENT = 20  # steps for which hits move along when the pose is corrected
BEYOND = 0.03  # m that a thing is taken to go on beyond its last hit
LOOK = 0.25  # m ahead on the path
MARGIN = 0.009  # m that arcs keep from hits
REPLAN = 5  # steps after which a path is looked for anew
KEEP = 0.03  # m by which another path must be cheaper
AGAIN = 0.02  # m that a spin back costs
RISK, SAFE = 0.08, 0.015  # m that a contact costs; m of room in which it is a third
RIGHT = 0.5 * math.pi


def wrapped(angle, turn=2.0 * math.pi):
    """The angle in (-turn / 2, turn / 2]."""
    return angle - turn * math.floor(angle / turn + 0.5)


class Face:
    """A side of a line on which plates have been seen.

    Attributes:
        axis: 0 for lines along the grid, 1 for lines across it.
        sign: On which side the plates are, 1 or -1.
        pieces: Both ends of the parts that have been seen, m along the line.
    """

    def __init__(self, axis, sign):
        self.axis, self.sign = axis, sign
        self.pieces = []

    def add(self, low, high):
        """Adds a part."""
        for old in list(self.pieces):
            if low < old[1] + BEYOND and high > old[0] - BEYOND:
                low, high = min(low, old[0]), max(high, old[1])
                self.pieces.remove(old)
        self.pieces.append((low, high))

    def longer(self, length):
        """Whether hits on it are so far apart."""
        ends = [end for piece in self.pieces for end in piece]
        return bool(ends) and max(ends) - min(ends) > length


class Pose:
    """A Kalman filter over the pose, what is wrong with the wheels, and the lines.

    Its frame is that of the start at first. The first plate that it sees is taken to be
    in line with the grid, and from then on it is the start that may be turned.

    Attributes:
        state: x, y, heading; turn for each m, rad, since the wheels differ; relative
            errors of turns and ways; by how much the start is turned, rad; and for each
            face its place across it, m.
        spread: Covariance of the errors of all of these.
        faces: The faces that have been seen.
        grid: Direction of the grid, rad; None if not known yet.
    """

    def __init__(self):
        self.state = np.zeros(7)
        bend = WHEEL * math.sqrt(2.0 / 3.0) / AXLE
        way = WHEEL / math.sqrt(6.0)
        turn = math.hypot(AXLE_ERROR / math.sqrt(3.0), way)
        self.spread = np.diag([1e-8, 1e-8, 1e-8, bend**2, turn**2, way**2, 0.0])
        self.spread[4, 5] = self.spread[5, 4] = way**2
        self.faces = []
        self.grid = None

    def turned(self, point):
        """A point that is known in the frame of the start."""
        return rotated(point, -float(self.state[6])).tolist()

    def align(self, direction, sd):
        """Takes the direction of the first plate for that of the grid."""
        self.grid = wrapped(direction, RIGHT)
        x, y = self.state[:2].tolist()
        # The error of the heading becomes that of the start, about which all turns.
        turn = np.eye(7)
        turn[[0, 1, 2, 6], 2] = y, -x, 0.0, -1.0
        noise = np.array([-y, x, 1.0, 0.0, 0.0, 0.0, 1.0])
        self.spread = turn @ self.spread @ turn.T + sd * sd * np.outer(noise, noise)

    def moved(self, left, right):
        """Takes a step of the wheels, m."""
        full = 0.99 * STEP
        # Slip makes a wheel slower at times, but never faster than its top speed.
        left, right = (w * (1.0 - 0.4 * SLIP * (abs(w) > full)) for w in (left, right))
        heading, bend, turns, ways = self.state[2:6].tolist()
        way, turn = 0.5 * (left + right), (right - left) / AXLE
        true = turn * (1.0 + turns) + bend * way
        middle = heading + 0.5 * true
        ahead, side = math.cos(middle), math.sin(middle)
        true_way = way * (1.0 + ways)
        dx, dy = true_way * ahead, true_way * side
        self.state[:3] += dx, dy, true
        size = len(self.state)
        step = np.eye(size)
        step[0, 2], step[1, 2] = -dy, dx
        step[0, 5], step[1, 5] = way * ahead, way * side
        step[2, 3], step[2, 4] = way, turn
        self.spread = step @ self.spread @ step.T
        wheel = SLIP**2 * (left * left + right * right)
        self.spread[2, 2] += wheel / AXLE**2
        self.spread[0, 0] += 0.25 * wheel + 1e-10
        self.spread[1, 1] += 0.25 * wheel + 1e-10

    def correct(self, row, off, sd):
        """Takes a measurement that is by `off` too large; tells if it may be true."""
        gain = self.spread @ row
        size = float(row @ gain) + sd * sd
        if off * off > GATE * size:
            return False
        gain = gain / size
        self.state = self.state - gain * off
        self.spread = self.spread - np.outer(gain, row @ self.spread)
        return True

    def run(self, points):
        """Takes hits of a ray that follow each other, which may be along a plate."""
        middle = points.mean(axis=0)
        _, sizes, axes = np.linalg.svd(points - middle, full_matrices=False)
        rough = float(sizes[1]) / math.sqrt(len(points))
        if rough > 0.002:
            return
        length = math.dist(points[-1], points[0])
        direction = math.atan2(axes[0, 1], axes[0, 0])
        sd = 0.015 + rough / length
        if self.grid is None:
            self.align(direction, sd)
        off = wrapped(direction - self.grid, RIGHT)
        row = np.zeros(len(self.state))
        row[2] = 1.0
        if abs(off) < 0.2 and self.correct(row, off, sd):
            self.plate(points, direction, 0.004)

    def plate(self, points, direction, sd):
        """Takes hits on a plate, its direction, and the SD of its place."""
        axis = round((direction - self.grid) / RIGHT) % 2
        angle = self.grid + (1 - axis) * RIGHT
        across = np.array([math.cos(angle), math.sin(angle)])
        point = points.mean(axis=0)
        arm = point - self.state[:2]
        place = float(across @ point)
        number = self.face(axis, math.copysign(1.0, float(across @ arm)), place)
        if number is None:
            return
        row = np.zeros(len(self.state))
        row[:2] = across
        row[2] = float(across @ np.array([-arm[1], arm[0]]))
        row[7 + number] = -1.0
        if self.correct(row, place - float(self.state[7 + number]), sd):
            along = rotated(points, self.grid)[:, axis]
            self.faces[number].add(float(along.min()), float(along.max()))

    def face(self, axis, sign, place):
        """Number of the face at a place; None if there cannot be one."""
        gaps = {
            k: abs(place - float(self.state[7 + k]))
            for k, face in enumerate(self.faces)
            if (face.axis, face.sign) == (axis, sign)
        }
        if gaps and min(gaps.values()) < SAME:
            return min(gaps, key=gaps.get)
        near = [k for k, gap in gaps.items() if gap < NARROW]
        if any(self.faces[k].longer(LONGEST) for k in near):
            return None
        self.faces.append(Face(axis, sign))
        self.state = np.append(self.state, place)
        self.spread = np.pad(self.spread, (0, 1))
        self.spread[-1, -1] = 1.0
        return len(self.faces) - 1

    def lines(self, axis, guesses=()):
        """Places of the lines that have been seen; fewer hits do near a guess."""
        places = []
        for face, place in zip(self.faces, self.state[7:].tolist(), strict=True):
            likely = any(abs(place - guess) < SAME for guess in guesses)
            if face.axis == axis and face.longer(SHORTEST if likely else LONGEST):
                places.append((place, face.sign))
        found = []
        for place, sign in sorted(places):
            if found and place - found[-1][0] < SAME:
                found[-1] = (0.5 * (place + found[-1][0]), 0.0)
            else:
                found.append((place, sign))
        return [place + 0.5 * THICK * sign for place, sign in found]

    def closed(self, axis, place):
        """Both ends of the parts of plates that have been seen on a line."""
        return [
            piece
            for face, at in zip(self.faces, self.state[7:].tolist(), strict=True)
            if face.axis == axis and abs(at - place) < SAME
            for piece in face.pieces
        ]


def lattice(seen, middles):
    """Places of all lines of an axis: those seen, and guesses between and beyond.

    Args:
        seen: Places of lines.
        middles: Middles of two cells, the start's and the goal's.
    """
    knots = [(place, 0.0) for place in seen]
    for middle in middles:
        for line in seen:
            other = 2.0 * middle - line
            near = abs(line - middle) < WIDE
            if near and min(abs(place - other) for place, _ in knots) > NARROW:
                knots.append((other, 0.0))
    knots = sorted(knots + [(place, 0.5) for place in middles])
    places, numbers = [knots[0][0]], [knots[0][1]]
    for (low, a), (high, b) in itertools.pairwise(knots):
        half = abs(a - b)
        step = round((high - low) / PITCH - half) + half
        if step <= 0.0:
            continue
        numbers.append(numbers[-1] + step)
        places.append(high)
    many = math.ceil(SIDE / PITCH)
    places = [places[0] - many * PITCH, *places, places[-1] + many * PITCH]
    numbers = [numbers[0] - many, *numbers, numbers[-1] + many]
    return np.interp(np.arange(math.ceil(numbers[0]), numbers[-1]), numbers, places)


def rotated(points, angle):
    """Points in a frame that is turned by the angle."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.asarray(points) @ np.array([[cosine, -sine], [sine, cosine]])


def cells(points):
    """Columns and rows of points in the map."""
    return ((np.asarray(points) + HALF) / FINE).astype(int).T


class Map:
    """Hits and free space.

    Attributes:
        hits: Place and time of the last hit in each cell.
        passed: Which cells rays or the body have passed.
    """

    def __init__(self):
        self.hits = {}
        side = int(2 * HALF / FINE)
        self.passed = np.zeros((side, side), bool)
        reach = int(RADIUS / FINE) + 1
        i, j = np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1))
        inside = np.hypot(i, j) * FINE < RADIUS - 0.008
        self.body = np.column_stack([i[inside], j[inside]])

    def points(self):
        """Places of all hits, shape (n, 2)."""
        return np.array([hit[0] for hit in self.hits.values()]).reshape(-1, 2)

    def hit(self, point, now, faint=False):
        """Keeps a hit; a faint one is a guess."""
        key = int((point[0] + HALF) / FINE), int((point[1] + HALF) / FINE)
        if not (faint and (key in self.hits or self.passed[key[1], key[0]])):
            self.hits[key] = (self.hits.get(key, (point,))[0], now)

    def shift(self, before, after, since):
        """Moves recent hits along when the pose is corrected."""
        if math.dist(before, after) < 0.001:
            return
        turn = after[2] - before[2]
        for key, (point, time) in list(self.hits.items()):
            if time >= since:
                del self.hits[key]
                x, y = rotated(np.subtract(point, before[:2]), -turn).tolist()
                self.hit((after[0] + x, after[1] + y), time)

    def carve(self, pose, lengths, hit, now):
        """Takes what rays and body passed for free."""
        x, y, heading = pose
        starts = tips(pose, np.zeros(8))
        along = np.arange(0.0, CLEAR, 0.005)
        far = np.where(hit, lengths - 0.012, CLEAR)
        angles = heading + RAYS[:, 2]
        ways = np.column_stack([np.cos(angles), np.sin(angles)])
        ray, number = np.nonzero(along[None, :] < far[:, None])
        i, j = cells(starts[ray] + along[number, None] * ways[ray])
        body_i, body_j = cells([(x, y)])
        i = np.concatenate([i, body_i + self.body[:, 0]])
        j = np.concatenate([j, body_j + self.body[:, 1]])
        self.passed[j, i] = True
        for key in zip(i.tolist(), j.tolist(), strict=True):
            if key in self.hits and self.hits[key][1] < now - 3:
                del self.hits[key]

    def forget(self, place, reach, before):
        """Forgets old hits near a place."""
        for key, (point, time) in list(self.hits.items()):
            if time < before and math.dist(point, place) < reach:
                del self.hits[key]


def is_closed(low, high, pieces, along):
    """Whether a side is surely closed by plates, and if it may be by single hits.

    Args:
        low: An end of the side, m, and whether it is known.
        high: The other end.
        pieces: Ends of the parts of plates on its line.
        along: Places of hits on its line.
    """
    (low, low_sure), (high, high_sure) = low, high
    near = along[(along > low + 0.015) & (along < high - 0.015)]
    low += 0.02 if low_sure else 0.045
    high -= 0.02 if high_sure else 0.045
    surely = any(min(b, high) - max(a, low) > 0.02 for a, b in pieces)
    return surely, len(near) > 2 and float(np.ptp(near)) > 0.015


class Plan:
    """Prices of places and the way to the goal, in the frame of the grid.

    Attributes:
        grid: Direction of the frame, rad.
        low: Place of the corner of the first cell.
        price: Price of a m of way in each cell.
        walls: Places on closed sides that no ray has seen, in the frame of the start.
    """

    def __init__(self, pose, maps, goal, visited):
        self.grid = pose.grid or 0.0
        goal, visited = (rotated(p, self.grid) for p in (goal, visited))
        sure = np.vstack([goal, visited])
        hits = rotated(maps.points(), self.grid)
        known = np.vstack([sure, hits])
        bounds = SIDE if pose.grid is not None else 9.0
        low = np.maximum(known.min(axis=0) - 0.4, sure.max(axis=0) - bounds)
        high = np.minimum(known.max(axis=0) + 0.4, sure.min(axis=0) + bounds)
        self.low = low
        shape = np.maximum(((high - low) / CELL).astype(int), 4)
        self.price = self.priced(hits, shape)
        self.walls = np.zeros((0, 2))
        if pose.grid is not None:
            self.add_lines(pose, maps, goal[0], hits)

    def priced(self, points, shape):
        """Price of each cell by the room to the points."""
        room = np.full(shape, 1.0)
        if len(points):
            reach = int((RADIUS + ROOMS[-1]) / CELL) + 2
            span = np.arange(-reach, reach + 1)
            at = np.floor((points - self.low) / CELL).astype(int)
            i = (at[:, 0, None] + span)[:, :, None]
            j = (at[:, 1, None] + span)[:, None, :]
            x = (i + 0.5) * CELL + self.low[0] - points[:, 0, None, None]
            y = (j + 0.5) * CELL + self.low[1] - points[:, 1, None, None]
            far = np.sqrt(x * x + y * y)
            good = (i >= 0) & (i < shape[0]) & (j >= 0) & (j < shape[1])
            i, j = np.broadcast_arrays(i, j)
            np.minimum.at(room, (i[good], j[good]), far[good])
        return PRICES[np.searchsorted(ROOMS, room - RADIUS, side="right")]

    def add_lines(self, pose, maps, goal, hits):
        """Adds what is known and believed about the sides of the cells."""
        seen, lines = [], []
        far = self.low + CELL * np.array(self.price.shape)
        for axis in (0, 1):
            middles = [0.0, float(goal[1 - axis])]
            guesses = lattice(pose.lines(axis), middles)
            seen.append(np.array(pose.lines(axis, guesses)))
            places = lattice(seen[axis].tolist(), middles)
            on = places > self.low[1 - axis] - PITCH
            lines.append(places[on & (places < far[1 - axis] + PITCH)])
        walls = [np.zeros((0, 2))]
        for axis in (0, 1):
            ends = [
                (float(end), bool((np.abs(seen[1 - axis] - end) < 0.02).any()))
                for end in lines[1 - axis]
            ]
            for place in lines[axis].tolist():
                near = np.abs(hits[:, 1 - axis] - place) < 0.018
                near &= bool((np.abs(seen[axis] - place) < 0.02).any())
                pieces = pose.closed(axis, place)
                for low, high in itertools.pairwise(ends):
                    at = np.arange(low[0], high[0], FINE)
                    points = np.empty((len(at), 2))
                    points[:, axis], points[:, 1 - axis] = at, place
                    shut = is_closed(low, high, pieces, hits[near, axis])
                    free = self.is_open(points, maps)
                    if shut[0] or (shut[1] and not free):
                        walls.append(points)
                    elif not free:
                        self.doubt(points)
        self.wall_off(np.concatenate(walls), maps)

    def is_open(self, points, maps):
        """Whether rays have passed a side, away from its ends."""
        i, j = cells(rotated(points[3:-3], -self.grid))
        return int(maps.passed[j, i].sum()) > 1

    def doubt(self, points):
        """Makes places on a side dearer."""
        i, j = np.floor((points - self.low) / CELL).astype(int).T
        inside = (i > 0) & (j > 0)
        inside &= (i < self.price.shape[0] - 1) & (j < self.price.shape[1] - 1)
        for u, v in set(zip(i[inside].tolist(), j[inside].tolist(), strict=True)):
            part = self.price[u - 1 : u + 1, v - 1 : v + 1]
            np.maximum(part, 1.0 + DOUBT, out=part)

    def wall_off(self, points, maps):
        """Closes the parts of closed sides that no ray has seen."""
        turned = rotated(points, -self.grid)
        i, j = cells(turned)
        unseen = ~maps.passed[j, i]
        points, self.walls = points[unseen], turned[unseen]
        guessed = np.minimum(self.priced(points, self.price.shape), GUESSED)
        self.price = np.maximum(self.price, guessed)

    def at(self, points):
        """Prices at points in the frame of the start."""
        i, j = np.floor((rotated(points, self.grid) - self.low) / CELL).astype(int).T
        i = i.clip(0, self.price.shape[0] - 1)
        j = j.clip(0, self.price.shape[1] - 1)
        return self.price[i, j]

    def costs(self, path):
        """What it costs to get to each point of a path."""
        prices = self.at(path)
        sizes = np.hypot(*np.diff(path, axis=0).T)
        return np.append(0.0, np.cumsum(0.5 * sizes * (prices[1:] + prices[:-1])))

    def path(self, start, goal):
        """Points of the cheapest way, if all unknown space is free; and its price."""
        rows, width = self.price.shape
        flat = self.price.ravel().tolist()
        ends = np.floor((rotated([start, goal], self.grid) - self.low) / CELL)
        (si, sj), (gi, gj) = ends.astype(int).tolist()
        first = si * width + sj
        best, came = {first: 0.0}, {}
        heap = [(CELL * math.hypot(gi - si, gj - sj), first)]
        near = TOLERANCE * 0.6 / CELL
        done = set()
        steps = [(i * width + j, CELL * size) for i, j, size in NEIGHBOURS]
        while heap:
            _, at = heapq.heappop(heap)
            if at in done:
                continue
            done.add(at)
            i, j = divmod(at, width)
            if math.hypot(gi - i, gj - j) <= near and flat[at] < 100.0:
                way = [at]
                while way[-1] in came:
                    way.append(came[way[-1]])
                way.reverse()
                places = np.column_stack(np.divmod(way, width)) + 0.5
                return rotated(places * CELL + self.low, -self.grid), best[at]
            if not (1 <= i < rows - 1 and 1 <= j < width - 1):
                continue
            here, mine = best[at], flat[at]
            for step, size in steps:
                to = at + step
                if to in done:
                    continue
                cost = here + 0.5 * size * (mine + flat[to])
                if cost < best.get(to, math.inf):
                    best[to] = cost
                    came[to] = at
                    u, v = divmod(to, width)
                    heapq.heappush(heap, (cost + CELL * math.hypot(gi - u, gj - v), to))
        return None, math.inf


NEIGHBOURS = [
    (i, j, math.hypot(i, j)) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j
]
TIMES = np.arange(1, 8)


def courses():
    """An arc of one, two, four or all steps, and then a straight line.

    Returns:
        Speeds, shape (n, 2), and x, y and heading after each step, shape (n, 7).
    """
    ends = [-1.0, -0.6, -0.2, 0.1, 0.3, 0.5, 0.65, 0.8, 0.9, 1.0]
    pairs = [(1.0, e) for e in ends] + [(e, 1.0) for e in ends[:-1]]
    pairs += [(0.5 * a, 0.5 * b) for a, b in pairs]
    pairs += [(0.25, -0.25), (-0.25, 0.25)]
    pairs += [(-0.5, -0.5), (-0.5, -0.2), (-0.2, -0.5)]
    speeds, places = [], []
    for left, right in pairs:
        for arc in (1, 2, 4, 7):
            if left == right and arc < 7:
                continue
            x = y = heading = 0.0
            row = []
            for t in TIMES.tolist():
                if t <= arc:
                    way, turn = 0.5 * (left + right), (right - left) * STEP / AXLE
                else:
                    way, turn = max(abs(left), abs(right)), 0.0
                    way = math.copysign(way, left + right + 1e-9)
                x += STEP * way * math.cos(heading + 0.5 * turn)
                y += STEP * way * math.sin(heading + 0.5 * turn)
                heading += turn
                row.append((x, y, heading))
            speeds.append((left, right))
            places.append(row)
    return np.array(speeds), np.array(places)


SPEEDS, PLACES = courses()
SPINS = np.where(SPEEDS.prod(axis=1) < 0.0, SPEEDS[:, 1] - SPEEDS[:, 0], 0.0)
STATE = {}


def reset(obs):
    """Forgets everything."""
    goal = [float(value) for value in obs["goal"]]
    STATE.update(
        pose=Pose(),
        maps=Map(),
        angles=np.zeros(2),
        goal=goal,
        offsets=[],
        offset=(0.0, 0.0),
        path=None,
        plan=None,
        age=99,
        now=0,
        trail=[],
        spin=0.0,
        ends=[None] * 8,
        runs=[[] for _ in range(8)],
        visited=[(0.0, 0.0)],
        dropped=-99,
    )


def sensed(ps):
    """Lengths of the rays on the floor, and which of them have hit something."""
    ps = np.asarray(ps, float)
    lengths = np.interp(ps, READINGS[::-1], LENGTHS[::-1])
    return FLAT * lengths, ps > SEEN


def tips(pose, lengths):
    """Where the rays end, shape (8, 2)."""
    x, y, heading = pose
    cosine, sine = math.cos(heading), math.sin(heading)
    ox = x + cosine * RAYS[:, 0] - sine * RAYS[:, 1]
    oy = y + sine * RAYS[:, 0] + cosine * RAYS[:, 1]
    angles = heading + RAYS[:, 2]
    return np.column_stack(
        [ox + lengths * np.cos(angles), oy + lengths * np.sin(angles)]
    )


def runs(ends, good):
    """Takes hits of each ray that follow each other, if they are in a line."""
    pose = STATE["pose"]
    for k, run in enumerate(STATE["runs"]):
        if not good[k]:
            run.clear()
            continue
        gap = math.dist(ends[k], run[-1]) if run else 1.0
        if gap > 0.025:
            run.clear()
        if gap > 0.003:
            run.append(ends[k].tolist())
        least = FIRST if pose.grid is None else SHORTEST
        if len(run) > 4 and math.dist(run[0], run[-1]) > least:
            pose.run(np.array(run))
            run.clear()


def pairs(ends, good):
    """Takes hits of neighbouring rays that are in line with the grid for a plate."""
    pose = STATE["pose"]
    for k in FORWARD:
        two = ends[[k, (k + 1) % 8]]
        if pose.grid is None or not (good[k] and good[(k + 1) % 8]):
            continue
        dx, dy = (two[1] - two[0]).tolist()
        length, direction = math.hypot(dx, dy), math.atan2(dy, dx)
        off = wrapped(direction - pose.grid, RIGHT)
        if SHORTEST < length < LONGEST and abs(off) < TILT:
            pose.plate(two, direction, 0.01)


def aim_around(x, y):
    """Goes around the goal in rings, if it is not where it is believed."""
    aim = STATE["aim"]
    gap = math.hypot(aim[0] - x, aim[1] - y)
    STATE["trail"] = [*STATE["trail"][-40:], (x, y)]
    stuck = len(STATE["trail"]) > 40 and np.ptp(STATE["trail"], axis=0).max() < 0.03
    if gap > 0.02 and not stuck:
        return
    if stuck:
        STATE["trail"] = []
        if gap > 0.3:
            STATE["maps"].forget((x, y), 0.2, STATE["now"] - 10)
            return
    if not STATE["offsets"]:
        for ring in range(1, 7):
            for k in range(6 * ring):
                angle = 2.0 * math.pi * k / (6 * ring)
                away = 1.3 * TOLERANCE * ring
                offset = away * math.cos(angle), away * math.sin(angle)
                STATE["offsets"].append(offset)
    STATE["offset"] = STATE["offsets"].pop(0)
    STATE["path"] = None


def plan(x, y):
    """Looks for the way to the goal, when there is need."""
    maps, path = STATE["maps"], STATE["path"]
    STATE["age"] += 1
    if path is not None and STATE["age"] < REPLAN:
        return
    STATE["age"] = 0
    visited = [*STATE["visited"], (x, y)]
    pose = STATE["pose"]
    new = STATE["plan"] = Plan(pose, maps, [pose.turned(STATE["goal"])], visited)
    found, cost = new.path((x, y), STATE["aim"])
    if cost > 20.0 and STATE["now"] - STATE["dropped"] > 40:
        STATE["dropped"] = STATE["now"]
        old = sorted(maps.hits, key=lambda key: maps.hits[key][1])
        for key in old[: max(len(old) // 4, 1)] if old else []:
            del maps.hits[key]
        if STATE["offsets"]:
            STATE["offset"] = STATE["offsets"].pop(0)
    if path is not None and found is not None:
        first = int(np.hypot(*(path - (x, y)).T).argmin())
        rest = np.vstack([(x, y), path[first + 1 :]])
        if float(new.costs(rest)[-1]) < cost + KEEP:
            found = path[first:]
    STATE["path"] = found


def target(x, y):
    """The farthest point of the path that a straight drive reaches as cheaply."""
    path = STATE["path"]
    if path is None or len(path) < 2:
        return STATE["aim"]
    gaps = np.hypot(path[:, 0] - x, path[:, 1] - y)
    first = int(gaps[:20].argmin())
    sums = STATE["plan"].costs(path[first:])
    last = min(len(path) - 1, first + int(LOOK / CELL))
    for k in range(last, first + 2, -2):
        far = float(gaps[k])
        if far > LOOK:
            continue
        share = np.linspace(0.0, 1.0, max(int(far / 0.01), 2))[:, None]
        straight = (1.0 - share) * (x, y) + share * path[k]
        if STATE["plan"].at(straight).mean() * far <= sums[k - first] * 1.1 + 0.015:
            break
    else:
        k = min(first + 3, len(path) - 1)
    if k == len(path) - 1:
        return STATE["aim"]
    return path[k].tolist()


def add_hits(ends, hit):
    """Keeps hits; what they are on goes on for a little, until a ray passes there."""
    maps, now = STATE["maps"], STATE["now"]
    for k, here in enumerate(ends):
        last, STATE["ends"][k] = STATE["ends"][k], here if hit[k] else None
        if not hit[k]:
            continue
        maps.hit(here, now)
        gap = math.dist(here, last) if last else 0.0
        if 0.003 < gap < 0.02:
            dx, dy = (BEYOND / gap * (a - b) for a, b in zip(here, last, strict=True))
            for guess in (here[0] + dx, here[1] + dy), (last[0] - dx, last[1] - dy):
                maps.hit(guess, now - 4, faint=True)


def policy(obs):
    """Speeds of the wheels (left, right)."""
    pose, maps = STATE["pose"], STATE["maps"]
    angles = np.asarray(obs["encoders"], float)
    left, right = (RIM * (angles - STATE["angles"])).tolist()
    STATE["angles"] = angles
    pose.moved(left, right)
    STATE["now"] += 1
    lengths, hit = sensed(obs["ps"])
    before = pose.state[:3].tolist()
    runs(tips(before, lengths), hit & (lengths < SHARP))
    pairs(tips(pose.state[:3], lengths), hit)
    place = pose.state[:3].tolist()
    maps.shift(before, place, STATE["now"] - RECENT)
    maps.carve(place, lengths, hit, STATE["now"])
    add_hits(tips(place, lengths).tolist(), hit)
    x, y, heading = place
    goal = pose.turned(STATE["goal"])
    STATE["aim"] = [g + o for g, o in zip(goal, STATE["offset"], strict=True)]
    if STATE["now"] % 8 == 0:
        STATE["visited"].append((x, y))
    aim_around(x, y)
    plan(x, y)
    return chosen(x, y, heading)


def chosen(x, y, heading):
    """Speeds of the course that leads best along the path."""
    cosine, sine = math.cos(heading), math.sin(heading)
    px = x + cosine * PLACES[:, :, 0] - sine * PLACES[:, :, 1]
    py = y + sine * PLACES[:, :, 0] + cosine * PLACES[:, :, 1]
    facing = heading + PLACES[:, :, 2]
    near = np.vstack([STATE["maps"].points(), STATE["plan"].walls])
    near = near[np.abs(near - (x, y)).max(axis=1) < 0.2]
    room = np.full(px.shape, 0.1)
    if len(near):
        gaps = np.hypot(px[..., None] - near[:, 0], py[..., None] - near[:, 1])
        room = gaps.min(axis=2) - RADIUS
        now = float(np.hypot(near[:, 0] - x, near[:, 1] - y).min()) - RADIUS
    else:
        now = 0.1
    least = min(MARGIN, now - 0.0005)
    fits = np.logical_and.accumulate(room >= least, axis=1)
    tx, ty = target(x, y)
    gap = np.hypot(tx - px, ty - py)
    bearing = np.abs(np.angle(np.exp(1j * (np.arctan2(ty - py, tx - px) - facing))))
    worth = gap + 0.004 * bearing + 0.004 * TIMES / 7.0
    worth = np.where(fits, worth, np.inf)
    price = worth[:, 3:].min(axis=1)
    price = price + RISK * np.exp(-np.maximum(room[:, :4].min(axis=1), 0.0) / SAFE)
    back = SPEEDS.sum(axis=1) < -0.1
    price = price + 0.05 * back + AGAIN * (SPINS * STATE["spin"] < 0.0)
    k = int(price.argmin())
    if not math.isfinite(price[k]):
        STATE["path"] = None
        return escape(room)
    STATE["spin"] = float(SPINS[k])
    return float(SPEEDS[k, 0]), float(SPEEDS[k, 1])


def escape(room):
    """Speeds of the course that leaves most room."""
    value = room[:, 1] + 0.5 * room[:, 3]
    value = value - 0.02 * (np.abs(SPEEDS).max(axis=1) > 0.7)
    k = int(value.argmax())
    return 0.5 * float(SPEEDS[k, 0]), 0.5 * float(SPEEDS[k, 1])
