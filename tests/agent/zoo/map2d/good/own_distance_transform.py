# idea: its own exact distance transform, to keep to the middle of the corridors
# profile: policy
"""Felzenszwalb's lower envelope of parabolas; the search pays for nearness to walls."""

import heapq
import math

import numpy as np
import sensors

ROBOT = sensors.load_params()["robot"]


def envelope(costs):
    """min over q of (p - q)^2 + costs[q], for each p of one line."""
    count = len(costs)
    places, borders = [0], [-math.inf, math.inf]
    for q in range(1, count):
        while True:
            p = places[-1]
            cut = (costs[q] + q * q - costs[p] - p * p) / (2 * (q - p))
            if cut > borders[-2]:
                break
            places.pop()
            borders.pop(-2)
        places.append(q)
        borders.insert(-1, cut)
    result, k = [], 0
    for p in range(count):
        while borders[k + 1] < p:
            k += 1
        result.append((p - places[k]) ** 2 + costs[places[k]])
    return result


def distance_transform(occ):
    """Distance of each pixel to the nearest wall or rim, px."""
    walls = np.pad(occ, 1, constant_values=True)
    squares = np.where(walls, 0.0, 1e6)
    squares = np.array([envelope(column) for column in squares.T.tolist()]).T
    squares = np.array([envelope(row) for row in squares.tolist()])
    return np.sqrt(squares[1:-1, 1:-1])


CLEAR = distance_transform(sensors.load_occupancy())
HEIGHT, WIDTH = CLEAR.shape
ROOM = CLEAR - ROBOT["radius"] > 1.5
PRICE = (1 + 40 / np.maximum(CLEAR - ROBOT["radius"], 0.5) ** 2).tolist()


def centred_path(start, goal):
    """The cheapest way; a pixel near a wall is dear."""
    cost, came, queue = {start: 0.0}, {start: start}, [(0.0, start)]
    while queue:
        spent, here = heapq.heappop(queue)
        if here == goal:
            break
        if spent > cost[here]:
            continue
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
            x, y = here[0] + dx, here[1] + dy
            if 0 <= x < WIDTH and 0 <= y < HEIGHT and ROOM[y, x]:
                price = spent + math.hypot(dx, dy) * PRICE[y][x]
                if price < cost.get((x, y), math.inf):
                    cost[x, y], came[x, y] = price, here
                    heapq.heappush(queue, (price, (x, y)))
    path = [goal]
    while came[path[-1]] != path[-1]:
        path.append(came[path[-1]])
    return path[::-1]


def usable(x, y):
    rows, columns = np.nonzero(ROOM)
    k = ((columns - x) ** 2 + (rows - y) ** 2).argmin()
    return int(columns[k]), int(rows[k])


PATH = []


def reset(obs):
    goal = obs["goal"].tolist()
    PATH[:] = centred_path(usable(*obs["pose"][:2].tolist()), usable(*goal))
    PATH.append(tuple(goal))


def policy(obs):
    x, y, heading = obs["pose"].tolist()
    here = CLEAR[round(y), round(x)]
    reach = max(5.0, min(here - ROBOT["radius"] + 4.0, 14.0))
    near = min(range(len(PATH)), key=lambda k: math.dist(PATH[k], (x, y)))
    ahead = next(
        (k for k in range(near, len(PATH)) if math.dist(PATH[k], (x, y)) > reach),
        len(PATH) - 1,
    )
    aim = PATH[ahead]
    error = math.remainder(math.atan2(aim[1] - y, aim[0] - x) - heading, math.tau)
    speed = (0.7 if here > ROBOT["radius"] + 5 else 0.4) * max(
        0.0, math.cos(error)
    ) ** 4
    turn = max(-0.3, min(0.3, 0.8 * error))
    return speed + turn, speed - turn
