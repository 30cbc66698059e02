"""Observation wrappers for learning: map-independent observations, and guidance.

Re-exports the public names of `tdac_envs.learning.wrappers`.
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
