# idea: every direction is worked out at import; a step is one look-up
# profile: policy
"""A table of headings for each cell, made by value iteration before the first step."""

import math

import numpy as np
import sensors

PARAMS = sensors.load_params()
ROBOT = PARAMS["robot"]
CELL = 2


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


def values(blocked, goal):
    """Way to the goal for each cell, by sweeping until nothing changes."""
    value = np.full(blocked.shape, np.inf)
    value[goal] = 0.0
    turns = [(0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)]
    while True:
        before = value.copy()
        padded = np.pad(value, 1, constant_values=np.inf)
        for dy, dx in turns:
            near = padded[
                1 + dy : padded.shape[0] - 1 + dy, 1 + dx : padded.shape[1] - 1 + dx
            ]
            value = np.minimum(value, near + math.hypot(dy, dx))
        value[blocked] = np.inf
        if np.array_equal(value, before):
            return value


def headings(value):
    """Direction to the lowest cell of the 7 x 7 around each."""
    best = np.full(value.shape, np.inf)
    table = np.zeros(value.shape)
    padded = np.pad(value, 3, constant_values=np.inf)
    height, width = value.shape
    for dy in range(-3, 4):
        for dx in range(-3, 4):
            near = padded[3 + dy : 3 + dy + height, 3 + dx : 3 + dx + width]
            # Among blocked cells, the nearest free one is the way out.
            price = near + np.where(np.isinf(value), 50.0, 0.2) * math.hypot(dy, dx)
            table = np.where(price < best, math.atan2(dy, dx), table)
            best = np.minimum(best, price)
    return table


BLOCKED = grown(sensors.load_occupancy(), ROBOT["radius"] + 3)[::CELL, ::CELL]
GOAL = round(PARAMS["goal"][1] / CELL), round(PARAMS["goal"][0] / CELL)
TABLE = headings(values(BLOCKED, GOAL))


def policy(obs):
    x, y, heading = obs["pose"].tolist()
    goal_x, goal_y = obs["goal"].tolist()
    if math.hypot(goal_x - x, goal_y - y) < 10:
        wanted = math.atan2(goal_y - y, goal_x - x)
    else:
        wanted = TABLE[round(y / CELL), round(x / CELL)]
    error = math.remainder(wanted - heading, math.tau)
    turn = max(-0.4, min(0.4, 0.6 * error))
    speed = 0.5 if abs(error) < 0.5 else 0.1 if abs(error) < 0.8 else 0.0
    return speed + turn, speed - turn
