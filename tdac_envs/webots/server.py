"""The server of a Webots run: steps the environment and records the run."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tdac_envs.drive.env import Observation
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.webots.devices import WHEELS
from tdac_envs.webots.instruments import Readings
from tdac_envs.webots.log import Log, turn_rate, velocity
from tdac_envs.webots.motors import MotorState
from tdac_envs.webots.requests import CHANGES, RequestError, checked, real
from tdac_envs.webots.sampling import Sampler
from tdac_envs.webots.stage import ControllerWorld
from tdac_envs.webots.views import Views

PATIENCE = 3
"""Requests answered after the end; a controller should stop after the first."""


class RunEnded(Exception):
    """The controller keeps sending requests after the simulation has ended."""


class StepServer:
    """Answers requests of the `controller` package; see `controller.connection`.

    Args:
        env: Environment of the stage, from `ControllerWorld.make_env`.
        stage: Stage with the world and the robot.
        folder: Project path reported to the controller.
    """

    def __init__(self, env: EPuckEnv, stage: ControllerWorld, folder: str = "") -> None:
        self.log = Log()
        self._env, self._stage, self._folder = env, stage, folder
        self._basic = stage.world.time_step
        self._observation: Observation = {}
        limit = stage.world.robot.max_wheel_speed
        self._wheels = [MotorState(limit) for _ in WHEELS]
        sensors = [sensor for _, sensor in WHEELS]
        self._motors = {
            device.name: self._wheels[sensors.index(device.more["sensor"])]
            for device in stage.devices
            if device.kind == "Motor"
        }
        self._views = Views(stage.viewers, stage.world, stage.sky, stage.robot, env)
        self._images: dict[str, bytes] = {}
        readings = Readings(stage.instruments, env)
        self._sampler = Sampler(stage, readings, self._views)
        self._warnings: list[str] = []
        self._warned: set[str] = set()
        self._late_requests = 0

    @property
    def is_over(self) -> bool:
        """Whether the simulation has ended."""
        return self.log.outcome is not None

    def reset(self) -> dict[str, Any]:
        """Puts the robot at its start; returns the facts for the controller.

        Raises:
            RequestError: The simulation has already begun.
        """
        if self.log.poses:
            raise RequestError("the simulation has already begun")
        self._observation, info = self._env.reset(seed=0)
        self.log.note(self._env, info)
        place = {"world_path": self._stage.name, "project_path": self._folder}
        return {**self._stage.facts(), **place, "places": self._places()}

    def step(self, action: Any) -> dict[str, Any]:
        """Answers one request: duration (ms), device commands and an event.

        Raises:
            RequestError: The request is invalid.
            RunEnded: The controller does not stop after the end.
        """
        duration, commands, event = checked(action)
        if self.is_over:
            self._late_requests += 1
            if self._late_requests > PATIENCE:
                raise RunEnded
            return self._answer()
        for device, what, value in commands:
            self._command(device, what, value)
        if event is not None:
            self._handle_event(*event)
        self._advance(duration)
        return self._answer()

    def _advance(self, duration: int) -> None:
        """Runs steps for `duration` ms, rounded up to whole steps."""
        count = math.ceil(duration / self._basic - 1e-9)
        if abs(count * self._basic - duration) > 1e-6:
            self._warn(
                f"WARNING: The time step used by controller ({duration} ms) is not a "
                f"multiple of WorldInfo.basicTimeStep ({self._basic:g} ms)!"
            )
        for _ in range(count):
            if self.is_over:
                return
            self._one_step()

    def _one_step(self) -> None:
        dt, limit = self._env.task.dt, self._env.task.max_wheel_speed
        angles = self._observation["wheel_positions"].tolist()
        speeds = [
            motor.next_speed(angle, dt)
            for motor, angle in zip(self._wheels, angles, strict=True)
        ]
        wheels = np.array(speeds, np.float32) / np.float32(limit)
        self._observation, _, _, truncated, info = self._env.step(wheels)
        self.log.actions.append(wheels)
        self.log.note(self._env, info)
        if info["is_success"] and self._stage.has_goal:
            self.log.outcome = "reached"
        elif truncated or self.log.steps >= self._env.task.horizon:
            self.log.outcome = "out of time"
        self._sampler.sample(self._now(), self._observation, self.log.poses)

    def _now(self) -> float:
        """Simulated time, ms."""
        return self.log.steps * self._basic

    def _answer(self) -> dict[str, Any]:
        warnings, self._warnings = self._warnings, []
        images, self._images = self._images, {}
        return {
            "over": self.is_over,
            "time": self._now() / 1e3,
            "values": self._sampler.take(),
            "velocity": self._velocity() if self._reveals_velocity else [0.0] * 6,
            "places": self._places(),
            "warnings": warnings,
            "images": images,
        }

    @property
    def _reveals_velocity(self) -> bool:
        """Whether the controller may know the robot's velocity."""
        sees = any(device.kind == "GPS" for device in self._stage.devices)
        return self._stage.is_supervisor or sees

    def _command(self, device: str, what: str, value: Any) -> None:
        if what == "enable" and device in self._sampler:
            self._enable(device, value)
            return
        if what == "image" and device in self._views:
            image = self._views.image(device)
            self._images |= {} if image is None else {device: image}
            return
        if device not in self._motors:
            raise RequestError(f"no device {device:.40} that accepts {what:.40}")
        motor = self._motors[device]
        if what == "pid":
            motor.pid = (real(value[0]), real(value[1]), real(value[2]))
        elif what == "position":
            motor.set_position(real(value, infinite=True))
        elif what == "acceleration":
            motor.acceleration = real(value, infinite=True)
        elif what == "velocity":
            warning = motor.set_velocity(real(value, infinite=True))
            if warning is not None:
                self._warn(f'WARNING: "{device}": {warning}')
        else:
            raise RequestError(f"unknown command {what:.40}")

    def _enable(self, device: str, period: Any) -> None:
        if type(period) is not int or period < 0:
            raise RequestError("invalid sampling period")
        self._sampler.enable(device, period, self._now())

    def _handle_event(self, call: str, node: int | None, field_name: str) -> None:
        """Handles a supervisor call; most calls end the run."""
        if call == "simulationQuit":
            self.log.outcome = "quit"
            return
        if call not in CHANGES:
            raise RequestError("unknown supervisor call")
        what = f"{call}()"
        if node is not None:
            scene = self._stage.scene
            if not scene.has(node, field_name):
                raise RequestError("no such node or field")
            if field_name and scene.may_write(node, field_name):
                return
            target = scene.describe(node)
            if field_name:
                target = f"the {field_name} of {target}"
                what = "a write" if call == "value" else what
            what = f"{what} on {target}"
        self.log.outcome = "teleport"
        self.log.teleport = f"{what} at step {self.log.steps}"

    def _warn(self, text: str) -> None:
        if text not in self._warned:
            self._warned.add(text)
            self._warnings.append(text)

    def _velocity(self) -> list[float]:
        """Linear (m/s) and angular (rad/s) velocity, in the file's coordinates."""
        dt, frame, poses = self._env.task.dt, self._stage.frame, self.log.poses
        motion = frame.vector(*velocity(poses, dt))
        return [*motion, *frame.vector(0.0, 0.0, turn_rate(poses, dt))]

    def _places(self) -> dict[int, tuple[list[float], list[float]]]:
        """Poses of moved nodes for a supervisor; empty while all are as in the file."""
        stage, at_start = self._stage, self.log.steps == 0
        if not stage.is_supervisor or (at_start and not stage.is_moved):
            return {}
        x, y, heading = self.log.poses[-1]
        frame, scene = self._stage.frame, self._stage.scene
        number = scene.number(self._stage.robot)
        places = {number: (frame.point(x, y), frame.axis_angle(heading))}
        if self._stage.movables:
            things = self._env.things().tolist()
            for thing, at in zip(self._stage.movables, things, strict=True):
                place = None if thing is None else thing.place(*at)
                if thing is not None and place is not None:
                    places[scene.number(thing.node)] = place
        return places
