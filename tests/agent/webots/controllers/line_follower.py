"""Follows a dark line with its three ground sensors."""

from controller import Robot

robot = Robot()
timestep = int(robot.getBasicTimeStep())
ground = [robot.getDevice(name) for name in ("gs0", "gs1", "gs2")]
for sensor in ground:
    sensor.enable(timestep)
left, right = robot.getDevice("left wheel motor"), robot.getDevice("right wheel motor")
for motor in (left, right):
    motor.setPosition(float("inf"))
    motor.setVelocity(0.0)
while robot.step(timestep) != -1:
    delta = ground[2].getValue() - ground[0].getValue()
    left.setVelocity(2.5 - 0.004 * delta)
    right.setVelocity(2.5 + 0.004 * delta)
