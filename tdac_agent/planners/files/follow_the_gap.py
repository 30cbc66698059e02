"""Follow the gap: to the middle of the widest gap, the more the nearer obstacles are.

V. Sezer and M. Gokasan, "A novel obstacle avoidance algorithm: Follow the Gap Method",
Robotics and Autonomous Systems 60(9), 2012.

Obstacles are the hits of the scan ahead, made larger by the body. Of the gaps between
them, the widest is chosen; the heading is the mean of the direction to the middle
between its borders, with the weight ALPHA / (distance of the nearest obstacle), and of
that of the goal, with the weight 1. It has no memory. Without a pose, the robot is
located by dead reckoning.
"""

ALPHA = 20.0
"""Weight of the gap at 1 px from the nearest obstacle, px."""
FRONT = 180.0
"""Angle ahead in which gaps are looked for, degrees."""
GAP = 24.0
"""Distance that the body can drive in a direction that belongs to a gap, px."""
ROOM = 1.0
"""Room that the body keeps to obstacles, px."""
TURN_GAIN = 0.7
"""Share of the heading that is turned in a step."""
SLOW = 12.0
"""Free distance ahead below which the robot drives slower, px."""

AHEAD = np.abs(FAN) <= math.radians(FRONT) / 2.0 + 1e-6
BODY = RADIUS + ROOM


def free_lengths(ranges, bearings, angles):
    """How far the body can drive in each direction, px."""
    hit = ranges < RANGE - 1e-3
    off = bearings[hit][None, :] - angles[:, None]
    along, beside = ranges[hit] * np.cos(off), np.abs(ranges[hit] * np.sin(off))
    near = (beside < BODY) & (along > 0.0)
    back = np.sqrt(np.maximum(BODY * BODY - beside * beside, 0.0))
    found = np.where(near, along - back, RANGE)
    return found.min(axis=1, initial=RANGE)


def widest_gap(free):
    """First and last index of the longest run of open directions; None if none is."""
    is_open = np.concatenate([[False], free >= GAP, [False]])
    edges = np.flatnonzero(is_open[1:] != is_open[:-1])
    if not edges.size:
        return None
    first, after = edges[::2], edges[1::2]
    k = int((after - first).argmax())
    return int(first[k]), int(after[k]) - 1


def gap_centre(angles, ranges, gap):
    """The direction to the middle between the borders of a gap, rad."""
    first, last = max(gap[0] - 1, 0), min(gap[1] + 1, len(angles) - 1)
    ends = [
        (ranges[k] * math.cos(angles[k]), ranges[k] * math.sin(angles[k]))
        for k in (first, last)
    ]
    x, y = ends[0][0] + ends[1][0], ends[0][1] + ends[1][1]
    if angles[last] - angles[first] > 0.99 * math.pi or math.hypot(x, y) < 1e-6:
        return (angles[first] + angles[last]) / 2.0
    return math.atan2(y, x)


def reset(obs):
    """Begins an episode."""
    STATE.update(pose=Odometer(), turn=0.0)
    STATE["pose"].update(obs)


def policy(obs):
    """The fractions of the wheels' full speed, left and right."""
    pose = STATE["pose"]
    pose.update(obs)
    goal_x, goal_y = (float(value) for value in obs["goal"])
    wanted = math.atan2(goal_y - pose.y, goal_x - pose.x) - pose.heading
    wanted = math.remainder(wanted, math.tau)
    ranges, bearings = from_centre(np.asarray(obs["ranges"], float)[ORDER])
    angles, seen = bearings[AHEAD], ranges[AHEAD]
    free = free_lengths(ranges, bearings, angles)
    gap = widest_gap(free)
    if gap is None:  # turn on, on the spot, until there is one
        heading = math.copysign(math.pi, STATE["turn"])
    else:
        weight = ALPHA / max(float(seen.min()) - RADIUS, 0.5)
        heading = (weight * gap_centre(angles, seen, gap) + wanted) / (weight + 1.0)
    turn = max(-1.0, min(1.0, TURN_GAIN * heading / SPIN))
    ways = np.array([0.0, turn * SPIN])
    ahead = float(free_lengths(ranges, bearings, ways).min())
    forward = max(0.0, min(1.0, ahead / SLOW)) * (1.0 - abs(turn))
    STATE["turn"] = turn
    return forward + turn, forward - turn
