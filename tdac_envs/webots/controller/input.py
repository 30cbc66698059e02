"""Keyboard, mouse and joystick, which never give any input."""

from __future__ import annotations

from typing import Any

from .connection import c_int
from .messages import complain, once, unsupported


class Keyboard:
    """A keyboard on which no key is ever pressed."""

    END, HOME, LEFT, UP, RIGHT, DOWN = 312, 313, 314, 315, 316, 317
    PAGEUP, PAGEDOWN = 366, 367
    NUMPAD_HOME, NUMPAD_LEFT, NUMPAD_UP, NUMPAD_RIGHT = 375, 376, 377, 378
    NUMPAD_DOWN, NUMPAD_END = 379, 382
    SHIFT, CONTROL, ALT = 1 << 16, 1 << 17, 1 << 18

    def __init__(self, sampling_period: int = 0) -> None:
        self.sampling_period = c_int(sampling_period)

    def enable(self, sampling_period: int) -> None:
        """Prints once that there is no keyboard."""
        once("tdac: there is no keyboard; getKey() returns -1")
        self.sampling_period = c_int(sampling_period)

    def disable(self) -> None:
        """Disables the device."""
        self.sampling_period = 0

    def getSamplingPeriod(self) -> int:
        """Sampling period given to `enable`, ms."""
        return self.sampling_period

    def getKey(self) -> int:
        """Always -1: no key."""
        if self.sampling_period <= 0:
            complain(
                "Error: wb_keyboard_get_key() called for a disabled device! "
                "Please use: wb_keyboard_enable()."
            )
        return -1

    @property
    def key(self) -> int:
        """See `getKey`."""
        return self.getKey()


class _NoInput:
    """An input device that does not exist."""

    def enable(self, sampling_period: int) -> None:
        """Prints once that there is no such device."""
        del sampling_period
        name = type(self).__name__.lower()
        once(f"tdac: there is no {name}")

    def disable(self) -> None:
        """Disables the device."""

    getSamplingPeriod: Any = unsupported("getSamplingPeriod", 0)


class Mouse(_NoInput):
    """A mouse that does not exist."""

    getState: Any = unsupported("Mouse.getState")


class Joystick(_NoInput):
    """A joystick that does not exist."""

    isConnected: Any = unsupported("Joystick.isConnected", False)
    getPressedButton: Any = unsupported("Joystick.getPressedButton", -1)
