"""A part of planners: what is known of the robot, and its pose."""

import json
import math

with open("params.json") as file:
    PARAMS = json.load(file)
ROBOT, DT = PARAMS["robot"], PARAMS["dt"]
RADIUS, AXLE, SPEED = ROBOT["radius"], ROBOT["axle_length"], ROBOT["max_wheel_speed"]
SIDE = -1.0 if ROBOT.get("kind") == "epuck" else 1.0  # the side of positive headings
STATE = {}
"""What a planner remembers within an episode."""


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

    def ahead(self, commands):
        """The pose after commands that have not taken effect yet."""
        later = Odometer()
        later.x, later.y, later.heading = self.x, self.y, self.heading
        for left, right in commands:
            later.move(
                (left + right) / 2.0 * SPEED * DT, (left - right) * SPEED * DT / AXLE
            )
        return later
