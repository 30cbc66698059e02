"""Base class of all devices."""

from __future__ import annotations

from typing import Any

from .calls import getters
from .connection import connection
from .messages import complain


@getters("name", "model", "node_type")
class Device:
    """A device of the robot.

    Args:
        name: Device name in the world.
    """

    model = ""
    """Model; empty for all devices of an e-puck."""

    def __init__(self, name: str) -> None:
        connection.check()
        self.name = name
        self._facts: dict[str, Any] = connection.devices.get(name, {})
        if not self._facts:
            robot = connection.facts["name"]
            complain(f'Device "{name}" was not found on robot "{robot}"')

    @property
    def node_type(self) -> int:
        """Node type, one of `Node`'s constants."""
        return int(self._facts.get("node_type", 0))
