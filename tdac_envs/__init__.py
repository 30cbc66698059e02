"""Gymnasium environments for map images and Webots worlds.

Create them with `gym.make("TDAC-Map2D-v0")` and `gym.make("TDAC-EPuck-v0")`;
`gym.make("TDAC-Ladder-v0", level="unknown")` has a new world in each episode.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

import gymnasium as gym

from tdac_envs.core.errors import MapError, TaskError, TdacError, WorldError

if TYPE_CHECKING:
    from tdac_envs.grid.grid import OccupancyGrid
    from tdac_envs.ladder.task_sets import load_set
    from tdac_envs.learning.wrapping import wrap_for_rl
    from tdac_envs.mapping.bundled import bundled_map, bundled_maps
    from tdac_envs.mapping.params import MapParams, RobotParams
    from tdac_envs.mapping.preprocessing import preprocess
    from tdac_envs.robots.bundled import bundled_robots, load_robot
    from tdac_envs.worlds.bundled import bundled_worlds
    from tdac_envs.worlds.wbt.reader import load_world, read_world
    from tdac_envs.worlds.wbt.writer import write_world
    from tdac_envs.worlds.world import World

__all__ = [
    "MapError",
    "MapParams",
    "OccupancyGrid",
    "RobotParams",
    "TaskError",
    "TdacError",
    "World",
    "WorldError",
    "bundled_map",
    "bundled_maps",
    "bundled_robots",
    "bundled_worlds",
    "load_robot",
    "load_set",
    "load_world",
    "preprocess",
    "read_world",
    "wrap_for_rl",
    "write_world",
]

_MODULE_OF = {
    "MapParams": "tdac_envs.mapping.params",
    "OccupancyGrid": "tdac_envs.grid.grid",
    "RobotParams": "tdac_envs.mapping.params",
    "World": "tdac_envs.worlds.world",
    "bundled_map": "tdac_envs.mapping.bundled",
    "bundled_maps": "tdac_envs.mapping.bundled",
    "bundled_robots": "tdac_envs.robots.bundled",
    "load_robot": "tdac_envs.robots.bundled",
    "bundled_worlds": "tdac_envs.worlds.bundled",
    "load_set": "tdac_envs.ladder.task_sets",
    "load_world": "tdac_envs.worlds.wbt.reader",
    "preprocess": "tdac_envs.mapping.preprocessing",
    "read_world": "tdac_envs.worlds.wbt.reader",
    "wrap_for_rl": "tdac_envs.learning.wrapping",
    "write_world": "tdac_envs.worlds.wbt.writer",
}


def __getattr__(name: str) -> Any:
    """Imports the heavier parts on first use."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'tdac_envs' has no attribute {name!r}")
    return getattr(import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    """All names, including those that are imported on first use."""
    return sorted({*globals(), *__all__})


# No TimeLimit: the horizon depends on the task, and the envs truncate themselves.
# Batches take `max_episode_steps` themselves.
# What needs `max_episode_steps` in the spec gets it from
# `gym.make(..., horizon=1000, max_episode_steps=1000)`.
gym.register(
    "TDAC-Map2D-v0",
    entry_point="tdac_envs.map2d.env:Map2DEnv",
    vector_entry_point="tdac_envs.map2d.vector:Map2DVectorEnv",
)
gym.register(
    "TDAC-EPuck-v0",
    entry_point="tdac_envs.epuck.env:EPuckEnv",
    vector_entry_point="tdac_envs.epuck.vector:EPuckVectorEnv",
)
gym.register(
    "TDAC-Ladder-v0",
    entry_point="tdac_envs.ladder.env:make",
    vector_entry_point="tdac_envs.ladder.vector:make",
)
