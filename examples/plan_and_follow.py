"""A controller that plans on the map: for tasks on maps, in pixels and in metres.

It computes in pixels: `sensors.to_pixels` converts a pose, and does nothing if the task
is in pixels already.

    tdac verify examples/plan_and_follow.py --task clutter --profile policy
"""

import heapq
import math

import numpy as np
import sensors

PARAMS = sensors.load_params()
PIXEL = PARAMS["resolution"] if PARAMS["frame"] == "metres" else 1.0
RADIUS = PARAMS["robot"]["radius"] / PIXEL  # px
CELL = max(1, int(RADIUS / 3))  # the plan has cells of CELL x CELL pixels
AHEAD = {}  # of each cell, the next one on the way to the goal
STEPS = [(j, i) for j in (-1, 0, 1) for i in (-1, 0, 1) if j or i]


def cell_of(place):
    """The cell (row, column) of a place of the task."""
    i, j = sensors.to_cell(float(place[0]), float(place[1]))
    return j // CELL, i // CELL


def costs():
    """Cost of each free cell (row, column): high near walls, very high too near."""
    walls = sensors.load_occupancy()  # [y, x], True = occupied
    more = [(0, -n % CELL) for n in walls.shape]
    walls = np.pad(walls, more, constant_values=True)
    rows, columns = walls.shape[0] // CELL, walls.shape[1] // CELL
    walls = walls.reshape(rows, CELL, columns, CELL).any(axis=(1, 3))
    reach = 2 * math.ceil(RADIUS / CELL)
    padded = np.pad(walls, reach, constant_values=True)
    room = np.full(walls.shape, float(reach))
    for j in range(-reach, reach + 1):
        for i in range(-reach, reach + 1):
            near = padded[reach + j :, reach + i :][:rows, :columns]
            room[near & (room > math.hypot(i, j))] = math.hypot(i, j)
    cost = 1 + 3 * (reach - room) + 1000 * (room * CELL <= RADIUS)
    return {
        (j, i): value
        for j, row in enumerate(cost.tolist())
        for i, value in enumerate(row)
        if not walls[j, i]
    }


def reset(obs):
    """Plans once: Dijkstra's search over the cells, from the goal to the start."""
    cost, start, goal = costs(), cell_of(obs["pose"]), cell_of(obs["goal"])
    best, queue = {goal: 0.0}, [(0.0, goal)]
    while queue and queue[0][1] != start:
        so_far, (j, i) = heapq.heappop(queue)
        if so_far > best[j, i]:
            continue
        for dj, di in STEPS:
            new = j + dj, i + di
            total = so_far + math.hypot(dj, di) * cost.get(new, math.inf)
            if total < best.get(new, math.inf):
                best[new], AHEAD[new] = total, (j, i)
                heapq.heappush(queue, (total, new))


def policy(obs):
    """Steers at a point of the plan, and slows down where a wall is near ahead."""
    x, y, heading = sensors.to_pixels(*map(float, obs["pose"]))
    cell = cell_of(obs["pose"])
    for _ in range(4):
        cell = AHEAD.get(cell, cell)
    off = math.atan2((cell[0] + 0.5) * CELL - y, (cell[1] + 0.5) * CELL - x) - heading
    off = math.remainder(off, math.tau)
    if abs(off) > 0.4:  # turn on the spot: in pixels, right is positive
        return (0.3, -0.3) if off > 0 else (-0.3, 0.3)
    angles = np.array(PARAMS["robot"]["ray_angles"])
    free = obs["ranges"][np.abs(angles) < 0.5].min() / PIXEL - RADIUS
    speed = min(0.6, max(0.1, free / RADIUS))
    return speed + off, speed - off
