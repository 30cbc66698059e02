"""Turns to the goal and drives there; knows nothing of obstacles.

No paper: the least that a controller can do. Without a pose, the robot is located by
dead reckoning from its odometry or its wheel encoders.
"""

import json
import math

with open("params.json") as file:
    PARAMS = json.load(file)
ROBOT = PARAMS["robot"]
SIDE = -1.0 if ROBOT.get("kind") == "epuck" else 1.0  # the side of positive headings

TURN_GAIN = 2.0
"""Share of the full turn on the spot for each rad that the goal is aside, 1/rad."""


class Odometer:
    """The pose: observed, or from dead reckoning."""

    def __init__(self):
        self.x = self.y = self.heading = 0.0
        self.angles = 0.0, 0.0

    def update(self, obs):
        """Takes over an observation."""
        if "pose" in obs:
            self.x, self.y, self.heading = (float(value) for value in obs["pose"])
        elif "odometry" in obs:
            self.move(*(float(value) for value in obs["odometry"]))
        else:
            angles = tuple(float(value) for value in obs["encoders"])
            left, right = (
                (new - old) * ROBOT["wheel_radius"]
                for new, old in zip(angles, self.angles, strict=True)
            )
            self.angles = angles
            turn = SIDE * (left - right) / ROBOT["axle_length"]
            self.move((left + right) / 2.0, turn)

    def move(self, length, turn):
        """Drives an arc."""
        self.x += length * math.cos(self.heading + turn / 2.0)
        self.y += length * math.sin(self.heading + turn / 2.0)
        self.heading = math.remainder(self.heading + turn, math.tau)


STATE = {}


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
