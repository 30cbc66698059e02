"""A class of one's own, made of Robot."""

import math

from controller import Robot


class MyRobot(Robot):
    def __init__(self, goal):
        super().__init__()
        self.timestep = int(self.getBasicTimeStep())
        self.goal = goal
        self.gps = self.getDevice("gps")
        self.imu = self.getDevice("inertial unit")
        self.gps.enable(self.timestep)
        self.imu.enable(self.timestep)
        self.left = self.getDevice("left wheel motor")
        self.right = self.getDevice("right wheel motor")
        for motor in (self.left, self.right):
            motor.setPosition(math.inf)
            motor.setVelocity(0.0)

    def drive(self, forward, turn):
        self.left.setVelocity(min(max(forward - turn, -6.28), 6.28))
        self.right.setVelocity(min(max(forward + turn, -6.28), 6.28))

    def run(self):
        while self.step(self.timestep) != -1:
            x, y, _ = self.gps.getValues()
            yaw = self.imu.getRollPitchYaw()[2]
            off = math.remainder(
                math.atan2(self.goal[1] - y, self.goal[0] - x) - yaw, 2 * math.pi
            )
            if abs(off) > 0.3:
                self.drive(0.0, math.copysign(2.0, off))
            else:
                self.drive(5.0, 3.0 * off)


MyRobot((0.4, 0.0)).run()
