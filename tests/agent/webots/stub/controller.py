"""Just enough of Webots' module for an exported adapter: exact motion, free floor."""

import json
import math
import sys

WHEEL, AXLE, STEP = 0.02, 0.057, 32


class _Motor:
    def __init__(self):
        self.position, self.velocity = 0.0, 0.0

    def setPosition(self, position):
        self.position = position

    def setVelocity(self, velocity):
        assert math.isinf(self.position)
        assert abs(velocity) <= 6.28
        self.velocity = velocity


class _Sensor:
    def __init__(self):
        self.period, self.value = 0, math.nan

    def enable(self, period):
        assert isinstance(period, int)
        self.period = period

    def getValue(self):
        assert self.period == STEP
        return self.value


class Supervisor:
    def __init__(self):
        with open("params.json") as file:
            params = json.load(file)
        self.x, self.y = params["start"]
        self.heading = params["heading"]
        self.devices = {f"{side} wheel motor": _Motor() for side in ("left", "right")}
        names = ["left wheel sensor", "right wheel sensor"]
        names += [f"ps{k}" for k in range(8)]
        self.devices.update({name: _Sensor() for name in names})
        self.turned = [0.0, 0.0]
        self.steps = 0

    def getBasicTimeStep(self):
        return float(STEP)

    def getDevice(self, name):
        return self.devices[name]

    def getSelf(self):
        return self

    def getPosition(self):
        return [self.x, self.y, 0.0]

    def getOrientation(self):
        c, s = math.cos(self.heading), math.sin(self.heading)
        return [c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0]

    def step(self, duration):
        assert duration == STEP
        ours = [
            name
            for name in sys.modules
            if name.split(".")[0] in ("tdac_envs", "tdac_agent", "gymnasium")
        ]
        assert not ours, ours
        left, right = (
            self.devices[f"{s} wheel motor"].velocity * STEP / 1e3
            for s in ("left", "right")
        )
        way, turn = (left + right) / 2 * WHEEL, (right - left) * WHEEL / AXLE
        chord = way * (math.sin(turn / 2) / (turn / 2) if turn else 1.0)
        self.x += chord * math.cos(self.heading + turn / 2)
        self.y += chord * math.sin(self.heading + turn / 2)
        self.heading += turn
        self.turned = [self.turned[0] + left, self.turned[1] + right]
        for k, side in enumerate(("left", "right")):
            self.devices[f"{side} wheel sensor"].value = self.turned[k]
        for k in range(8):
            self.devices[f"ps{k}"].value = 67.19
        self.steps += 1
        return 0 if self.steps < 2000 else -1
