"""Driven by hand, if anybody was there; counts the different camera images."""

from controller import Keyboard, Robot

robot = Robot()
timestep = int(robot.getBasicTimeStep())
keyboard = robot.getKeyboard()
keyboard.enable(timestep)
camera = robot.getDevice("camera")
camera.enable(timestep)
motors = [robot.getDevice(f"{side} wheel motor") for side in ("left", "right")]
for motor in motors:
    motor.setPosition(float("inf"))
    motor.setVelocity(0.0)
pressed, images = set(), set()
while robot.step(timestep) != -1:
    key = keyboard.getKey()
    pressed.add(key)
    images.add(camera.getImage())
    speed = {Keyboard.UP: 5.0, Keyboard.DOWN: -5.0}.get(key, 0.0)
    for motor in motors:
        motor.setVelocity(speed)
print("keys", sorted(pressed), "images", len(images))
