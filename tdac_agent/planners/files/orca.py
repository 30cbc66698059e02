"""Optimal reciprocal collision avoidance (ORCA) on a grid with a navigation function.

J. van den Berg, S. J. Guy, M. Lin and D. Manocha, "Reciprocal n-body collision
avoidance", Robotics Research (ISRR 2009), Springer 2011.

Discs are found in successive scans as groups of hits on a circle, and their velocities
from their places; all other hits are walls, marked and cleared in an obstacle layer
over the map if one is given. Dijkstra's costs of the way to the goal over it give the
preferred velocity. Each disc and each piece of wall nearby forbids a half-plane of
velocities; the one nearest to the preferred velocity is chosen from a fine set. The
robot turns to it, forwards or backwards, and drives as far as the walls allow in its
present direction. If it gets no further, it clears the obstacle layer and turns on the
spot.
"""

HORIZON = 2.0
"""Time for which a velocity must not lead into a disc, s."""
WALL_HORIZON = 0.4
"""Time for which a velocity must not lead into a wall, s."""
SHARE = 1.0
"""Part of avoiding that the robot takes on; 0.5 if the others do the same."""
ROOM = 1.5
"""Room that is kept to discs, px."""
MARGIN = 0.5
"""Room that is kept to walls, px."""
TURN_GAIN = 0.8
"""Part of the angle to the chosen velocity that is turned in a step."""
LOOKAHEAD = 16.0
"""Distance of the way-point along the planned way, px."""
INFLATION = 1.0
"""How much more the way costs beside an obstacle, as a factor."""
SMOOTH = 0.6
"""Weight of the newest measurement of a disc's velocity."""

FREE = 6.0
"""Clearance beyond the body from which obstacles cost the way nothing, px."""
JUMP = 6.0
"""Distance of neighbouring hits that belong to different things, px."""
LARGEST = 10.0
"""Largest radius of a disc, px."""
GATE = 6.0
"""Distance within which a disc is taken for the one that was expected there, px."""
LOST = 10
"""Steps after which a disc that is not seen is forgotten."""
SLOWEST = 4.0
"""Speed from which a disc is not taken for a part of the walls, px/s."""
NEAR = 60.0
"""Distance up to which walls restrict the velocity, px."""
MEMORY = 1000.0
"""Time after which a hit is forgotten, s; looked at after each plan."""
STUCK = 100
"""Steps within 3 px after which the robot recovers."""


def velocities():
    """Velocities among which one is chosen: x and y, as shares of the full speed."""
    speeds, angles = np.linspace(0.1, 1.0, 10), np.arange(72) * (math.tau / 72.0)
    found = speeds[:, None, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.vstack([[(0.0, 0.0)], found.reshape(-1, 2)])


CHOICE = SPEED * velocities()


class Disc:
    """A disc that was seen, with its velocity."""

    def __init__(self, place, radius):
        self.place, self.radius = np.array(place), radius
        self.velocity, self.seen, self.unseen = np.zeros(2), 1, 0

    def expected(self):
        """The place after the steps since it was last seen."""
        return self.place + self.velocity * DT * (self.unseen + 1)

    def moves(self):
        """Whether it may be more than a part of the walls."""
        return self.seen < 3 or math.hypot(*self.velocity) > SLOWEST

    def update(self, place, radius):
        """Takes over a new place."""
        measured = (np.array(place) - self.place) / (DT * (self.unseen + 1))
        weight = SMOOTH if self.seen > 1 else 1.0
        self.velocity = self.velocity + weight * (measured - self.velocity)
        self.place, self.radius = np.array(place), radius
        self.seen, self.unseen = self.seen + 1, 0


def groups(x, y, hit):
    """Groups of neighbouring hits: lists of the numbers of rays."""
    found, before = [], None
    for k in np.flatnonzero(hit).tolist():
        if before == k - 1 and math.hypot(x[k] - x[k - 1], y[k] - y[k - 1]) < JUMP:
            found[-1].append(k)
        else:
            found.append([k])
        before = k
    return found


def circle(x, y, from_x, from_y):
    """Centre and radius of the disc that hits may be of; None if they are not."""
    if len(x) < 3 or math.hypot(x[-1] - x[0], y[-1] - y[0]) > 2.0 * LARGEST:
        return None
    matrix = np.column_stack([2.0 * x, 2.0 * y, np.ones(len(x))])
    (a, b, c), *_ = np.linalg.lstsq(matrix, x * x + y * y, rcond=None)
    radius = math.sqrt(max(c + a * a + b * b, 0.0))
    off = np.abs(np.hypot(x - a, y - b) - radius).max()
    nearest = np.hypot(x - from_x, y - from_y).min()
    if math.hypot(a - from_x, b - from_y) < nearest or off > 0.5:
        return None
    return ((float(a), float(b)), radius) if 3.0 < radius < LARGEST else None


def hidden(free, x, y):
    """The disc whose few visible hits these may be, from where it is expected."""
    for disc in free:
        a, b = disc.expected()
        if len(x) < 3 and np.hypot(x - a, y - b).max() < disc.radius + GATE:
            return disc
    return None


def track(grid, pose, ranges):
    """Renews the discs; returns which rays hit walls."""
    hit = ranges < RANGE - 1e-3
    from_x, from_y = scanner_at(pose)
    x = from_x + ranges * np.cos(pose.heading + FAN)
    y = from_y + ranges * np.sin(pose.heading + FAN)
    walls = hit.copy()
    hit &= np.sqrt(grid.base[grid.entries(x, y)]) > 2.5
    discs, free = STATE["discs"], list(STATE["discs"])
    for group in sorted(groups(x, y, hit), key=len, reverse=True):
        found = circle(x[group], y[group], from_x, from_y)
        gaps = [math.dist(found[0], disc.expected()) for disc in free] if found else []
        if gaps and min(gaps) < GATE:
            disc = free.pop(gaps.index(min(gaps)))
            disc.update(*found)
        elif found:
            disc = Disc(*found)
            discs.append(disc)
        else:
            disc = hidden(free, x[group], y[group])
        walls[group] &= disc is None or not disc.moves()
    for disc in free:
        disc.unseen += 1
    STATE["discs"] = [disc for disc in discs if disc.unseen < LOST]
    return walls


def disc_plane(place, velocity, radius, own):
    """The half-plane (normal, least value along it) that a disc leaves.

    The place is relative to the robot, and the radius that of both together.
    """
    relative, far = own - velocity, math.hypot(*place)
    if far <= radius:  # leave it within a step
        middle, cut = place / DT, radius / DT
    else:
        middle, cut = place / HORIZON, radius / HORIZON
        from_cut = relative - middle
        along = float(from_cut @ place)
        if along > 0.0 or along**2 <= radius**2 * float(from_cut @ from_cut):
            # The nearest side of the cone.
            leg = math.sqrt(far * far - radius * radius)
            side = 1.0 if place[0] * from_cut[1] > place[1] * from_cut[0] else -1.0
            ahead = (
                np.array(
                    [
                        place[0] * leg - side * place[1] * radius,
                        side * place[0] * radius + place[1] * leg,
                    ]
                )
                / far**2
            )
            normal = side * np.array([-ahead[1], ahead[0]])
            change = -float(relative @ normal)
            return normal, float(own @ normal) + SHARE * change
    from_cut = relative - middle
    long = max(math.hypot(*from_cut), 1e-9)
    normal = from_cut / long
    return normal, float(own @ normal) + SHARE * (cut - long)


def half_planes(pose, ranges, walls, own):
    """Normals and least values along them: those of walls, then those of discs."""
    far, bearings = from_centre(ranges)
    k = np.flatnonzero(walls & (far < NEAR))
    angles = pose.heading + bearings[k]
    normals = -np.column_stack([np.cos(angles), np.sin(angles)])
    room = far[k] - RADIUS - MARGIN
    least = -np.maximum(room, 0.0) / WALL_HORIZON
    count, here = len(k), np.array([pose.x, pose.y])
    for disc in STATE["discs"]:
        if not disc.moves():
            continue
        place = disc.place + disc.velocity * DT * disc.unseen - here
        radius = RADIUS + disc.radius + ROOM
        normal, value = disc_plane(place, disc.velocity, radius, own)
        normals, least = np.vstack([normals, normal]), np.append(least, value)
    return normals, least, count


def chosen(preferred, normals, least, count):
    """The allowed velocity nearest to the preferred one.

    If there is none, the one that enters the half-planes of discs least.
    """
    found = np.vstack([CHOICE, [preferred]])
    if len(least):
        lacking = least - normals @ preferred
        found = np.vstack([found, preferred + lacking[:, None] * normals])
        found = found[np.hypot(found[:, 0], found[:, 1]) <= SPEED + 1e-6]
        missing = least[:, None] - normals @ found.T
        walls = missing[:count].max(axis=0, initial=-np.inf) <= 1e-6
        worst = missing[count:].max(axis=0, initial=-np.inf)
        allowed = walls & (worst <= 1e-6)
        if not allowed.any():
            return found[int(np.where(walls, worst, np.inf).argmin())]
        found = found[allowed]
    return found[int(((found - preferred) ** 2).sum(axis=1).argmin())]


def reset(obs):
    """Begins an episode."""
    begin_on_grid(obs)
    STATE.update(discs=[], own=np.zeros(2))


def policy(obs):
    """The fractions of the wheels' full speed, left and right."""
    pose, grid = STATE["pose"], STATE["grid"]
    pose.update(obs)
    STATE["time"] += DT
    ranges = np.asarray(obs["ranges"], float)[ORDER]
    walls = track(grid, pose, ranges)
    grid.scan(*scanner_at(pose), pose.heading, ranges, walls, STATE["time"])
    grid.replan(pose.x, pose.y)
    if recovers(grid, pose, STUCK):
        return 1.0, -1.0
    x, y = grid.way_point(pose.x, pose.y, LOOKAHEAD)
    way = np.array([x - pose.x, y - pose.y])
    far = max(math.hypot(*way), 1e-6)
    preferred = way / far * min(SPEED, far / DT)
    normals, least, count = half_planes(pose, ranges, walls, STATE["own"])
    velocity = chosen(preferred, normals, least, count)
    ahead = np.array([math.cos(pose.heading), math.sin(pose.heading)])
    speed = math.hypot(*velocity)
    off = math.atan2(velocity[1], velocity[0]) - pose.heading if speed > 1e-3 else 0.0
    off = math.remainder(off, math.tau)
    sign = 1.0 if abs(off) <= math.pi / 2.0 else -1.0
    off, ahead = math.remainder(off, math.pi), sign * ahead
    turn = max(-1.0, min(1.0, TURN_GAIN * off / (2.0 * SPEED * DT / AXLE)))
    towards = normals[:count] @ ahead
    limits = least[:count][towards < -1e-3] / towards[towards < -1e-3]
    speed = max(0.0, speed * math.cos(off))
    speed = min(speed, float(limits.min(initial=SPEED)), SPEED * (1.0 - abs(turn)))
    STATE["own"] = speed * ahead
    return sign * speed / SPEED + turn, sign * speed / SPEED - turn
