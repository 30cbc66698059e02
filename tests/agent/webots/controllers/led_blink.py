"""Blinks while it drives in a circle."""

from controller import LED, Robot

robot = Robot()
leds = [robot.getDevice(f"led{i}") for i in range(10)]
assert all(isinstance(led, LED) for led in leds)
left, right = robot.getDevice("left wheel motor"), robot.getDevice("right wheel motor")
left.setPosition(float("inf"))
right.setPosition(float("inf"))
left.setVelocity(1.0)
right.setVelocity(2.0)
count = 0
while robot.step(100) != -1:
    for i, led in enumerate(leds):
        led.set(1 if i == count % 8 else 0)
    count += 1
print("".join(str(led.get()) for led in leds), count)
