"""What of the templates can be tuned, and the way out of a controller again."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, Protocol, TypeVar


class Tuned(Protocol):
    """Values of the tuning constants of a template; the defaults are neutral.

    The constants in the file have the same names, in capitals.
    """

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def inflation_margin(self) -> float:
        """Room wanted beside the body."""


P = TypeVar("P", bound=Tuned)


def _tunable(
    neutral: float,
    low: float,
    high: float,
    unit: str,
    meaning: str,
    *,
    step: float = 0.0,
) -> float:
    """A field with its bounds, as metadata, for the templates and the repair table.

    Args:
        neutral: First value.
        low: Least value.
        high: Greatest value.
        unit: Empty for a plain number.
        meaning: For the template's comment.
        step: In which the repair searches for a better value.
    """
    known = {"low": low, "high": high, "unit": unit, "meaning": meaning, "step": step}
    value: float = field(default=neutral, metadata=known)
    return value


@dataclass(frozen=True, slots=True)
class Parameters:
    """Constants of the controller for maps; the defaults are neutral."""

    inflation_margin: float = _tunable(
        0.0,
        0.0,
        12.0,
        "px",
        "room wanted beside the body where the map has it",
        step=2.0,
    )
    lookahead: float = _tunable(
        120.0,
        20.0,
        240.0,
        "px",
        "length of way in which a point to aim at is looked for",
    )
    cruise_speed: float = _tunable(
        1.0, 0.25, 1.0, "", "share of the wheel limit on a free way"
    )
    slow_dist: float = _tunable(
        0.0, 0.0, 80.0, "px", "free length ahead below which it slows down"
    )
    stop_dist: float = _tunable(
        0.0, 0.0, 40.0, "px", "free length ahead below which it lines up before driving"
    )
    turn_gain: float = _tunable(
        0.3, 0.1, 1.0, "", "share of the heading error that a step corrects"
    )
    turn_in_place: float = _tunable(
        0.8, 0.05, 1.2, "rad", "heading error above which it turns in place"
    )
    unstick_after: float = _tunable(
        0.0, 0.0, 400.0, "steps", "without progress until an unstick manoeuvre; 0: none"
    )

    def __post_init__(self) -> None:
        _check(self)

    def changed(self, **values: float) -> Parameters:
        """A copy with some values replaced, each moved into its bounds."""
        return changed(self, values)


@dataclass(frozen=True, slots=True)
class EPuckParameters:
    """Constants of the controller for the e-puck; the defaults are neutral."""

    inflation_margin: float = _tunable(
        0.0,
        0.0,
        0.03,
        "m",
        "room wanted beside the body where the world has it",
        step=0.002,
    )
    cruise_speed: float = _tunable(
        1.0, 0.25, 1.0, "", "share of the wheel limit on a free way"
    )
    slow_dist: float = _tunable(
        0.0, 0.0, 0.06, "m", "free length ahead below which it slows down"
    )
    blocked: float = _tunable(
        1000.0, 300.0, 1900.0, "", "reading of ps0 or ps7 at which it does not drive on"
    )
    turn_gain: float = _tunable(
        0.3, 0.1, 1.0, "", "share of the heading error that a step corrects"
    )
    turn_in_place: float = _tunable(
        0.8, 0.05, 1.2, "rad", "heading error above which it turns in place"
    )
    look_steps: float = _tunable(
        5.0, 1.0, 40.0, "steps", "from one look whether the way is clear to the next"
    )
    unstick_after: float = _tunable(
        0.0, 0.0, 400.0, "steps", "without progress until it trusts the map alone"
    )

    def __post_init__(self) -> None:
        _check(self)

    def changed(self, **values: float) -> EPuckParameters:
        """A copy with some values replaced, each moved into its bounds."""
        return changed(self, values)


def changed(parameters: P, values: Mapping[str, float]) -> P:
    """A copy with some values replaced, each moved into its bounds."""
    bounded: dict[str, Any] = {
        item.name: _bounded(values[item.name], item.metadata)
        for item in fields(parameters)
        if item.name in values
    }
    return replace(parameters, **bounded)


def _check(parameters: Tuned) -> None:
    for item in fields(parameters):
        value = getattr(parameters, item.name)
        low, high = item.metadata["low"], item.metadata["high"]
        if not low <= value <= high:
            raise ValueError(
                f"expected {item.name} in [{low:g}, {high:g}], got {value!r}"
            )


def _bounded(value: float, known: Mapping[str, Any]) -> float:
    digits = 5 if known["unit"] == "m" else 3
    return round(min(max(value, float(known["low"])), float(known["high"])), digits)


def names_of(kind: type[Tuned]) -> tuple[str, ...]:
    """Names of the parameters, in their order."""
    return tuple(item.name for item in fields(kind))


def about(kind: type[Tuned], name: str) -> Mapping[str, Any]:
    """What is known of a parameter: `low`, `high`, `unit`, `meaning`, `step`."""
    return next(item.metadata for item in fields(kind) if item.name == name)


def read_parameters(source: str, kind: type[P]) -> P | None:
    """The parameters of a controller made from a template; None of another one."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError):
        return None
    names = {name.upper(): name for name in names_of(kind)}
    found: dict[str, float] = {}
    for node in tree.body:
        match node:
            case ast.Assign(
                targets=[ast.Name(id=name)],
                value=ast.Constant(value=float() | int() as value),
            ) if name in names:
                found[names[name]] = float(value)
    if len(found) < len(names):
        return None
    return changed(kind(), found)
