"""Deviations in words."""

from __future__ import annotations

from tdac_agent.tasks.deviation import DEVIATIONS
from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.gap import gap_figure


def part_text(name: str, value: float, units: Units, radius: float) -> str:
    """A part in words.

    Args:
        name: Its name.
        value: Its value.
        units: Units of the task, as printed.
        radius: Body radius, in units of the environment.
    """
    part = DEVIATIONS[name]
    return f"{part.words} {value_text(name, value, units, radius)}"


def value_text(name: str, value: float, units: Units, radius: float) -> str:
    """The value of a part with its unit; signs only where they mean something."""
    part = DEVIATIONS[name]
    sign = "" if not (part.signed and value) else "-" if value < 0 else "+"
    size = abs(value)
    if part.unit == "radii":
        return sign + gap_figure(size * radius, units)
    if part.unit == "share":
        return f"{sign}{100 * size:.3g} %"
    if part.unit == "steps":
        return f"{size:.0f} step{'s' * (size != 1)}"
    return f"{sign}{size:.3g} {part.unit}"
