"""Observation wrappers for learning: the same form on every map, and guidance.

The public face of `tdac_envs.learning.wrappers`.
"""

from tdac_envs.learning.wrappers import (
    MIDDLE,
    WRAPPERS,
    Env,
    Frame,
    GoalRelativeObservation,
    Guidance,
    check_wrappers,
    guided_space,
    wrap,
)

__all__ = [
    "MIDDLE",
    "WRAPPERS",
    "Env",
    "Frame",
    "GoalRelativeObservation",
    "Guidance",
    "check_wrappers",
    "guided_space",
    "wrap",
]
