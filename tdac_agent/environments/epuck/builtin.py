"""Parameters of the controller template for the e-puck, and their remedies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import ClassVar

from tdac_agent.builtin.template import Remedy, Template, Tuned, tunable
from tdac_agent.verification.diagnosis.report import Cause
from tdac_agent.verification.suite.contract import time_step
from tdac_envs.drive.smallest_gap import required_gap
from tdac_envs.epuck.kernels import WHEEL_RADIUS
from tdac_envs.epuck.task import EPuckTask

RESERVE = 0.0025
"""Margin beyond the kept gap, m."""

# An e-puck with a plan gets stuck if its sensors falsely report an obstacle.
_DISTRUSTED = Remedy(
    scale={"unstick_after": 0.5, "blocked": 1.5}, switch_on={"unstick_after": 100.0}
)
_UNSTEADY = Remedy(scale={"turn_gain": 0.6, "turn_in_place": 1.5, "blocked": 1.5})

REMEDIES: Mapping[Cause, Remedy] = MappingProxyType(
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


@dataclass(frozen=True, slots=True)
class EPuckParameters(Tuned):
    """Constants of the controller for the e-puck; the defaults are neutral."""

    remedies: ClassVar = REMEDIES

    inflation_margin: float = tunable(
        0.0,
        0.0,
        0.03,
        "m",
        "desired clearance around the body where the world allows it",
        step=0.002,
    )
    cruise_speed: float = tunable(
        1.0, 0.25, 1.0, "", "fraction of the wheel limit on a free path"
    )
    slow_dist: float = tunable(
        0.0, 0.0, 0.06, "m", "free distance ahead below which it slows down"
    )
    blocked: float = tunable(
        1000.0, 300.0, 1900.0, "", "reading of ps0 or ps7 above which it turns away"
    )
    turn_gain: float = tunable(
        0.3, 0.1, 1.0, "", "fraction of the heading error corrected in a step"
    )
    turn_in_place: float = tunable(
        0.8, 0.05, 1.2, "rad", "heading error above which it turns in place"
    )
    look_steps: float = tunable(
        5.0, 1.0, 40.0, "steps", "between two checks whether the path is clear"
    )
    unstick_after: float = tunable(
        0.0, 0.0, 400.0, "steps", "without progress before it ignores ps; 0: off"
    )


def template_for(
    task: EPuckTask, kept_gap: float | None = None
) -> Template[EPuckParameters]:
    """Returns the template with a task's wheel limit, time step and tolerance.

    Args:
        task: The task.
        kept_gap: Gap to obstacles that it keeps where the world allows it, m; by
            default the least that is required.
    """
    facts = {
        "kept_gap": required_gap(task.body_radius) if kept_gap is None else kept_gap,
        "reserve": RESERVE,
        "time_step": time_step(task.dt),
        "wheel_radius": WHEEL_RADIUS,
        "axle_length": task.axle_length,
        "max_wheel_speed": task.max_wheel_speed,
        "goal_tolerance": task.goal_tolerance,
    }
    file = Path(__file__).with_name("controller.py.j2")
    return Template(EPuckParameters, file, facts)
