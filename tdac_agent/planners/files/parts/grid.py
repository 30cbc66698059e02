"""A part of planners: a grid of what the scans hit, and the way to the goal on it.

A planner that has it sets FREE, INFLATION and MEMORY.
"""

DELAY = PARAMS["disturbances"]["delay"]
SLACK = 0.5
"""By how much the plan may come too near to obstacles, px."""
THIN = 0.3
"""Hits nearer than this to known obstacles are not added, px."""
NOISE = 0.0
"""Standard deviation of a range, as a share of it; THIN is wider by as much."""
CLEAR = 4.0
"""A hit is cleared if the rays beside it go further by so much, px."""
CELL = 2
"""Pitch of the plan, px."""
REPLAN = 5
"""Steps between plans while the obstacles change."""
REACH = int(RADIUS + 8.0)
"""Distance up to which clearances are known, px."""

AROUND = np.arange(-REACH, REACH + 1, dtype=np.float32)
FAR = np.float32(REACH * REACH)
TO_GO = 1e6  # px; stands for "no way"


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

    def scan(self, x, y, heading, ranges, hit, now):
        """Clears what the rays pass, and marks what some of them hit."""
        if len(self.points):
            dx, dy = self.points[:, 0] - x, self.points[:, 1] - y
            off = np.remainder(np.arctan2(dy, dx) - heading + math.pi, math.tau)
            ray = np.floor((off - math.pi - FAN[0]) / VIEW * (RAYS - 1)).astype(int)
            inside = (ray >= 0) & (ray < RAYS - 1)
            ray = np.clip(ray, 0, RAYS - 2)
            free = np.minimum(ranges[ray], ranges[ray + 1])
            gone = inside & (np.hypot(dx, dy) < np.minimum(free - CLEAR, RANGE / 2.0))
            if self.age == 0:
                gone |= now - self.points[:, 2] > MEMORY
            if gone.any():
                self.remove(gone)
        ends = np.column_stack(
            [
                x + ranges[hit] * np.cos(heading + FAN[hit]),
                y + ranges[hit] * np.sin(heading + FAN[hit]),
            ]
        )
        new, thin = [], THIN + NOISE * ranges[hit]
        far = self.clearance(ends[:, 0], ends[:, 1]) > thin
        for (a, b), least in zip(ends[far].tolist(), thin[far].tolist(), strict=True):
            if self.near[self.entry(a, b)] > least * least:
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

    def entries(self, x, y):
        """Rows and columns of the px at places."""
        most = self.side - 1
        return (
            np.clip(np.rint(y).astype(int) - self.top, 0, most),
            np.clip(np.rint(x).astype(int) - self.left, 0, most),
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
        price = 1.0 + INFLATION * np.clip(1.0 - room / FREE, 0.0, 1.0) ** 2
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

    def way_point(self, x, y, distance):
        """The place so far along the planned way."""
        wide, flat = self.costs.shape[1], self.costs.ravel()
        i, j = round((x - self.left) / CELL), round((y - self.top) / CELL)
        around = [(a, b) for a in range(-2, 3) for b in range(-2, 3) if a or b]
        shifts = np.array([b * wide + a for a, b in around])
        lengths = CELL * np.array([math.hypot(a, b) for a, b in around])
        at, left = j * wide + i, distance
        while left > 0.0:
            k = int((flat[at + shifts] + lengths).argmin())
            if flat[at + shifts[k]] >= flat[at]:
                break
            at += int(shifts[k])
            left -= lengths[k]
        j, i = divmod(at, wide)
        if flat[at] < 2.0 * CELL:
            return self.goal
        return i * CELL + self.left, j * CELL + self.top


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


def recovers(grid, pose, steps, begin=lambda: None):
    """Whether the robot turns on the spot, since it got no further.

    At the beginning, the grid forgets its hits, and `begin` is called.
    """
    trail = STATE["trail"] = [*STATE["trail"][-steps:], (pose.x, pose.y)]
    if len(trail) > steps and np.ptp(trail, axis=0).max() < 3.0:
        STATE["trail"], STATE["turns"] = [], math.ceil(math.pi * AXLE / SPEED / DT)
        begin()
        if len(grid.points):
            grid.remove(np.ones(len(grid.points), bool))
    STATE["turns"] -= 1
    return STATE["turns"] >= 0


def begin_on_grid(obs):
    """The pose and the grid at the beginning of an episode."""
    pose = Odometer()
    pose.update(obs)
    goal = tuple(float(value) for value in obs["goal"])
    STATE.update(pose=pose, grid=Grid(pose.x, pose.y, goal), time=0.0)
    STATE.update(trail=[], turns=0)
