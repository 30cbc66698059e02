"""What the `controller` package may send; nothing else is believed."""

from __future__ import annotations

import math
from typing import Any

LONGEST_STEP = 1_000_000_000
"""Of one request, ms."""
CHANGES = (
    "value", "setMF", "removeMF", "removeSF", "setVelocity", "resetPhysics", "remove",
    "loadState", "addForce", "addForceWithOffset", "addTorque", "setJointPosition",
    "simulationReset", "simulationResetPhysics", "worldReload", "worldLoad",
)  # fmt: skip
"""Calls of a supervisor that change the world."""


class RequestError(Exception):
    """A request that the `controller` package never sends."""


def checked(request: Any) -> tuple[int, list[Any], Any]:
    """A request whose form is right; its values are checked where they are used.

    Raises:
        RequestError: It is not.
    """
    match request:
        case (int(duration), list(commands), event) if _may_last(duration):
            pass
        case _:
            raise RequestError("a request of another form")
    match event:
        case None | (str(), int() | None, str()):
            pass
        case _:
            raise RequestError("an event of another form")
    for command in commands:
        match command:
            case (str(), str(), int() | float()) | (str(), "pid", [_, _, _]):
                pass
            case _:
                raise RequestError("a command of another form")
    return duration, commands, event


def _may_last(duration: int) -> bool:
    return type(duration) is int and 0 <= duration <= LONGEST_STEP


def real(value: Any, *, infinite: bool = False) -> float:
    """A number.

    Raises:
        RequestError: It is none, or not finite where it has to be.
    """
    if type(value) not in (int, float) or math.isnan(value):
        raise RequestError("expected a number")
    if not infinite and math.isinf(value):
        raise RequestError("expected a finite number")
    return float(value)
