"""Base class of all devices."""

from __future__ import annotations

from typing import Any

from .connection import connection
from .messages import complain


class Device:
    """A device of the robot.

    Args:
        name: Device name in the world.
    """

    def __init__(self, name: str) -> None:
        connection.check()
        self.name = name
        self._facts: dict[str, Any] = connection.devices.get(name, {})
        if not self._facts:
            robot = connection.facts["name"]
            complain(f'Device "{name}" was not found on robot "{robot}"')

    def getName(self) -> str:
        """Name of the device."""
        return self.name

    def getModel(self) -> str:
        """Model; empty for all devices of an e-puck."""
        return self.model

    def getNodeType(self) -> int:
        """Node type, one of `Node`'s constants."""
        return self.node_type

    @property
    def model(self) -> str:
        """See `getModel`."""
        return ""

    @property
    def node_type(self) -> int:
        """See `getNodeType`."""
        return int(self._facts.get("node_type", 0))
