"""Braitenberg: each wheel's speed is a weighted sum of the distance sensors."""

from controller import Robot

TIME_STEP = 64
MAX_SPEED = 6.28
LEFT = [-0.9, -0.85, -0.2, 0.6, 0.5, 0.35, 0.8, 0.6]
RIGHT = [0.9, 0.85, 0.25, -0.3, -0.35, -0.6, -0.75, -0.55]

robot = Robot()
ps = []
for i in range(8):
    ps.append(robot.getDevice("ps" + str(i)))
    ps[i].enable(TIME_STEP)
left_motor = robot.getDevice("left wheel motor")
right_motor = robot.getDevice("right wheel motor")
left_motor.setPosition(float("inf"))
right_motor.setPosition(float("inf"))
left_motor.setVelocity(0.0)
right_motor.setVelocity(0.0)

while robot.step(TIME_STEP) != -1:
    near = [max(sensor.getValue() - 70.0, 0.0) / 60.0 for sensor in ps]
    left = right = 0.6 * MAX_SPEED
    for i in range(8):
        left -= -LEFT[i] * near[i] * MAX_SPEED
        right -= -RIGHT[i] * near[i] * MAX_SPEED
    left_motor.setVelocity(max(-MAX_SPEED, min(MAX_SPEED, left)))
    right_motor.setVelocity(max(-MAX_SPEED, min(MAX_SPEED, right)))
