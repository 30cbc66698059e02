"""Turns to the goal and drives there; knows nothing of obstacles."""

import math


def policy(obs):
    """The fractions of the wheels' full speed, left and right."""
    x, y, heading = (float(value) for value in obs["pose"])
    goal_x, goal_y = (float(value) for value in obs["goal"])
    error = math.remainder(math.atan2(goal_y - y, goal_x - x) - heading, math.tau)
    turn = max(-1.0, min(1.0, 2.0 * error))  # positive: to the right
    forward = max(0.0, math.cos(error)) * (1.0 - abs(turn))
    return forward + turn, forward - turn
