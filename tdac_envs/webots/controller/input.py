"""Keyboard, mouse and joystick, at which nobody sits."""

from __future__ import annotations

from typing import Any

from .connection import c_int
from .messages import complain, once, unsupported


class Keyboard:
    """A keyboard on which no key is pressed."""

    END, HOME, LEFT, UP, RIGHT, DOWN = 312, 313, 314, 315, 316, 317
    PAGEUP, PAGEDOWN = 366, 367
    NUMPAD_HOME, NUMPAD_LEFT, NUMPAD_UP, NUMPAD_RIGHT = 375, 376, 377, 378
    NUMPAD_DOWN, NUMPAD_END = 379, 382
    SHIFT, CONTROL, ALT = 1 << 16, 1 << 17, 1 << 18

    def __init__(self, sampling_period: int = 0) -> None:
        self.sampling_period = c_int(sampling_period)

    def enable(self, sampling_period: int) -> None:
        """Says once that there is no keyboard."""
        once("tdac: there is no keyboard here; getKey() returns -1")
        self.sampling_period = c_int(sampling_period)

    def disable(self) -> None:
        """Switches it off."""
        self.sampling_period = 0

    def getSamplingPeriod(self) -> int:
        """As given to `enable`, ms."""
        return self.sampling_period

    def getKey(self) -> int:
        """-1: no key."""
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


class _Nobody:
    """A device that never says anything."""

    def enable(self, sampling_period: int) -> None:
        """Says once that there is none."""
        del sampling_period
        name = type(self).__name__.lower()
        once(f"tdac: there is no {name} here")

    def disable(self) -> None:
        """Switches it off."""

    getSamplingPeriod: Any = unsupported("getSamplingPeriod", 0)


class Mouse(_Nobody):
    """No mouse."""

    getState: Any = unsupported("Mouse.getState")


class Joystick(_Nobody):
    """No joystick."""

    isConnected: Any = unsupported("Joystick.isConnected", False)
    getPressedButton: Any = unsupported("Joystick.getPressedButton", -1)
