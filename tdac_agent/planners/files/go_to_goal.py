"""Turns to the goal and drives there; knows nothing of obstacles.

No paper: the least that a controller can do. Without a pose, the robot is located by
dead reckoning from its odometry or its wheel encoders.
"""

TURN_GAIN = 2.0
"""Share of the full turn on the spot for each rad that the goal is aside, 1/rad."""


def reset(obs):
    """Begins an episode."""
    STATE["pose"] = Odometer()
    STATE["pose"].update(obs)


def policy(obs):
    """The fractions of the wheels' full speed, left and right."""
    pose = STATE["pose"]
    pose.update(obs)
    goal_x, goal_y = (float(value) for value in obs["goal"])
    off = math.atan2(goal_y - pose.y, goal_x - pose.x) - pose.heading
    off = SIDE * math.remainder(off, math.tau)  # positive: to the right
    turn = max(-1.0, min(1.0, TURN_GAIN * off))
    forward = max(0.0, math.cos(off)) * (1.0 - abs(turn))
    return forward + turn, forward - turn
