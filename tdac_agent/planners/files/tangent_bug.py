"""TangentBug with a sensor of finite range.

I. Kamon, E. Rimon and E. Rivlin, "TangentBug: A range-sensor-based navigation
algorithm", International Journal of Robotics Research 17(9), 1998; conditions as in
H. Choset et al., "Principles of Robot Motion", MIT Press 2005, chapter 2.

Motion to the goal: straight if the way is free as far as one sees, else to the edge of
an obstacle by which the way to the goal is shortest. If all edges are further from the
goal than the robot, it follows the boundary, until it sees a place that is nearer to
the goal than all places seen before. The body is taken off the obstacles. Hits are
remembered for a while, since the sensors of most levels do not see behind. Without a
pose, the robot is located by dead reckoning.
"""

TOLERANCE = PARAMS["goal_tolerance"]

ROOM = 0.5
"""Room that the body keeps to obstacles, px."""
AHEAD = 12.0
"""Distance that must be free in a direction, px."""
TURN_GAIN = 0.7
"""Share of the heading that is turned in a step."""
SLOW = 10.0
"""Free distance ahead below which the robot drives slower, px."""
MEMORY = 20.0
"""Time for which a hit is remembered, s."""
LEAVE = 3.0
"""By how much a place must be nearer to the goal to leave the boundary, px."""

NEAR = 60.0
"""Distance up to which hits are looked at, px."""
DIRECTIONS = np.arange(180) * (math.tau / 180.0)
"""Directions that are looked at, rad."""
BACK = 60
"""Directions by which following looks back to the side of the boundary."""


def remembered(pose, ranges):
    """Adds the hits of a scan; all hits nearby, relative to the robot."""
    hits, now = STATE["hits"], STATE["time"]
    hit = ranges < RANGE - 1e-3
    from_x, from_y = scanner_at(pose)
    x = from_x + ranges[hit] * np.cos(pose.heading + FAN[hit])
    y = from_y + ranges[hit] * np.sin(pose.heading + FAN[hit])
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        hits[round(a), round(b)] = a, b, now
    points = np.array(list(hits.values())).reshape(-1, 3)
    if STATE["step"] % 10 == 0:
        old = points[:, 2] < now - MEMORY
        for key in [k for k, gone in zip(hits, old.tolist(), strict=True) if gone]:
            del hits[key]
    points = points[points[:, 2] >= now - MEMORY, :2] - (pose.x, pose.y)
    return points[np.hypot(points[:, 0], points[:, 1]) < NEAR]


def free_lengths(points, angles):
    """How far the body can drive in each direction, at most NEAR px."""
    if not len(points):
        return np.full(len(angles), NEAR)
    body = min(RADIUS + ROOM, float(np.hypot(points[:, 0], points[:, 1]).min()) - 0.01)
    cosine, sine = np.cos(angles)[:, None], np.sin(angles)[:, None]
    along = cosine * points[:, 0] + sine * points[:, 1]
    beside = cosine * points[:, 1] - sine * points[:, 0]
    near = (np.abs(beside) < body) & (along > 0.0)
    back = np.sqrt(np.maximum(body * body - beside * beside, 0.0))
    return np.minimum(np.where(near, along - back, NEAR).min(axis=1), NEAR)


def edges(free, pose, goal):
    """Edges of obstacles: index of the direction, and distance of the edge from goal
    and robot.
    """
    is_open = free >= AHEAD
    found = []
    for step in (1, -1):
        beside = np.roll(is_open, step)
        for k in np.flatnonzero(is_open & ~beside).tolist():
            length = max(float(free[(k - step) % len(free)]), 0.0) + RADIUS
            x = pose.x + length * math.cos(DIRECTIONS[k])
            y = pose.y + length * math.sin(DIRECTIONS[k])
            found.append((k, math.hypot(goal[0] - x, goal[1] - y), length))
    return found


def nearest_seen(free, pose, goal):
    """Distance from the goal of the nearest place that the robot sees it can reach."""
    x = pose.x + free * np.cos(DIRECTIONS)
    y = pose.y + free * np.sin(DIRECTIONS)
    return float(np.hypot(goal[0] - x, goal[1] - y).min())


def to_goal(free, pose, goal, wanted, points):
    """The direction to the goal or an edge; None where the boundary is followed."""
    far = math.hypot(goal[0] - pose.x, goal[1] - pose.y)
    straight = float(free_lengths(points, np.array([wanted]))[0])
    if straight >= min(far - TOLERANCE, NEAR):
        return wanted
    found = edges(free, pose, goal)
    if not found:
        return float(DIRECTIONS[int(free.argmax())])
    k, left, _ = min(found, key=lambda edge: edge[1] + edge[2])
    if left < far:
        return float(DIRECTIONS[k])
    off = math.remainder(DIRECTIONS[k] - wanted, math.tau)
    STATE["side"] = 1 if off > 0.0 else -1
    STATE["least"] = min(STATE["least"], nearest_seen(free, pose, goal))
    STATE["last"] = wanted + STATE["side"] * math.pi / 2.0
    return None


def along_boundary(free):
    """The first free direction from that of the boundary."""
    side, last = STATE["side"], STATE["last"]
    start = round(last / math.tau * len(DIRECTIONS)) - side * BACK
    order = (start + side * np.arange(len(DIRECTIONS))) % len(DIRECTIONS)
    is_open = free[order] >= AHEAD
    k = int(order[int(is_open.argmax())] if is_open.any() else free.argmax())
    STATE["last"] = float(DIRECTIONS[k])
    return STATE["last"]


def reset(obs):
    """Begins an episode."""
    STATE.update(pose=Odometer(), hits={}, time=0.0, step=0)
    STATE.update(follows=False, side=1, least=math.inf, last=0.0)
    STATE["pose"].update(obs)


def policy(obs):
    """The fractions of the wheels' full speed, left and right."""
    pose, goal = STATE["pose"], [float(value) for value in obs["goal"]]
    pose.update(obs)
    STATE["time"] += DT
    STATE["step"] += 1
    points = remembered(pose, np.asarray(obs["ranges"], float)[ORDER])
    free = free_lengths(points, DIRECTIONS)
    wanted = math.atan2(goal[1] - pose.y, goal[0] - pose.x)
    if STATE["follows"] and nearest_seen(free, pose, goal) < STATE["least"] - LEAVE:
        STATE["follows"] = False
    direction = None
    if not STATE["follows"]:
        direction = to_goal(free, pose, goal, wanted, points)
        STATE["follows"] = direction is None
    if direction is None:
        direction = along_boundary(free)
    off = math.remainder(direction - pose.heading, math.tau)
    turn = max(-1.0, min(1.0, TURN_GAIN * off / SPIN))
    ahead = free_lengths(points, pose.heading + np.array([0.0, turn * SPIN]))
    forward = max(0.0, min(1.0, float(ahead.min()) / SLOW)) * (1.0 - abs(turn))
    return forward + turn, forward - turn
