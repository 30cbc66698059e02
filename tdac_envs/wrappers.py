"""Wrappers for learning: map-independent observations, guidance, views of maps.

Re-exports the public names of `wrappers`, `map_view`, `seen_map`, `goal_view` and
`wrapping` in `tdac_envs.learning`.
"""

from tdac_envs.learning.goal_view import GoalView
from tdac_envs.learning.map_view import MapView
from tdac_envs.learning.seen_map import SeenMap, Waypoints
from tdac_envs.learning.wrappers import (
    MIDDLE,
    WRAPPERS,
    Closeness,
    Env,
    Frame,
    GoalRelativeObservation,
    Guidance,
    check_wrappers,
    guided_space,
    wrap,
)
from tdac_envs.learning.wrapping import FOR_RL, wrap_for_rl

__all__ = [
    "FOR_RL",
    "MIDDLE",
    "WRAPPERS",
    "Closeness",
    "Env",
    "Frame",
    "GoalRelativeObservation",
    "GoalView",
    "Guidance",
    "MapView",
    "SeenMap",
    "Waypoints",
    "check_wrappers",
    "guided_space",
    "wrap",
    "wrap_for_rl",
]
