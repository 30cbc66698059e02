"""Controller templates: their tunable parameters, and what to change after failures."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, ClassVar, Generic, Literal, Self, TypeVar

import jinja2

from tdac_agent.verification.diagnosis.report import Cause

MARGIN = "inflation_margin"
# The search for a margin ends when its interval is this fraction of the step.
_RESOLUTION = 0.125


@dataclass(frozen=True, slots=True)
class MarginBounds:
    """Open interval of inflation margins that are not yet known to fail."""

    above: float = 0.0
    below: float = math.inf


@dataclass(frozen=True, slots=True)
class Remedy:
    """Parameter changes for one cause of failure; mappings are by parameter name.

    Attributes:
        margin: Direction of the search for a better inflation margin.
        add: Values to add.
        scale: Factors; a parameter that is off (0) stays off.
        switch_on: New values of parameters that are off.
    """

    margin: Literal["wider", "narrower"] | None = None
    add: Mapping[str, float] = field(default_factory=dict)
    scale: Mapping[str, float] = field(default_factory=dict)
    switch_on: Mapping[str, float] = field(default_factory=dict)

    def apply(self, parameters: P, bounds: MarginBounds) -> P:
        """Returns the changed parameters, clipped to their bounds."""
        values = {n: getattr(parameters, n) * f for n, f in self.scale.items()}
        values |= {n: getattr(parameters, n) + d for n, d in self.add.items()}
        off = {n: v for n, v in self.switch_on.items() if not getattr(parameters, n)}
        if self.margin is not None:
            step: float = metadata_of(type(parameters), MARGIN)["step"]
            margin = parameters.inflation_margin
            wider = self.margin == "wider"
            gap = bounds.below - margin if wider else margin - bounds.above
            change = step if gap == math.inf else 0.5 * gap
            if gap <= _RESOLUTION * step:
                change = 0.0
            values[MARGIN] = margin + (change if wider else -change)
        return parameters.changed(**(values | off))


@dataclass(frozen=True, slots=True)
class Tuned:
    """Base of the parameters of a template, all of them floats with neutral defaults.

    The constants in the controller have the same names, in capitals. `remedies` maps
    causes of failures to parameter changes; if two change the same parameter, the
    first one applies. `inflation_margin` is the desired clearance around the body.

    Raises:
        ValueError: A value is out of bounds.
    """

    remedies: ClassVar[Mapping[Cause, Remedy]]
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


def metadata_of(kind: type[Tuned], name: str) -> Mapping[str, Any]:
    """Returns `low`, `high`, `unit`, `meaning` and `step` of a parameter."""
    return next(item.metadata for item in fields(kind) if item.name == name)


def read_parameters(source: str, kind: type[P]) -> P | None:
    """Returns the parameters in a template's controller; None for other controllers."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError):
        return None
    names = {name.upper(): name for name in names_of(kind)}
    values: dict[str, float] = {}
    for node in tree.body:
        match node:
            case ast.Assign(
                targets=[ast.Name(id=name)],
                value=ast.Constant(value=float() | int() as value),
            ) if name in names:
                values[names[name]] = float(value)
    return kind().changed(**values) if len(values) == len(names) else None


@dataclass(frozen=True, slots=True)
class Template(Generic[P]):
    """A controller template.

    Attributes:
        kind: Class of the parameters, with neutral defaults.
        file: Jinja2 template of the source.
        facts: Template variables besides the parameters.
    """

    kind: type[P]
    file: Path
    facts: dict[str, Any]

    def render(self, parameters: P) -> str:
        """Returns the source of the controller with these parameters."""
        template = jinja2.Environment(
            undefined=jinja2.StrictUndefined, keep_trailing_newline=True
        ).from_string(self.file.read_text(encoding="utf-8"))  # raw read: shipped
        tuning = [
            {
                "constant": item.name.upper(),
                "value": float(getattr(parameters, item.name)),
                "meaning": ", ".join(
                    filter(None, (item.metadata["unit"], item.metadata["meaning"]))
                ),
            }
            for item in fields(parameters)
        ]
        return str(template.render(fields=tuning, **self.facts))
