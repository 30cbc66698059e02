"""Keyboard, mouse and joystick, which never give any input."""

from __future__ import annotations

from .calls import getters, lacking
from .connection import c_int
from .messages import complain, once


@getters("sampling_period", "key")
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

    @property
    def key(self) -> int:
        """Always -1: no key."""
        if self.sampling_period <= 0:
            complain(
                "Error: wb_keyboard_get_key() called for a disabled device! "
                "Please use: wb_keyboard_enable()."
            )
        return -1


class _NoInput:
    """An input device that does not exist."""

    def enable(self, sampling_period: int) -> None:
        """Prints once that there is no such device."""
        del sampling_period
        name = type(self).__name__.lower()
        once(f"tdac: there is no {name}")

    def disable(self) -> None:
        """Disables the device."""


@lacking(getSamplingPeriod=0, getState=None)
class Mouse(_NoInput):
    """A mouse that does not exist."""


@lacking(getSamplingPeriod=0, isConnected=False, getPressedButton=-1)
class Joystick(_NoInput):
    """A joystick that does not exist."""
