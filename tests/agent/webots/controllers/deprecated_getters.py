"""The old way to get devices, and to import them one by one."""

from controller import GPS, DistanceSensor, Motor, Robot

robot = Robot()
timestep = int(robot.getBasicTimeStep())
left: Motor = robot.getMotor("left wheel motor")
right: Motor = robot.getMotor("right wheel motor")
gps: GPS = robot.getGPS("gps")
front: DistanceSensor = robot.getDistanceSensor("ps0")
imu = robot.getInertialUnit("inertial unit")
compass = robot.getCompass("compass")
encoder = robot.getPositionSensor("left wheel sensor")
light = robot.getLightSensor("ls0")
led = robot.getLED("led0")
gps.enable(timestep)
front.enable(timestep)
left.setPosition(float("inf"))
right.setPosition(float("inf"))
left.setVelocity(4.0)
right.setVelocity(4.0)
led.set(1)
while robot.step(timestep) != -1:
    x = gps.getValues()[0]
print("stopped at", round(x, 2))
