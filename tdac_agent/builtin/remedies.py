"""The repair tables: which parameters of a template answer which failure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

from tdac_agent.builtin.parameters import (
    EPuckParameters,
    P,
    Parameters,
    Tuned,
    about,
    changed,
)
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

_HELD_UP = Remedy(
    scale={"unstick_after": 0.5, "lookahead": 0.5}, switch_on={"unstick_after": 100.0}
)
_RESTLESS = Remedy(scale={"turn_gain": 0.6, "turn_in_place": 1.5})

MAP2D: Remedies = MappingProxyType(
    {
        "collision": Remedy(
            margin="wider",
            add={"turn_gain": 0.3, "slow_dist": 10.0, "stop_dist": 4.0},
            scale={"lookahead": 0.5, "turn_in_place": 0.5},
        ),
        "no motion": Remedy(margin="narrower", scale={"stop_dist": 0.5}),
        "stuck": _HELD_UP,
        "looping": _HELD_UP,
        "spinning": _RESTLESS,
        "oscillating": _RESTLESS,
        "missed goal": Remedy(scale={"lookahead": 0.5, "turn_in_place": 0.5}),
        "too slow": Remedy(
            scale={
                "cruise_speed": 1.4,
                "turn_in_place": 1.4,
                "slow_dist": 0.5,
                "stop_dist": 0.5,
            }
        ),
        "time-out": Remedy(scale={"lookahead": 0.5}),
        "held out": Remedy(
            margin="wider",
            add={"turn_gain": 0.15},
            scale={"lookahead": 0.7, "turn_in_place": 0.7},
        ),
    }
)

# What holds an e-puck up that has a plan is what its sensors take for an obstacle.
_DISTRUSTED = Remedy(
    scale={"unstick_after": 0.5, "blocked": 1.5}, switch_on={"unstick_after": 100.0}
)
_UNSTEADY = Remedy(scale={"turn_gain": 0.6, "turn_in_place": 1.5, "blocked": 1.5})

EPUCK: Remedies = MappingProxyType(
    {
        "collision": Remedy(
            margin="wider",
            add={"turn_gain": 0.3, "slow_dist": 0.01},
            scale={"turn_in_place": 0.5, "blocked": 0.8},
        ),
        "no motion": Remedy(margin="narrower", scale={"blocked": 1.5}),
        "stuck": _DISTRUSTED,
        "looping": _DISTRUSTED,
        "spinning": _UNSTEADY,
        "oscillating": _UNSTEADY,
        "missed goal": Remedy(scale={"turn_in_place": 0.5, "cruise_speed": 0.7}),
        "too slow": Remedy(
            scale={"cruise_speed": 1.4, "turn_in_place": 1.4, "slow_dist": 0.5}
        ),
        "time-out": Remedy(scale={"look_steps": 2.0}),
        "held out": Remedy(
            margin="wider", add={"turn_gain": 0.15}, scale={"turn_in_place": 0.7}
        ),
    }
)

_TABLES: Mapping[type[Tuned], Remedies] = MappingProxyType(
    {Parameters: MAP2D, EPuckParameters: EPUCK}
)


def remedies_for(kind: type[Tuned]) -> Remedies:
    """The table of a template."""
    return _TABLES[kind]
