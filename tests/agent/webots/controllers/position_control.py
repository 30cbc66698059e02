"""Position control: a quarter turn, 10 cm ahead, back; then the program ends."""

import math

from controller import Robot

WHEEL, AXLE = 0.02, 0.057
robot = Robot()
timestep = int(robot.getBasicTimeStep())
motors = [robot.getDevice("left wheel motor"), robot.getDevice("right wheel motor")]
sensors = [motor.getPositionSensor() for motor in motors]
for sensor in sensors:
    sensor.enable(timestep)
target = [0.0, 0.0]


def move(left, right, speed=3.0):
    target[0] += left
    target[1] += right
    for motor, angle in zip(motors, target, strict=True):
        motor.setVelocity(speed)
        motor.setPosition(angle)
    for _ in range(500):
        robot.step(timestep)
        angles = [sensor.getValue() for sensor in sensors]
        if all(
            abs(angle - wanted) < 0.004
            for angle, wanted in zip(angles, target, strict=True)
        ):
            break
    robot.step(20 * timestep)


quarter = math.pi / 2 * AXLE / 2 / WHEEL
move(-quarter, quarter)
move(0.1 / WHEEL, 0.1 / WHEEL)
move(-0.1 / WHEEL, -0.1 / WHEEL)
print("done after", robot.getTime() > 1.0)
