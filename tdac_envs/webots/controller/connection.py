"""The connection to the simulation: requests and answers."""

from __future__ import annotations

import ctypes
from typing import Any, Protocol

from . import libraries
from .messages import complain


class Simulation(Protocol):
    """Carries requests to the simulation."""

    def reset(self) -> Any:
        """Facts about robot, devices and world."""

    def step(self, action: Any) -> Any:
        """The answer to one request."""


class Connection:
    """The controller's connection to one simulation.

    Attributes:
        facts: Facts that the simulation sent at the start.
        devices: Facts about each device, by name.
        time: Simulated time, s.
        values: Last sample of each device, by name; devices without one are missing.
        velocity: Velocity of the robot: linear (m/s), then angular (rad/s).
        motors: Motors created so far, by name.
        places: World translation and rotation of moved nodes, by number.
    """

    def __init__(self) -> None:
        self.facts: dict[str, Any] = {}
        self.devices: dict[str, dict[str, Any]] = {}
        self.time = 0.0
        self.values: dict[str, Any] = {}
        self.velocity: list[float] = [0.0] * 6
        self.places: dict[int, tuple[list[float], list[float]]] = {}
        self.motors: dict[str, object] = {}
        self._world: Simulation | None = None
        self._commands: list[tuple[str, str, Any]] = []
        self._images: dict[str, bytes] = {}
        self._is_over = False

    def open(self, world: Simulation) -> None:
        """Starts the simulation and keeps its facts."""
        self._world = world
        self.facts = world.reset()
        self.devices = {device["name"]: device for device in self.facts["devices"]}
        self.places.update(self.facts["places"])
        keys = ("type", "base", "def", "parent", "fields")
        nodes = self.facts["scene"]
        self.facts["scene"] = [dict(zip(keys, node, strict=True)) for node in nodes]

    def check(self) -> None:
        """Checks that there is a simulation.

        Raises:
            RuntimeError: There is none.
        """
        if self._world is None:
            raise RuntimeError(
                "no simulation: run this controller with `tdac webots run`"
            )

    def command(self, device: str, what: str, value: Any) -> None:
        """Queues a device command for the next request."""
        self._commands.append((device, what, value))

    def step(self, duration: int) -> int:
        """Advances the simulation by `duration` ms; -1 if it has ended, else 0."""
        return self._request(duration, None)

    def tell(self, call: str, node: int | None = None, field: str = "") -> bool:
        """Reports a supervisor call; returns whether the simulation goes on."""
        return self._request(0, (call, node, field)) == 0

    def image(self, camera: str) -> bytes | None:
        """The image of a camera's last sample; None if the simulation has ended."""
        if not self._is_over:
            self.command(camera, "image", 0)
            self._request(0, None)
        return self._images.pop(camera, None)

    def _request(self, duration: int, event: Any) -> int:
        self.check()
        assert self._world is not None
        commands, self._commands = self._commands, []
        answer = self._world.step((duration, commands, event))
        self.time = answer["time"]
        self.values.update(answer["values"])
        self.velocity = answer["velocity"]
        self.places.update(answer["places"])
        self._images.update(answer["images"])
        self._is_over = answer["over"]
        for text in answer["warnings"]:
            complain(text)
        return -1 if answer["over"] else 0


connection = Connection()
"""The only connection of the process, as in Webots."""


def connect(world: Simulation) -> None:
    """Connects to the simulation; called before the controller starts."""
    libraries.prepare()
    connection.open(world)


def c_int(value: Any) -> int:
    """Returns a value that Webots' C functions accept as an int.

    Raises:
        ctypes.ArgumentError: The value is not an int; even 32.0 is not accepted.
    """
    if not isinstance(value, int):
        raise ctypes.ArgumentError(
            f"argument 2: TypeError: expected an int, got {value!r}"
        )
    return int(value)


def c_double(value: Any) -> float:
    """Returns a value that Webots' C functions accept as a double.

    Raises:
        TypeError: The value is not a number.
    """
    return ctypes.c_double(value).value
