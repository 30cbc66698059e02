"""Remedies: how the parameters of a template answer a cause of failure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from tdac_agent.builtin.parameters import P, about, changed
from tdac_agent.verification.diagnosis.report import Cause

MARGIN = "inflation_margin"
# The search for a margin ends within this share of its step.
_RESOLUTION = 0.125


@dataclass(frozen=True, slots=True)
class Bounds:
    """Margins that failed: too small ones and too large ones."""

    above: float = 0.0
    below: float = math.inf


@dataclass(frozen=True, slots=True)
class Remedy:
    """How one cause of failure changes the parameters.

    Attributes:
        margin: The way in which to search for a better inflation margin.
        add: Amount added to a parameter.
        scale: Factor of a parameter; one that is off (0) stays off.
        switch_on: Value of a parameter that was off.
    """

    margin: Literal["wider", "narrower"] | None = None
    add: Mapping[str, float] = field(default_factory=dict)
    scale: Mapping[str, float] = field(default_factory=dict)
    switch_on: Mapping[str, float] = field(default_factory=dict)

    def apply(self, parameters: P, bounds: Bounds) -> P:
        """The parameters after this remedy, within their limits."""
        values = {n: getattr(parameters, n) * f for n, f in self.scale.items()}
        values |= {n: getattr(parameters, n) + d for n, d in self.add.items()}
        off = {n: v for n, v in self.switch_on.items() if not getattr(parameters, n)}
        step: float = about(type(parameters), MARGIN)["step"]
        margin = parameters.inflation_margin
        if self.margin == "wider":
            values[MARGIN] = _wider(margin, bounds, step)
        elif self.margin == "narrower":
            values[MARGIN] = _narrower(margin, bounds, step)
        return changed(parameters, values | off)


def _wider(margin: float, bounds: Bounds, step: float) -> float:
    if bounds.below == math.inf:
        return margin + step
    gap = bounds.below - margin
    return margin + 0.5 * gap if gap > _RESOLUTION * step else margin


def _narrower(margin: float, bounds: Bounds, step: float) -> float:
    gap = margin - bounds.above
    return margin - 0.5 * gap if gap > _RESOLUTION * step else margin


Remedies = Mapping[Cause, Remedy]
"""Most telling cause first: of two that want the same parameter the first wins."""
