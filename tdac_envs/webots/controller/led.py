"""LEDs."""

from __future__ import annotations

from .calls import getters
from .connection import c_int
from .device import Device


@getters(get="value")
class LED(Device):
    """An LED; its value has no effect."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._value = 0

    def set(self, value: int) -> None:
        """Sets the value; 0 is off."""
        self._value = c_int(value)

    @property
    def value(self) -> int:
        """The value that was set last."""
        return self._value

    @value.setter
    def value(self, value: int) -> None:
        self.set(value)
