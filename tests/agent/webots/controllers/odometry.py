"""Prints where it believes to be, from its encoders alone."""

import json
import math

from controller import Robot

WHEEL, AXLE = 0.02, 0.057
robot = Robot()
dt = int(robot.getBasicTimeStep())
sensors = [robot.getDevice(f"{side} wheel sensor") for side in ("left", "right")]
motors = [robot.getDevice(f"{side} wheel motor") for side in ("left", "right")]
for sensor, motor in zip(sensors, motors, strict=True):
    sensor.enable(dt)
    motor.setPosition(float("inf"))
    motor.setVelocity(0.0)
x, y, heading = -0.4, 0.0, 0.0
last = [0.0, 0.0]
step = 0
while robot.step(dt) != -1:
    now = [sensor.getValue() for sensor in sensors]
    left, right = ((b - a) * WHEEL for a, b in zip(last, now, strict=True))
    turn, way = (right - left) / AXLE, (left + right) / 2
    x += way * math.cos(heading + turn / 2)
    y += way * math.sin(heading + turn / 2)
    heading += turn
    last = now
    step += 1
    motors[0].setVelocity(2.0 + math.sin(step / 9))
    motors[1].setVelocity(2.5 - math.sin(step / 11))
    print(json.dumps({"t": round(robot.getTime(), 3), "pose": [x, y, heading]}))
