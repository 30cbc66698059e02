"""Samples the sensors of a robot and computes their readings."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from tdac_envs.drive.env import Observation
from tdac_envs.epuck.observed import in_encoder_steps
from tdac_envs.webots.devices import GYRO_SCALE, WHEELS, Offset
from tdac_envs.webots.instruments import Readings
from tdac_envs.webots.log import Pose, turn_rate, velocity
from tdac_envs.webots.stage import ControllerWorld
from tdac_envs.webots.views import Views

GRAVITY = 9.81
Reader = Callable[[], Any]


class Sampler:
    """Samples each sensor of a robot at its own period.

    Args:
        stage: Stage with the world and the robot.
        readings: Readings of its instruments.
        views: What its cameras, lidars and range finders see.
    """

    def __init__(
        self, stage: ControllerWorld, readings: Readings, views: Views
    ) -> None:
        self._frame = stage.frame
        self._observation: Observation = {}
        self._poses: list[Pose] = []
        self._dt = stage.world.time_step / 1e3
        self._readers = self._make_readers(stage, readings)
        for viewer in stage.viewers:
            self._readers[viewer.name] = partial(views.expose, viewer.name)
        # Sampling period and time of the last sample, ms.
        self._sampling: dict[str, tuple[int, float]] = {}
        self._fresh: dict[str, Any] = {}

    def __contains__(self, sensor: str) -> bool:
        return sensor in self._readers

    def enable(self, sensor: str, period: int, now: float) -> None:
        """Samples a sensor every `period` ms from `now` (ms) on; 0 disables it."""
        if period:
            self._sampling[sensor] = (period, now)
        else:
            self._sampling.pop(sensor, None)

    def sample(self, now: float, observation: Observation, poses: list[Pose]) -> None:
        """Reads the sensors that are due.

        Args:
            now: Simulated time, ms.
            observation: Current observation of the environment.
            poses: Poses at all steps so far, start included.
        """
        self._observation, self._poses = observation, poses
        for name, (period, last) in self._sampling.items():
            if now - last >= period - 1e-6:
                self._sampling[name] = (period, now)
                self._fresh[name] = self._readers[name]()

    def take(self) -> dict[str, Any]:
        """Returns the latest sample of each sensor that is new since the last call."""
        fresh, self._fresh = self._fresh, {}
        return fresh

    def _make_readers(
        self, stage: ControllerWorld, readings: Readings
    ) -> dict[str, Reader]:
        readers: dict[str, Reader] = {}
        for k in range(8):
            readers[f"ps{k}"] = partial(self._observed, "ps", k)
        readers["accelerometer"] = self._acceleration
        readers["gyro"] = self._turning
        for device in stage.devices:
            if device.kind == "GPS":
                readers[device.name] = partial(self._position, device.offset)
            elif device.kind == "Compass":
                readers[device.name] = self._north
            elif device.kind == "InertialUnit":
                readers[device.name] = self._attitude
        for device in stage.devices:
            if device.kind == "PositionSensor":
                wheel = [motor for motor, _ in WHEELS].index(device.more["motor"])
                readers[device.name] = partial(self._encoder, wheel)
        for beam in stage.instruments.beams:
            readers[beam.name] = partial(self._here, readings.distance, beam.name)
        for cell in stage.instruments.cells:
            readers[cell.name] = partial(self._here, readings.light, cell.name)
        return readers

    def _observed(self, key: str, index: int) -> float:
        return float(self._observation[key][index])

    def _encoder(self, wheel: int) -> float:
        angles = self._observation["wheel_positions"].astype(np.float64)
        return float(in_encoder_steps(angles)[wheel])

    def _here(self, read: Callable[[str, Pose], float], name: str) -> float:
        return read(name, self._poses[-1])

    def _north(self) -> list[float]:
        return self._frame.north(self._poses[-1][2])

    def _attitude(self) -> list[float]:
        return self._frame.attitude(self._poses[-1][2])

    def _turning(self) -> list[float]:
        """Gyro reading: turn rates about the robot's axes, scaled by `GYRO_SCALE`."""
        rate = GYRO_SCALE * turn_rate(self._poses, self._dt)
        up = self._frame.vector(0.0, 0.0, rate)
        return self._in_robot_axes(up, 100000.0)

    def _acceleration(self) -> list[float]:
        """Proper acceleration in the robot's axes, m/s²; at rest `GRAVITY` upwards."""
        now = velocity(self._poses, self._dt)
        before = velocity(self._poses[-3:-1], self._dt)
        x, y = ((a - b) / self._dt for a, b in zip(now, before, strict=True))
        return self._in_robot_axes(self._frame.vector(x, y, GRAVITY), 100.0)

    def _in_robot_axes(self, vector: list[float], limit: float) -> list[float]:
        turn = self._frame.rotation(self._poses[-1][2])
        return [float(value) for value in np.clip(turn.T @ vector, -limit, limit)]

    def _position(self, offset: Offset) -> list[float]:
        x, y, heading = self._poses[-1]
        cos, sin = math.cos(heading), math.sin(heading)
        ahead, left, up = offset
        frame = self._frame
        return frame.vector(
            x + cos * ahead - sin * left,
            y + sin * ahead + cos * left,
            frame.height + up,
        )
