"""GPS and compass: turns until the goal is ahead, then drives."""

import math

from controller import Robot

GOAL = (0.4, 0.0)
robot = Robot()
timestep = 16  # whatever the world says
gps = robot.getDevice("gps")
compass = robot.getDevice("compass")
gps.enable(timestep)
compass.enable(timestep)
left = robot.getDevice("left wheel motor")
right = robot.getDevice("right wheel motor")
left.setPosition(float("inf"))
right.setPosition(float("inf"))
left.setVelocity(0)
right.setVelocity(0)


def bearing():
    north = compass.getValues()
    return math.atan2(north[0], north[1])


while robot.step(timestep) != -1:
    x, y, z = gps.getValues()
    if math.isnan(x):
        continue
    wanted = math.atan2(GOAL[1] - y, GOAL[0] - x)
    off = (wanted - bearing() + math.pi) % (2 * math.pi) - math.pi
    if abs(off) > 0.1:
        left.setVelocity(-1.0 if off > 0 else 1.0)
        right.setVelocity(1.0 if off > 0 else -1.0)
    else:
        left.setVelocity(4.0)
        right.setVelocity(4.0)
