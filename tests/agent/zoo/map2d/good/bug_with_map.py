# idea: a tangent bug: straight to the goal, else past the best corner in sight
# profile: policy
import math

import numpy as np
import sensors

ROBOT = sensors.load_params()["robot"]


def grown(occ, radius):
    """Walls and rim, grown by a disc."""
    reach = math.ceil(radius)
    padded = np.pad(occ, reach, constant_values=True)
    result = np.zeros_like(occ)
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            if math.hypot(dx, dy) <= radius:
                view = padded[reach + dy :, reach + dx :]
                result |= view[: occ.shape[0], : occ.shape[1]]
    return result


BLOCKED = grown(sensors.load_occupancy(), ROBOT["radius"] + 3)


def corners(blocked):
    """Free pixels at convex corners: one diagonal neighbour blocked, sides free."""
    padded = np.pad(blocked, 1, constant_values=True)

    def at(dy, dx):
        return padded[
            1 + dy : padded.shape[0] - 1 + dy, 1 + dx : padded.shape[1] - 1 + dx
        ]

    found = np.zeros_like(blocked)
    for dy in (-1, 1):
        for dx in (-1, 1):
            found |= at(dy, dx) & ~at(dy, 0) & ~at(0, dx)
    found &= ~blocked
    return [(int(x), int(y)) for y, x in np.argwhere(found)]


def is_straight(a, b):
    count = math.ceil(math.dist(a, b)) + 1
    xs = np.rint(np.linspace(a[0], b[0], count)).astype(int)
    ys = np.rint(np.linspace(a[1], b[1], count)).astype(int)
    return not BLOCKED[ys, xs].any()


def ways_from(goal):
    """Length from each corner to the goal, from corner to corner in sight."""
    lengths, after = {goal: 0.0}, {goal: goal}
    waiting, done = {*CORNERS, goal}, set()
    while waiting & lengths.keys():
        here = min(waiting & lengths.keys(), key=lengths.get)
        waiting.remove(here)
        done.add(here)
        for there in waiting:
            length = lengths[here] + math.dist(here, there)
            if length < lengths.get(there, math.inf) and is_straight(here, there):
                lengths[there], after[there] = length, here
    return lengths


# Off the corners of what may be driven through, so that lines past them are free.
CORNERS = corners(grown(sensors.load_occupancy(), ROBOT["radius"] + 5))
STATE = {}


def choose(x, y):
    """The point in sight with the shortest way over it; the nearest if none is."""
    ranked = sorted(
        STATE["ways"], key=lambda p: math.dist(p, (x, y)) + STATE["ways"][p]
    )
    for point in ranked:
        if math.dist(point, (x, y)) > 2 and is_straight((x, y), point):
            return point
    return min(ranked, key=lambda p: math.dist(p, (x, y)) < 2 or math.dist(p, (x, y)))


def reset(obs):
    goal = (float(obs["goal"][0]), float(obs["goal"][1]))
    STATE.update(ways=ways_from(goal), aim=None)


def policy(obs):
    if not STATE:
        reset(obs)
    x, y, heading = map(float, obs["pose"])
    aim = STATE["aim"]
    if aim is None or math.dist(aim, (x, y)) < 2:
        aim = STATE["aim"] = choose(x, y)
    error = math.remainder(math.atan2(aim[1] - y, aim[0] - x) - heading, math.tau)
    if abs(error) > 0.1:
        turn = math.copysign(min(abs(error), 0.6), error)
        return turn, -turn
    speed = min(0.8, 0.2 + math.dist(aim, (x, y)) / 10)
    return speed + 0.4 * error, speed - 0.4 * error
