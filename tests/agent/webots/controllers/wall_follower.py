"""Wall follower: drives on, turns away from what is ahead, keeps the wall right."""

from controller import Robot


def run_robot(robot):
    timestep = 32
    left_motor = robot.getDevice("left wheel motor")
    right_motor = robot.getDevice("right wheel motor")
    for motor in (left_motor, right_motor):
        motor.setPosition(float("inf"))
        motor.setVelocity(0.0)
    sensors = [robot.getDevice(f"ps{ind}") for ind in range(8)]
    for sensor in sensors:
        sensor.enable(timestep)
    found = False
    while robot.step(timestep) != -1:
        value = [sensor.getValue() for sensor in sensors]
        ahead = max(value[0], value[7], value[1]) > 95
        beside = value[2] > 75
        found = found or ahead
        if ahead:
            left_speed, right_speed = -1.5, 1.5
        elif value[2] > 130:
            left_speed, right_speed = 2.6, 3.2
        elif beside or not found:
            left_speed, right_speed = 3.0, 3.0
        else:
            left_speed, right_speed = 3.2, 2.1
        left_motor.setVelocity(left_speed)
        right_motor.setVelocity(right_speed)


if __name__ == "__main__":
    run_robot(Robot())
