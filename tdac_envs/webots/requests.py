"""Validates requests from the `controller` package, which are untrusted."""

from __future__ import annotations

import math
from typing import Any

LONGEST_STEP = 1_000_000_000
"""Maximum duration of one request, ms."""
CHANGES = (
    "value", "setMF", "removeMF", "removeSF", "setVelocity", "resetPhysics", "remove",
    "loadState", "addForce", "addForceWithOffset", "addTorque", "setJointPosition",
    "simulationReset", "simulationResetPhysics", "worldReload", "worldLoad",
)  # fmt: skip
"""Supervisor calls that change the world."""


class RequestError(Exception):
    """A request that the `controller` package never sends."""


def checked(request: Any) -> tuple[int, list[Any], Any]:
    """Returns a well-formed request; its values are checked where they are used.

    Raises:
        RequestError: The request is malformed.
    """
    match request:
        case (int(duration), list(commands), event) if _is_duration(duration):
            pass
        case _:
            raise RequestError("malformed request")
    match event:
        case None | (str(), int() | None, str()):
            pass
        case _:
            raise RequestError("malformed event")
    for command in commands:
        match command:
            case (str(), str(), int() | float()) | (str(), "pid", [_, _, _]):
                pass
            case _:
                raise RequestError("malformed command")
    return duration, commands, event


def _is_duration(duration: int) -> bool:
    return type(duration) is int and 0 <= duration <= LONGEST_STEP


def real(value: Any, *, infinite: bool = False) -> float:
    """Returns a number as a float.

    Raises:
        RequestError: The value is not a number, or infinite and `infinite` is false.
    """
    if type(value) not in (int, float) or math.isnan(value):
        raise RequestError("expected a number")
    if not infinite and math.isinf(value):
        raise RequestError("expected a finite number")
    return float(value)
