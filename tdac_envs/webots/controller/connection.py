"""The way to the simulation: what is sent with a step, and what comes back."""

from __future__ import annotations

import ctypes
from typing import Any, Protocol

from .messages import complain


class World(Protocol):
    """What carries requests to the simulation."""

    def reset(self) -> Any:
        """Facts on robot, devices and world."""

    def step(self, action: Any) -> Any:
        """The answer to one request."""


class Connection:
    """One simulation, seen from the controller.

    Attributes:
        facts: As the simulation gave them at the beginning.
        devices: Facts on each device, by name.
        time: Simulated, s.
        values: Last samples, by device; those of sensors that have none are missing.
        velocity: Of the robot: three of motion (m/s), three of rotation (rad/s).
        motors: Those that were made, by name.
        places: Translation and rotation in the world of nodes that move, by number.
    """

    def __init__(self) -> None:
        self.facts: dict[str, Any] = {}
        self.devices: dict[str, dict[str, Any]] = {}
        self.time = 0.0
        self.values: dict[str, Any] = {}
        self.velocity: list[float] = [0.0] * 6
        self.places: dict[int, tuple[list[float], list[float]]] = {}
        self.motors: dict[str, object] = {}
        self._world: World | None = None
        self._commands: list[tuple[str, str, Any]] = []

    def open(self, world: World) -> None:
        """Asks the simulation what there is."""
        self._world = world
        self.facts = world.reset()
        self.devices = {device["name"]: device for device in self.facts["devices"]}
        self.places.update(self.facts["places"])
        keys = ("type", "base", "def", "parent", "fields")
        nodes = self.facts["scene"]
        self.facts["scene"] = [dict(zip(keys, node, strict=True)) for node in nodes]

    def check(self) -> None:
        """Refuses to go on without a simulation.

        Raises:
            RuntimeError: There is none.
        """
        if self._world is None:
            raise RuntimeError(
                "no simulation: run this controller with `tdac webots run`"
            )

    def command(self, device: str, what: str, value: Any) -> None:
        """Notes what is to be sent with the next request."""
        self._commands.append((device, what, value))

    def step(self, duration: int) -> int:
        """Lets the simulation go on; 0, or -1 when it has ended."""
        return self._request(duration, None)

    def tell(self, call: str, node: int | None = None, field: str = "") -> bool:
        """Says what a supervisor does; whether the simulation goes on."""
        return self._request(0, (call, node, field)) == 0

    def _request(self, duration: int, event: Any) -> int:
        self.check()
        assert self._world is not None
        commands, self._commands = self._commands, []
        answer = self._world.step((duration, commands, event))
        self.time = answer["time"]
        self.values.update(answer["values"])
        self.velocity = answer["velocity"]
        self.places.update(answer["places"])
        for text in answer["warnings"]:
            complain(text)
        return -1 if answer["over"] else 0


connection = Connection()
"""There is one in a process, as in Webots."""


def connect(world: World) -> None:
    """Says where the simulation is, before the controller starts."""
    connection.open(world)


def c_int(value: Any) -> int:
    """A number that Webots' functions in C take for an int.

    Raises:
        ctypes.ArgumentError: It is none; 32.0 is not one either.
    """
    if not isinstance(value, int):
        raise ctypes.ArgumentError(
            f"argument 2: TypeError: expected an int, got {value!r}"
        )
    return int(value)


def c_double(value: Any) -> float:
    """A number that Webots' functions in C take for a double.

    Raises:
        TypeError: It is none.
    """
    return ctypes.c_double(value).value
