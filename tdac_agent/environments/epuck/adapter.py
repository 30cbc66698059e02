"""Drives an e-puck in Webots with the verified controller in `tdac_policy.py`.

The controller is called once per step of the world, with the observations it was
verified with: the pose (from the supervisor), the goal, the last wheel speeds, the
readings of ps0 to ps7, and the wheel angles. It returns wheel speeds as fractions of
the maximum.
"""

from __future__ import annotations

import json
import math
import os
from typing import Any

import numpy as np
from controller import Supervisor

HERE = os.path.dirname(os.path.abspath(__file__))
WHEELS = ("left", "right")


class SupervisedEPuck:
    """The robot, with the controller's observations and actions."""

    def __init__(self, params: dict[str, Any]) -> None:
        self.robot = Supervisor()
        self.node = self.robot.getSelf()
        self.step_ms = int(self.robot.getBasicTimeStep())
        self.goal = params["goal"]
        self.limit = params["robot"]["max_wheel_speed"]
        self.motors = [self.robot.getDevice(f"{s} wheel motor") for s in WHEELS]
        self.encoders = [self.robot.getDevice(f"{s} wheel sensor") for s in WHEELS]
        self.ps = [self.robot.getDevice(f"ps{k}") for k in range(8)]
        for sensor in (*self.encoders, *self.ps):
            sensor.enable(self.step_ms)
        for motor in self.motors:
            motor.setPosition(float("inf"))
        self.speeds = [0.0, 0.0]

    def step(self, left: float, right: float) -> bool:
        """Drives for a step; returns False if the simulation has ended."""
        self.speeds = [min(max(float(speed), -1.0), 1.0) for speed in (left, right)]
        for wheel, motor in enumerate(self.motors):
            motor.setVelocity(self.speeds[wheel] * self.limit)
        return bool(self.robot.step(self.step_ms) != -1)

    def pose(self) -> tuple[float, float, float]:
        """Returns x, y and heading in (-pi, pi], m and rad."""
        x, y, _ = self.node.getPosition()
        turn = self.node.getOrientation()
        return x, y, math.atan2(turn[3], turn[0])

    def observe(self) -> dict[str, Any]:
        """Returns the controller's observation."""
        observation = {
            "pose": self.pose(),
            "goal": self.goal,
            "wheel_speeds": self.speeds,
            "ps": [sensor.getValue() for sensor in self.ps],
            "wheel_positions": [sensor.getValue() for sensor in self.encoders],
        }
        return {key: np.array(item, np.float32) for key, item in observation.items()}


def main() -> None:
    """Drives until the goal is reached or the horizon is over."""
    os.chdir(HERE)
    with open("params.json", encoding="utf-8") as file:
        params = json.load(file)
    epuck = SupervisedEPuck(params)
    import tdac_policy

    # Sensors have no readings before the first step.
    alive = epuck.step(0.0, 0.0)
    reset = getattr(tdac_policy, "reset", None)
    if alive and reset is not None:
        reset(epuck.observe())
    steps = 0
    while alive and steps < params["horizon"]:
        left, right = tdac_policy.policy(epuck.observe())
        alive = epuck.step(left, right)
        steps += 1
        if math.dist(epuck.pose()[:2], params["goal"]) <= params["goal_tolerance"]:
            print(f"reached the goal after {steps} steps")
            break
    else:
        print(f"not at the goal after {steps} steps")
    if alive:
        epuck.step(0.0, 0.0)


if __name__ == "__main__":
    main()
