"""Bug: straight to the goal; on a hit, along the wall until the line is met again."""

import math

from controller import Supervisor

MAX = 6.28


class Bug:
    def __init__(self):
        self.robot = Supervisor()
        self.dt = int(self.robot.getBasicTimeStep())
        self.node = self.robot.getSelf()
        self.goal = self.robot.getFromDef("GOAL").getPosition()
        self.ps = [self.robot.getDevice(f"ps{i}") for i in range(8)]
        for sensor in self.ps:
            sensor.enable(self.dt)
        self.left = self.robot.getDevice("left wheel motor")
        self.right = self.robot.getDevice("right wheel motor")
        for motor in (self.left, self.right):
            motor.setPosition(float("inf"))
            motor.setVelocity(0.0)
        self.state, self.hit = "goal", 0.0

    def pose(self):
        x, y, _ = self.node.getPosition()
        turn = self.node.getOrientation()
        return x, y, math.atan2(turn[3], turn[0])

    def to_goal(self, x, y, heading, value):
        off = math.atan2(self.goal[1] - y, self.goal[0] - x) - heading
        off = math.remainder(off, 2 * math.pi)
        if max(value[0], value[7], value[1], value[6]) > 90 and abs(off) < 1.2:
            self.state, self.hit = "wall", math.dist((x, y), self.goal[:2])
            return 0.0, 0.0
        forward = 4.0 if abs(off) < 0.3 else 0.0
        return forward, 2.5 * off

    def along(self, x, y, heading, value):
        """Keeps the obstacle on the right."""
        off = math.atan2(self.goal[1] - y, self.goal[0] - x) - heading
        off = math.remainder(off, 2 * math.pi)
        nearer = math.dist((x, y), self.goal[:2]) < self.hit - 0.03
        if nearer and value[2] < 75 and max(value[0], value[1]) < 80:
            self.state = "goal"
        if max(value[0], value[7], value[1]) > 90:
            return 0.0, 1.5
        if value[2] > 130:
            return 2.5, 0.5
        return (2.5, -0.2) if value[2] > 80 else (2.2, -0.9)

    def run(self):
        while self.robot.step(self.dt) != -1:
            value = [sensor.getValue() for sensor in self.ps]
            act = self.to_goal if self.state == "goal" else self.along
            forward, turn = act(*self.pose(), value)
            self.left.setVelocity(max(-MAX, min(MAX, forward - turn)))
            self.right.setVelocity(max(-MAX, min(MAX, forward + turn)))


if __name__ == "__main__":
    Bug().run()
