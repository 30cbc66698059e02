# idea: as little as will do: a wave from the goal, and steering towards lower values
# profile: policy
import math
from collections import deque

import numpy as np
import sensors

PARAMS = sensors.load_params()
ROBOT = PARAMS["robot"]
CELL = 4


def coarse_map():
    """Cells of 4 x 4 px that keep the body off every wall; True = blocked."""
    occupied = np.pad(sensors.load_occupancy(), CELL, constant_values=True)
    reach = math.ceil(ROBOT["radius"] + 4)
    ys, xs = np.nonzero(occupied)
    blocked = np.zeros(occupied.shape, bool)
    for dy in range(-reach, reach + 1):
        width = math.isqrt(reach**2 - dy**2)
        rows = np.clip(ys + dy, 0, occupied.shape[0] - 1)
        for dx in range(-width, width + 1):
            blocked[rows, np.clip(xs + dx, 0, occupied.shape[1] - 1)] = True
    return blocked[CELL::CELL, CELL::CELL]


def wave(blocked, goal):
    """Number of cells to the goal, breadth first; inf where there is no way."""
    steps = np.full(blocked.shape, np.inf)
    steps[goal] = 0
    queue = deque([goal])
    while queue:
        j, i = queue.popleft()
        for b, a in ((j, i + 1), (j, i - 1), (j + 1, i), (j - 1, i)):
            inside = 0 <= b < blocked.shape[0] and 0 <= a < blocked.shape[1]
            if inside and not blocked[b, a] and math.isinf(steps[b, a]):
                steps[b, a] = steps[j, i] + 1
                queue.append((b, a))
    return steps


def cell_of(point):
    return round(float(point[1]) / CELL), round(float(point[0]) / CELL)


STEPS = wave(coarse_map(), cell_of(PARAMS["goal"]))


def target(j, i):
    """The cell to drive to: the lowest within two cells, else the nearest usable."""
    around = [
        (STEPS[b, a], math.hypot(b - j, a - i), b, a)
        for b in range(max(j - 2, 0), min(j + 3, STEPS.shape[0]))
        for a in range(max(i - 2, 0), min(i + 3, STEPS.shape[1]))
    ]
    _, _, b, a = min(around)
    return a * CELL, b * CELL


def policy(obs):
    x, y, heading = map(float, obs["pose"])
    goal_x, goal_y = map(float, obs["goal"])
    aim_x, aim_y = target(*cell_of((x, y)))
    if math.hypot(goal_x - x, goal_y - y) < 3 * CELL:
        aim_x, aim_y = goal_x, goal_y
    error = math.remainder(math.atan2(aim_y - y, aim_x - x) - heading, math.tau)
    turn = max(-0.5, min(0.5, error))
    forward = 0.5 if abs(error) < 0.6 else 0.0
    return forward + turn, forward - turn
