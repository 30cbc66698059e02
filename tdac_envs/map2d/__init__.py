"""The environment TDAC-Map2D-v0: a robot on an occupancy grid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tdac_envs.map2d.env import Map2DEnv

__all__ = ["Map2DEnv"]


def __getattr__(name: str) -> Any:
    """Imports the environment on first use: it loads compiled code."""
    if name != "Map2DEnv":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from tdac_envs.map2d.env import Map2DEnv

    return Map2DEnv
