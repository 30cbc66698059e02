"""Remedies: how the parameters of a template change after a failure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from tdac_agent.builtin.parameters import P, about
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
        step: float = about(type(parameters), MARGIN)["step"]
        margin = parameters.inflation_margin
        if self.margin == "wider":
            values[MARGIN] = _wider(margin, bounds, step)
        elif self.margin == "narrower":
            values[MARGIN] = _narrower(margin, bounds, step)
        return parameters.changed(**(values | off))


def _wider(margin: float, bounds: MarginBounds, step: float) -> float:
    if bounds.below == math.inf:
        return margin + step
    gap = bounds.below - margin
    return margin + 0.5 * gap if gap > _RESOLUTION * step else margin


def _narrower(margin: float, bounds: MarginBounds, step: float) -> float:
    gap = margin - bounds.above
    return margin - 0.5 * gap if gap > _RESOLUTION * step else margin


Remedies = Mapping[Cause, Remedy]
"""Remedies by cause; if two change the same parameter, the first one applies."""
