"""The judge's side of a Webots controller: takes the steps and keeps the record."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tdac_envs.epuck.env import EPuckEnv, Observation
from tdac_envs.webots.devices import DARK, ENCODER_STEP, WHEELS
from tdac_envs.webots.motors import MotorState
from tdac_envs.webots.stage import Stage

Outcome = Literal["reached", "out of time", "teleport", "quit"]
Pose = tuple[float, float, float]

LONGEST_STEP = 1_000_000_000
CHANGES = (
    "value", "setMF", "removeMF", "removeSF", "setVelocity", "resetPhysics", "remove",
    "loadState", "addForce", "addForceWithOffset", "addTorque", "setJointPosition",
    "simulationReset", "simulationResetPhysics", "worldReload", "worldLoad",
)  # fmt: skip
"""Calls of a supervisor that change the world."""
PATIENCE = 3
"""Requests that are answered after the end; a controller should leave at the first."""


class RequestError(Exception):
    """A request that the `controller` package never sends."""


class RunEnded(Exception):
    """The controller goes on although the simulation has ended."""


@dataclass(slots=True)
class Log:
    """What happened.

    Attributes:
        poses: x, y, heading; the start included.
        actions: Wheel speeds as fractions, shape (2,), float32.
        path_distances: Shortest way left to the goal, m.
        distances: Straight to the goal, m.
        collisions: Steps with a contact.
        first_contact: Step, x and y of the first.
        outcome: How the simulation ended; None while it goes on.
        teleport: What a supervisor did that it may not do.
    """

    poses: list[Pose] = field(default_factory=list)
    actions: list[NDArray[np.float32]] = field(default_factory=list)
    path_distances: list[float] = field(default_factory=list)
    distances: list[float] = field(default_factory=list)
    collisions: int = 0
    first_contact: tuple[int, float, float] | None = None
    outcome: Outcome | None = None
    teleport: str | None = None

    @property
    def steps(self) -> int:
        """Steps of the world so far."""
        return len(self.actions)

    def note(self, env: EPuckEnv, info: dict[str, Any]) -> None:
        """Writes a moment down."""
        x, y, heading = env.pose().tolist()
        self.poses.append((x, y, heading))
        self.path_distances.append(info["path_distance"])
        self.distances.append(info["distance_to_goal"])
        self.collisions = info["collisions"]
        if info["collision"] and self.first_contact is None:
            self.first_contact = (self.steps, x, y)


class StepServer:
    """Answers the `controller` package; see `controller.connection`.

    Args:
        env: The judge's environment, of this stage.
        stage: World and robot.
        folder: Where the controller finds itself and the world's file.
    """

    def __init__(self, env: EPuckEnv, stage: Stage, folder: str = "") -> None:
        self.log = Log()
        self._env, self._stage, self._folder = env, stage, folder
        self._basic = stage.world.time_step
        self._observation: Observation = {}
        limit = stage.world.robot.max_wheel_speed
        self._motors = {name: MotorState(limit) for name, _ in WHEELS}
        self._readers = self._make_readers()
        # Sampling period and time of the last sample, ms.
        self._sampling: dict[str, tuple[int, float]] = {}
        self._fresh: dict[str, Any] = {}
        self._warnings: list[str] = []
        self._warned: set[str] = set()
        self._late = 0

    @property
    def is_over(self) -> bool:
        """Whether the simulation has ended."""
        return self.log.outcome is not None

    def reset(self) -> dict[str, Any]:
        """Puts the robot on its start; the facts for the controller.

        Raises:
            RequestError: It has been there.
        """
        if self.log.poses:
            raise RequestError("the simulation has begun")
        self._observation, info = self._env.reset(seed=0)
        self.log.note(self._env, info)
        place = {"world_path": self._stage.name, "project_path": self._folder}
        return {**self._stage.facts(), **place}

    def step(self, action: Any) -> dict[str, Any]:
        """Answers one request: duration (ms), commands to devices, an event.

        Raises:
            RequestError: It is none.
            RunEnded: The controller does not leave.
        """
        duration, commands, event = _checked(action)
        if self.is_over:
            self._late += 1
            if self._late > PATIENCE:
                raise RunEnded
            return self._answer()
        for device, what, value in commands:
            self._command(device, what, value)
        if event is not None:
            self._note_event(*event)
        self._advance(duration)
        return self._answer()

    def _advance(self, duration: int) -> None:
        """Takes as many steps as `duration` needs: the last one may go beyond it."""
        count = math.ceil(duration / self._basic - 1e-9)
        if duration % self._basic:
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
            for motor, angle in zip(self._motors.values(), angles, strict=True)
        ]
        wheels = np.array(speeds, np.float32) / np.float32(limit)
        self._observation, _, _, truncated, info = self._env.step(wheels)
        self.log.actions.append(wheels)
        self.log.note(self._env, info)
        if info["is_success"] and self._stage.has_goal:
            self.log.outcome = "reached"
        elif truncated or self.log.steps >= self._env.task.horizon:
            self.log.outcome = "out of time"
        self._sample()

    def _sample(self) -> None:
        now = self._now()
        for name, (period, last) in self._sampling.items():
            if now - last >= period - 1e-6:
                self._sampling[name] = (period, now)
                self._fresh[name] = self._readers[name]()

    def _now(self) -> float:
        """Simulated, ms."""
        return self.log.steps * self._basic

    def _answer(self) -> dict[str, Any]:
        fresh, self._fresh = self._fresh, {}
        warnings, self._warnings = self._warnings, []
        return {
            "over": self.is_over,
            "time": self._now() / 1e3,
            "values": fresh,
            "velocity": self._velocity() if self._tells_truth else [0.0] * 6,
            "places": self._places() if self._stage.is_supervisor else {},
            "warnings": warnings,
        }

    @property
    def _tells_truth(self) -> bool:
        """Whether the controller may know the robot's velocity."""
        sees = any(device.kind == "GPS" for device in self._stage.devices)
        return self._stage.is_supervisor or sees

    def _command(self, device: str, what: str, value: Any) -> None:
        if what == "enable" and device in self._readers:
            self._enable(device, value)
            return
        if device not in self._motors:
            raise RequestError(f"no device {device:.40} for {what:.40}")
        motor = self._motors[device]
        if what == "pid":
            motor.pid = (_real(value[0]), _real(value[1]), _real(value[2]))
        elif what == "position":
            motor.set_position(_real(value, infinite=True))
        elif what == "acceleration":
            motor.acceleration = _real(value, infinite=True)
        elif what == "velocity":
            warning = motor.set_velocity(_real(value, infinite=True))
            if warning is not None:
                self._warn(f'WARNING: "{device}": {warning}')
        else:
            raise RequestError(f"no command {what:.40}")

    def _enable(self, device: str, period: Any) -> None:
        if type(period) is not int or period < 0:
            raise RequestError("a sampling period that is none")
        if device.startswith("ls"):
            self._warn(
                f"tdac: light is not modelled here; ls0 to ls7 read {DARK:g}, as in "
                "the dark"
            )
        if period:
            self._sampling[device] = (period, self._now())
        else:
            self._sampling.pop(device, None)

    def _note_event(self, call: str, node: int | None, field_name: str) -> None:
        """Judges what a supervisor does; most of it ends the run."""
        if call == "simulationQuit":
            self.log.outcome = "quit"
            return
        if call not in CHANGES:
            raise RequestError("no such call")
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
        """Of the robot, from its last step, in the file's coordinates."""
        if self.log.steps == 0:
            return [0.0] * 6
        dt = self._env.task.dt
        (x, y, h), (u, v, g) = self.log.poses[-1], self.log.poses[-2]
        turn = math.remainder(h - g, 2.0 * math.pi) / dt
        frame = self._stage.frame
        motion = frame.vector((x - u) / dt, (y - v) / dt)
        return [*motion, *frame.vector(0.0, 0.0, turn)]

    def _places(self) -> dict[int, tuple[list[float], list[float]]]:
        """Where the nodes are that move; empty before the first step."""
        if self.log.steps == 0:
            return {}
        x, y, heading = self.log.poses[-1]
        frame = self._stage.frame
        number = self._stage.scene.number(self._stage.robot)
        return {number: (frame.point(x, y), frame.axis_angle(heading))}

    def _make_readers(self) -> dict[str, Callable[[], Any]]:
        """How each sensor gets its value."""
        readers: dict[str, Callable[[], Any]] = {}
        for k in range(8):
            readers[f"ps{k}"] = partial(self._observed, "ps", k)
            readers[f"ls{k}"] = partial(float, DARK)
        for k, (_, sensor) in enumerate(WHEELS):
            readers[sensor] = partial(self._encoder, k)
        for device in self._stage.devices:
            if device.kind == "GPS":
                readers[device.name] = partial(self._position, device.offset)
            elif device.kind == "Compass":
                readers[device.name] = self._north
            elif device.kind == "InertialUnit":
                readers[device.name] = self._attitude
            elif device.name.startswith("gs"):
                readers[device.name] = partial(
                    self._observed, "ground", int(device.name[2])
                )
        return readers

    def _observed(self, key: str, index: int) -> float:
        return float(self._observation[key][index])

    def _north(self) -> list[float]:
        return self._stage.frame.north(self.log.poses[-1][2])

    def _attitude(self) -> list[float]:
        return self._stage.frame.attitude(self.log.poses[-1][2])

    def _encoder(self, wheel: int) -> float:
        angle = float(self._observation["wheel_positions"][wheel])
        return ENCODER_STEP * round(angle / ENCODER_STEP)

    def _position(self, offset: tuple[float, float, float]) -> list[float]:
        x, y, heading = self.log.poses[-1]
        frame = self._stage.frame
        at = np.add(frame.point(x, y), frame.rotation(heading) @ offset)
        return [float(value) for value in at]


def way_of(log: Log) -> float:
    """Length of what the robot drove, m."""
    places = np.array(log.poses)[:, :2]
    return float(np.hypot(*np.diff(places, axis=0).T).sum())


def _checked(request: Any) -> tuple[int, list[Any], Any]:
    """A request whose form is right; its values are checked where they are used.

    Raises:
        RequestError: It is not.
    """
    match request:
        case (int() as duration, list() as commands, None) if _may_last(duration):
            event = None
        case (int() as duration, list() as commands, event) if _may_last(duration):
            match event:
                case (str(), int() | None, str()):
                    pass
                case _:
                    raise RequestError("an event of another form")
        case _:
            raise RequestError("a request of another form")
    for command in commands:
        match command:
            case (str(), str(), int() | float()) | (str(), "pid", [_, _, _]):
                pass
            case _:
                raise RequestError("a command of another form")
    return duration, commands, event


def _may_last(duration: int) -> bool:
    return type(duration) is int and 0 <= duration <= LONGEST_STEP


def _real(value: Any, *, infinite: bool = False) -> float:
    """A number.

    Raises:
        RequestError: It is none, or not finite where it has to be.
    """
    if type(value) not in (int, float) or math.isnan(value):
        raise RequestError("expected a number")
    if not infinite and math.isinf(value):
        raise RequestError("expected a finite number")
    return float(value)
