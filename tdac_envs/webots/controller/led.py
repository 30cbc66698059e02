"""Lights."""

from __future__ import annotations

from .connection import c_int
from .device import Device


class LED(Device):
    """A light; nobody sees it here."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._value = 0

    def set(self, value: int) -> None:
        """Switches it: 0 is off."""
        self._value = c_int(value)

    def get(self) -> int:
        """What was set last."""
        return self._value

    @property
    def value(self) -> int:
        """See `get` and `set`."""
        return self._value

    @value.setter
    def value(self, value: int) -> None:
        self.set(value)
