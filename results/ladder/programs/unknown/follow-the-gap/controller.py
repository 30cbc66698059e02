"""Follow the gap: of the directions with room for the body, the one nearest the goal.

Sezer and Gokasan, "A novel obstacle avoidance algorithm: follow the gap method", 2012,
with the width of the body taken off each hit. It has no memory.
"""

import json
import math

import numpy as np

with open("params.json") as file:
    PARAMS = json.load(file)
ROBOT = PARAMS["robot"]
VIEW = math.radians(ROBOT["field_of_view_deg"])
ANGLES = np.linspace(-VIEW / 2, VIEW / 2, ROBOT["n_rays"])
BODY = ROBOT["radius"] + 1.5
AHEAD = 16.0  # px that must be free in a direction


def free_lengths(ranges):
    """How far the body can drive in the direction of each ray, px."""
    off = np.remainder(ANGLES[None, :] - ANGLES[:, None] + math.pi, math.tau) - math.pi
    along, beside = ranges * np.cos(off), ranges * np.abs(np.sin(off))
    near = (beside < BODY) & (along > 0.0)
    back = np.sqrt(np.maximum(BODY * BODY - beside * beside, 0.0))
    return np.min(np.where(near, along - back, ROBOT["range_max"]), axis=1)


def policy(obs):
    """The fractions of the wheels' full speed, left and right."""
    x, y, heading = (float(value) for value in obs["pose"])
    goal_x, goal_y = (float(value) for value in obs["goal"])
    wanted = math.atan2(goal_y - y, goal_x - x) - heading
    far = math.hypot(goal_x - x, goal_y - y)
    free = free_lengths(obs["ranges"].astype(float))
    off = np.abs(np.remainder(ANGLES - wanted + math.pi, math.tau) - math.pi)
    is_open = free >= min(AHEAD, far)
    cost = np.where(is_open, off + 0.3 * np.abs(ANGLES), 100.0 - free)
    best = int(np.argmin(cost))
    turn = max(-1.0, min(1.0, 2.0 * float(ANGLES[best])))
    ahead = float(free[np.abs(ANGLES) < 0.1].min())
    forward = max(0.0, min(1.0, ahead / 12.0)) * (1.0 - abs(turn))
    return forward + turn, forward - turn
