"""A supervisor that reads where it is and where the goal is."""

import math

from controller import Supervisor

robot = Supervisor()
timestep = int(robot.getBasicTimeStep())
me = robot.getSelf()
goal = robot.getFromDef("GOAL").getField("translation").getSFVec3f()
wheels = [robot.getDevice(f"{side} wheel motor") for side in ("left", "right")]
for wheel in wheels:
    wheel.setPosition(float("inf"))
    wheel.setVelocity(0)

while robot.step(timestep) != -1:
    x, y, _ = me.getPosition()
    turn = me.getOrientation()
    heading = math.atan2(turn[3], turn[0])
    off = math.atan2(goal[1] - y, goal[0] - x) - heading
    off = math.atan2(math.sin(off), math.cos(off))
    forward = 4.0 * max(math.cos(off), 0.0)
    wheels[0].setVelocity(forward - 2.0 * off)
    wheels[1].setVelocity(forward + 2.0 * off)
