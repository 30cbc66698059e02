"""Parameters of the controller template for maps, and their remedies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import ClassVar

from tdac_agent.builtin.template import Remedy, Template, Tuned, tunable
from tdac_agent.verification.diagnosis.report import Cause
from tdac_envs.drive.smallest_gap import required_gap
from tdac_envs.mapping.params import RobotParams

DEVIATIONS = 3.0
"""Standard deviations of its observed position that it keeps in addition."""
RESERVE = 0.02
"""Margin beyond the kept gap, as a share of the radius: it does not drive exactly."""

_HELD_UP = Remedy(
    scale={"unstick_after": 0.5, "lookahead": 0.5}, switch_on={"unstick_after": 100.0}
)
_RESTLESS = Remedy(scale={"turn_gain": 0.6, "turn_in_place": 1.5})

REMEDIES: Mapping[Cause, Remedy] = MappingProxyType(
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


@dataclass(frozen=True, slots=True)
class MapParameters(Tuned):
    """Constants of the controller for maps; the defaults are neutral."""

    remedies: ClassVar = REMEDIES

    inflation_margin: float = tunable(
        0.0,
        0.0,
        12.0,
        "px",
        "desired clearance around the body where the map allows it",
        step=2.0,
    )
    lookahead: float = tunable(
        120.0,
        20.0,
        240.0,
        "px",
        "distance along the path within which the aim is chosen",
    )
    cruise_speed: float = tunable(
        1.0, 0.25, 1.0, "", "fraction of the wheel limit on a free path"
    )
    slow_dist: float = tunable(
        0.0, 0.0, 80.0, "px", "free distance ahead below which it slows down"
    )
    stop_dist: float = tunable(
        0.0, 0.0, 40.0, "px", "free distance ahead below which it aligns before driving"
    )
    turn_gain: float = tunable(
        0.3, 0.1, 1.0, "", "fraction of the heading error corrected in a step"
    )
    turn_in_place: float = tunable(
        0.8, 0.05, 1.2, "rad", "heading error above which it turns in place"
    )
    unstick_after: float = tunable(
        0.0, 0.0, 400.0, "steps", "without progress before it drives carefully; 0: off"
    )


def template_for(
    robot: RobotParams,
    dt: float,
    resolution: float | None = None,
    kept_gap: float | None = None,
) -> Template[MapParameters]:
    """Returns the template for a robot.

    Args:
        robot: Values of the robot's constants.
        dt: Duration of a step, s.
        resolution: Metres per pixel, if it observes metres.
        kept_gap: Gap to obstacles that it keeps where the map allows it, px; by
            default the least that is required.
    """
    file = Path(__file__).with_name("controller.py.j2")
    facts = {
        "robot": robot,
        "dt": dt,
        "resolution": resolution,
        "kept_gap": required_gap(robot.radius) if kept_gap is None else kept_gap,
        "reserve": RESERVE,
    }
    return Template(MapParameters, file, facts)
