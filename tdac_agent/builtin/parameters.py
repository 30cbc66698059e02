"""Tunable parameters of controller templates, and reading them from a controller."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

if TYPE_CHECKING:
    from tdac_agent.builtin.remedies import Remedies


@dataclass(frozen=True, slots=True)
class Tuned:
    """Base of the parameters of a template, all of them floats with neutral defaults.

    The constants in the controller have the same names, in capitals. `remedies` maps
    causes of failures to parameter changes. `inflation_margin` is the desired clearance
    around the body.

    Raises:
        ValueError: A value is out of bounds.
    """

    remedies: ClassVar[Remedies]
    inflation_margin: float = 0.0

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            low, high = item.metadata["low"], item.metadata["high"]
            if not low <= value <= high:
                raise ValueError(
                    f"expected {item.name} in [{low:g}, {high:g}], got {value!r}"
                )

    def changed(self, **values: float) -> Self:
        """Returns a copy with some values replaced, each clipped to its bounds."""
        bounded: dict[str, Any] = {
            item.name: _bounded(values[item.name], item.metadata)
            for item in fields(self)
            if item.name in values
        }
        return replace(self, **bounded)


P = TypeVar("P", bound=Tuned)


def tunable(
    neutral: float,
    low: float,
    high: float,
    unit: str,
    meaning: str,
    *,
    step: float = 0.0,
) -> float:
    """Returns a dataclass field whose metadata has bounds, unit and meaning.

    Args:
        neutral: Default value.
        low: Smallest value.
        high: Largest value.
        unit: Unit; empty for a dimensionless number.
        meaning: Comment in the controller.
        step: Step of the repair's search for a better value.
    """
    known = {"low": low, "high": high, "unit": unit, "meaning": meaning, "step": step}
    value: float = field(default=neutral, metadata=known)
    return value


def _bounded(value: float, known: Mapping[str, Any]) -> float:
    digits = 5 if known["unit"] == "m" else 3
    return round(min(max(value, float(known["low"])), float(known["high"])), digits)


def names_of(kind: type[Tuned]) -> tuple[str, ...]:
    """Returns the names of the parameters, in order."""
    return tuple(item.name for item in fields(kind))


def about(kind: type[Tuned], name: str) -> Mapping[str, Any]:
    """Returns the metadata of a parameter: `low`, `high`, `unit`, `meaning`, `step`."""
    return next(item.metadata for item in fields(kind) if item.name == name)


def read_parameters(source: str, kind: type[P]) -> P | None:
    """Returns the parameters in a template's controller; None for other controllers."""
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
    return kind().changed(**found)
