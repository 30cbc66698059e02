import math

from controller import *

timestep = 64
robot = Robot()
imu = robot.getDevice("inertial unit")
imu.enable(timestep)
gps = robot.getDevice("gps")
gps.enable(timestep)
l = robot.getDevice("left wheel motor")
r = robot.getDevice("right wheel motor")
l.setPosition(float("+inf"))
r.setPosition(float("+inf"))
l.setVelocity(0)
r.setVelocity(0)
while robot.step(timestep) != -1:
    p = gps.getValues()
    a = math.atan2(0 - p[1], 0.4 - p[0]) - imu.getRollPitchYaw()[2]
    while a > math.pi:
        a -= 2 * math.pi
    while a < -math.pi:
        a += 2 * math.pi
    l.setVelocity(3 - 2 * a)
    r.setVelocity(3 + 2 * a)
