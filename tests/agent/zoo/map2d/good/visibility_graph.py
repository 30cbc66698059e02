# idea: corners of obstacles, joined where they see each other; Dijkstra among them
# profile: policy
"""The shortest polyline over a few hundred points, driven with a cosine law."""

import heapq
import math

import numpy as np
import sensors

PARAMS = sensors.load_params()
ROBOT = PARAMS["robot"]
REACH = ROBOT["radius"] + 3.0
OCC = sensors.load_occupancy()
HEIGHT, WIDTH = OCC.shape
# Walls as seen by the middle of the body: square sums over a summed-area table.
TABLE = np.pad(OCC, 1).cumsum(axis=0).cumsum(axis=1)


def is_clear(x, y):
    """Whether the square around a point holds no wall and lies on the map."""
    x, y, reach = round(x), round(y), math.ceil(REACH)
    if not (reach <= x < WIDTH - reach and reach <= y < HEIGHT - reach):
        return False
    a, b, c, d = y - reach, y + reach + 1, x - reach, x + reach + 1
    return TABLE[b, d] - TABLE[a, d] - TABLE[b, c] + TABLE[a, c] == 0


def sees(a, b):
    count = math.ceil(math.dist(a, b) / 1.5) + 1
    return all(
        is_clear(a[0] + (b[0] - a[0]) * k / count, a[1] + (b[1] - a[1]) * k / count)
        for k in range(count + 1)
    )


def corner_points():
    """Points just off the corners of the walls."""
    off, points = REACH + 1.5, set()
    quads = OCC[:-1, :-1] * 1 + OCC[1:, :-1] + OCC[:-1, 1:] + OCC[1:, 1:]
    for y, x in np.argwhere(quads == 1).tolist():
        for dx in (-off, off):
            for dy in (-off, off):
                point = (round(x + 0.5 + dx), round(y + 0.5 + dy))
                if is_clear(*point):
                    points.add(point)
    return sorted(points)


def shortest(points, start, goal):
    """Polyline from start to goal over points that see each other."""
    queue, done = [(0.0, start, (start,))], set()
    while queue:
        length, here, path = heapq.heappop(queue)
        if here == goal:
            return list(path)
        if here in done:
            continue
        done.add(here)
        for there in (*points, goal):
            if there not in done and sees(here, there):
                after = length + math.dist(here, there)
                heapq.heappush(queue, (after, there, (*path, there)))
    return [start, goal]


WAY = []


def reset(obs):
    x, y, _ = map(float, obs["pose"])
    goal = (float(obs["goal"][0]), float(obs["goal"][1]))
    around = [(x + dx, y + dy) for dx in range(-9, 10) for dy in range(-9, 10)]
    start = min((p for p in around if is_clear(*p)), key=lambda p: math.dist(p, (x, y)))
    WAY[:] = shortest(corner_points(), start, goal)


def policy(obs):
    if not WAY:
        reset(obs)
    x, y, heading = map(float, obs["pose"])
    while len(WAY) > 1 and math.dist(WAY[0], (x, y)) < 2.5:
        WAY.pop(0)
    far = math.dist(WAY[0], (x, y))
    error = math.remainder(math.atan2(WAY[0][1] - y, WAY[0][0] - x) - heading, math.tau)
    speed = min(0.6, 0.1 + far / 15) * max(
        0.0, math.cos(min(abs(3 * error), math.pi / 2))
    )
    turn = max(-0.4, min(0.4, 0.7 * error))
    return speed + turn, speed - turn
