# idea: a potential field whose attraction is the planned way, so without local minima
# profile: policy
"""Attraction along the gradient of a harmonic-like field, repulsion from the rays."""

import math
from collections import deque

import numpy as np
import sensors

PARAMS = sensors.load_params()
ROBOT = PARAMS["robot"]
HALF = math.radians(ROBOT["field_of_view_deg"]) / 2
ANGLES = np.linspace(-HALF, HALF, ROBOT["n_rays"])


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


def flood(blocked, goal):
    """Steps to the goal, then smoothed, so that it has a usable gradient."""
    height, width = blocked.shape
    steps = np.full(blocked.shape, -1.0)
    steps[goal[1], goal[0]] = 0.0
    queue = deque([goal])
    while queue:
        x, y = queue.popleft()
        for i, j in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
            inside = 0 <= i < width and 0 <= j < height
            if inside and steps[j, i] < 0 and not blocked[j, i]:
                steps[j, i] = steps[y, x] + 1
                queue.append((i, j))
    field = np.where(steps < 0, steps.max() + 30, steps)
    for _ in range(6):
        padded = np.pad(field, 1, mode="edge")
        field = (
            padded[:-2, 1:-1] + padded[2:, 1:-1] + padded[1:-1, :-2] + padded[1:-1, 2:]
        ) / 4
    return field


FIELD = []


def reset(obs):
    blocked = grown(sensors.load_occupancy(), ROBOT["radius"] + 2)
    goal = (round(float(obs["goal"][0])), round(float(obs["goal"][1])))
    FIELD[:] = np.gradient(-flood(blocked, goal))


def attraction(x, y):
    """Mean downhill direction over a few pixels around."""
    rows, columns = slice(max(y - 2, 0), y + 3), slice(max(x - 2, 0), x + 3)
    force = np.array([FIELD[1][rows, columns].mean(), FIELD[0][rows, columns].mean()])
    return force / max(np.hypot(*force), 1e-9)


def repulsion(obs, heading):
    """Away from what the rays see within a body's width of the hull."""
    gaps = np.maximum(obs["ranges"].astype(float) - ROBOT["radius"], 0.5)
    weights = np.where(gaps < 4.0, 0.6 * (1 / gaps - 1 / 4.0), 0.0)
    pushes = -weights * np.array([np.cos(heading + ANGLES), np.sin(heading + ANGLES)])
    return np.clip(pushes.sum(axis=1), -0.8, 0.8)


def policy(obs):
    if not FIELD:
        reset(obs)
    x, y, heading = map(float, obs["pose"])
    way = obs["goal"].astype(float) - (x, y)
    pull = (
        way / np.hypot(*way) if np.hypot(*way) < 12 else attraction(round(x), round(y))
    )
    force = pull + repulsion(obs, heading)
    error = math.remainder(math.atan2(force[1], force[0]) - heading, math.tau)
    speed = 0.5 * max(0.0, math.cos(error)) ** 2
    turn = max(-0.35, min(0.35, 0.7 * error))
    return speed + turn, speed - turn
