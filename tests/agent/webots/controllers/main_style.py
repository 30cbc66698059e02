"""Functions, a main, and a second Robot at its end that should not be there."""

from controller import Robot

TIME_STEP = 32
MAX_SPEED = 6.28


def init_devices(robot):
    left = robot.getDevice("left wheel motor")
    right = robot.getDevice("right wheel motor")
    for motor in (left, right):
        motor.setPosition(float("inf"))
        motor.setVelocity(0.0)
    prox = [robot.getDevice(f"ps{i}") for i in range(8)]
    for sensor in prox:
        sensor.enable(TIME_STEP)
    return left, right, prox


def run(max_steps):
    robot = Robot()
    left, right, prox = init_devices(robot)
    steps = 0
    while robot.step(TIME_STEP) != -1 and steps < max_steps:
        blocked = max(prox[0].getValue(), prox[7].getValue()) > 80
        left.setVelocity(0.5 * MAX_SPEED)
        right.setVelocity(-0.5 * MAX_SPEED if blocked else 0.5 * MAX_SPEED)
        steps += 1
    return {"steps": steps, "time": round(robot.getTime(), 3)}


def main():
    print(run(120))
    robot = Robot()
    print(robot.getBasicTimeStep(), robot.step(TIME_STEP))


if __name__ == "__main__":
    main()
