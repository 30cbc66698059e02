# idea: reset plans the whole episode as a list of arcs; policy only corrects its drift
# profile: policy
"""Turns and straight drives with their lengths, and feedback on the pose reached."""

import heapq
import math

import numpy as np
import sensors

ROBOT = sensors.load_params()["robot"]
STEP = ROBOT["max_wheel_speed"] * 0.05


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


def plan(blocked, start, goal):
    """A* from pixel to pixel."""
    height, width = blocked.shape
    cost, came, queue = {start: 0.0}, {start: None}, [(0.0, start)]
    while queue:
        _, here = heapq.heappop(queue)
        if here == goal:
            break
        x, y = here
        for dx, dy in (
            (1, 0),
            (-1, 0),
            (0, 1),
            (0, -1),
            (1, 1),
            (1, -1),
            (-1, 1),
            (-1, -1),
        ):
            i, j = x + dx, y + dy
            if not (0 <= i < width and 0 <= j < height) or blocked[j, i]:
                continue
            if blocked[y, i] or blocked[j, x]:
                continue
            price = cost[here] + math.hypot(dx, dy)
            if price < cost.get((i, j), math.inf):
                cost[i, j], came[i, j] = price, here
                heapq.heappush(queue, (price + math.dist((i, j), goal), (i, j)))
    path = [goal]
    while came[path[-1]] is not None:
        path.append(came[path[-1]])
    return path[::-1]


def simplified(points, tolerance=1.0):
    """Douglas and Peucker's corners of a polyline."""
    if len(points) < 3:
        return points
    (ax, ay), (bx, by) = points[0], points[-1]
    length = math.hypot(bx - ax, by - ay)
    away = [
        abs((bx - ax) * (ay - y) - (ax - x) * (by - ay)) / max(length, 1e-9)
        if length
        else math.hypot(x - ax, y - ay)
        for x, y in points
    ]
    k = max(range(len(points)), key=away.__getitem__)
    if away[k] <= tolerance:
        return [points[0], points[-1]]
    return simplified(points[: k + 1])[:-1] + simplified(points[k:])


def free_pixel(blocked, x, y):
    free = np.argwhere(~blocked)
    k = np.hypot(free[:, 1] - x, free[:, 0] - y).argmin()
    return int(free[k, 1]), int(free[k, 0])


LEGS = []


def reset(obs):
    blocked = grown(sensors.load_occupancy(), ROBOT["radius"] + 4)
    x, y, _ = obs["pose"].tolist()
    goal = obs["goal"].tolist()
    path = plan(blocked, free_pixel(blocked, x, y), free_pixel(blocked, *goal))
    LEGS[:] = [*simplified(path), tuple(goal)]


def policy(obs):
    x, y, heading = obs["pose"].tolist()
    while len(LEGS) > 1 and math.dist(LEGS[0], (x, y)) < 2.0:
        del LEGS[0]
    bearing = math.atan2(LEGS[0][1] - y, LEGS[0][0] - x)
    error = math.remainder(bearing - heading, math.tau)
    exact = error * ROBOT["axle_length"] / (2 * STEP)
    if abs(exact) > 0.25:
        turn = max(-0.9, min(0.9, exact))
        return turn, -turn
    forward = min(math.dist(LEGS[0], (x, y)) / STEP, 0.75)
    return forward + exact, forward - exact
