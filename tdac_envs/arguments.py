"""Numbers that a user gives: taken as they are meant, or refused in one line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Integral
from typing import Any

import numpy as np

from tdac_envs.errors import TaskError


def finite_numbers(name: str, values: Sequence[float], count: int) -> tuple[float, ...]:
    """The values as floats.

    Raises:
        TaskError: There are not `count` of them, or one is not a finite number.
    """
    try:
        numbers = tuple(float(value) for value in values)
    except (TypeError, ValueError, OverflowError):
        numbers = ()
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise TaskError(f"expected {name} to be {count} finite numbers, got {values!r}")
    return numbers


def finite_point(name: str, values: Sequence[float]) -> tuple[float, float]:
    """The values as a point (x, y); raises as `finite_numbers` does."""
    x, y = finite_numbers(name, values, 2)
    return x, y


def finite(name: str, value: float) -> float:
    """The value as a float.

    Raises:
        TaskError: It is not a finite number.
    """
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise TaskError(f"expected {name} to be a finite number, got {value!r}")
    return number


def positive(name: str, value: float) -> float:
    """The value as a float.

    Raises:
        TaskError: It is not a finite number above 0.
    """
    number = finite(name, value)
    if number <= 0.0:
        raise TaskError(f"expected {name} above 0, got {value!r}")
    return number


def not_negative(name: str, value: float) -> float:
    """The value as a float.

    Raises:
        TaskError: It is not a finite number of at least 0.
    """
    number = finite(name, value)
    if number < 0.0:
        raise TaskError(f"expected {name} of at least 0, got {value!r}")
    return number


def one_of(name: str, value: object, allowed: tuple[object, ...]) -> None:
    """Accepts one of the allowed values.

    Raises:
        TaskError: It is another one.
    """
    if value not in allowed:
        choices = ", ".join(map(repr, allowed))
        raise TaskError(f"expected {name} to be one of {choices}, got {value!r}")


def whole_number(name: str, value: float, least: int) -> int:
    """The value as an int.

    Raises:
        TaskError: It is not a whole number, or below `least`.
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or value < least:
        raise TaskError(
            f"expected {name} to be a whole number from {least}, got {value!r}"
        )
    return int(value)


def check_reset_options(options: dict[str, Any]) -> None:
    """Refuses options of `reset` that are neither a start nor a goal.

    Raises:
        TaskError: There is another one.
    """
    unknown = sorted(map(str, options.keys() - {"start", "goal"}))
    if unknown:
        raise TaskError(f"unknown reset options {unknown}; expected 'start' and 'goal'")


def wheel_speeds(action: Any) -> tuple[float, float]:
    """The wheel speeds of an action, which may be out of [-1, 1].

    Raises:
        ValueError: The action is not two finite numbers.
    """
    try:
        array = action if type(action) is np.ndarray else np.asarray(action)
        left, right = array.tolist()
        # NaN and infinity times 0 are not 0.
        if 0.0 * left + 0.0 * right == 0.0:
            return float(left), float(right)
    except (TypeError, ValueError):
        pass
    raise ValueError(_not_an_action(action)) from None


def _not_an_action(action: Any) -> str:
    return f"expected an action of two finite numbers in [-1, 1], got {action!r}"
