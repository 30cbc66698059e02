"""Checks of numeric arguments, with one-line errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Integral
from typing import Any

from tdac_envs.core.errors import TaskError

LARGEST = 1e9
"""Largest magnitude of an argument; it keeps all computed values finite."""
SMALLEST = 1e-9
"""Smallest value of an argument that must be above 0."""
MOST_STEPS = 10_000_000
"""Longest horizon, steps: the longest path on the largest map, driven at low speed."""


def finite_numbers(name: str, values: Sequence[float], count: int) -> tuple[float, ...]:
    """The values as floats.

    Raises:
        TaskError: Their number is not `count`, or one is not a finite number within
            +-`LARGEST`.
    """
    try:
        numbers = tuple(float(value) for value in values)
    except (TypeError, ValueError, OverflowError):
        numbers = ()
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise TaskError(f"expected {name} to be {count} finite numbers, got {values!r}")
    for number in numbers:
        _bounded(name, number)
    return numbers


def finite_point(name: str, values: Sequence[float]) -> tuple[float, float]:
    """The values as a point (x, y); raises like `finite_numbers`."""
    x, y = finite_numbers(name, values, 2)
    return x, y


def finite(name: str, value: float) -> float:
    """The value as a float.

    Raises:
        TaskError: It is not a finite number within +-`LARGEST`.
    """
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise TaskError(f"expected {name} to be a finite number, got {value!r}")
    _bounded(name, number)
    return number


def _bounded(name: str, number: float) -> None:
    if abs(number) > LARGEST:
        raise TaskError(f"expected {name} within +-{LARGEST:g}, got {number:g}")


def positive(name: str, value: float) -> float:
    """The value as a float.

    Raises:
        TaskError: It is not a number from `SMALLEST` to `LARGEST`.
    """
    number = finite(name, value)
    if number <= 0.0:
        raise TaskError(f"expected {name} above 0, got {value!r}")
    if number < SMALLEST:
        raise TaskError(f"expected {name} of at least {SMALLEST:g}, got {value!r}")
    return number


def in_radians(angle: float) -> float:
    """The angle, for the models of files.

    Raises:
        ValueError: It is more than a whole turn, so it may well be in degrees.
    """
    if abs(angle) > math.tau:
        raise ValueError(f"expected rad, from -2 pi to 2 pi, got {angle:g}")
    return angle


def non_negative(name: str, value: float) -> float:
    """The value as a float.

    Raises:
        TaskError: It is not a number from 0 to `LARGEST`.
    """
    number = finite(name, value)
    if number < 0.0:
        raise TaskError(f"expected {name} of at least 0, got {value!r}")
    return number


def number_up_to(name: str, value: float, most: float) -> float:
    """The value as a float.

    Raises:
        TaskError: It is not a number from 0 to `most`.
    """
    number = finite(name, value)
    if not 0.0 <= number <= most:
        raise TaskError(f"expected {name} from 0 to {most:g}, got {value!r}")
    return number


def one_of(name: str, value: object, allowed: tuple[object, ...]) -> None:
    """Checks that the value is one of the allowed values.

    Raises:
        TaskError: It is not.
    """
    if value not in allowed:
        choices = ", ".join(map(repr, allowed))
        raise TaskError(f"expected {name} to be one of {choices}, got {value!r}")


def whole_number(name: str, value: float, least: int, most: int | None = None) -> int:
    """The value as an int.

    Raises:
        TaskError: It is not a whole number, below `least`, or above `most`.
    """
    if (
        isinstance(value, bool)
        or not isinstance(value, Integral)
        or value < least
        or (most is not None and value > most)
    ):
        limits = f"from {least}" if most is None else f"from {least} to {most}"
        raise TaskError(f"expected {name} to be a whole number {limits}, got {value!r}")
    return int(value)


def horizon_steps(horizon: float) -> int:
    """The horizon as an int.

    Raises:
        TaskError: It is not a whole number from 1 to `MOST_STEPS`.
    """
    steps = whole_number("horizon", horizon, 1)
    if steps > MOST_STEPS:
        raise TaskError(
            f"expected a horizon of at most {MOST_STEPS} steps, got {steps}: "
            "use faster wheels or a longer time step"
        )
    return steps


def check_reset_options(options: dict[str, Any]) -> None:
    """Checks the options of `reset`.

    Raises:
        TaskError: There is an option other than `start` and `goal`.
    """
    unknown = sorted(map(str, options.keys() - {"start", "goal"}))
    if unknown:
        raise TaskError(f"unknown reset options {unknown}; expected 'start' and 'goal'")
