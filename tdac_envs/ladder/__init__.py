"""Generated worlds that are new to a controller, its author and its training."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tdac_envs.ladder.plate_worlds import PlatesSpec, make_plates
    from tdac_envs.ladder.random_stream import world_key
    from tdac_envs.ladder.worlds import WorldSpec, make_world

__all__ = ["PlatesSpec", "WorldSpec", "make_plates", "make_world", "world_key"]
_MODULES = {
    "PlatesSpec": "plate_worlds",
    "WorldSpec": "worlds",
    "make_plates": "plate_worlds",
    "make_world": "worlds",
    "world_key": "random_stream",
}


def __getattr__(name: str) -> Any:
    """Imports the exports on first use: they load compiled code."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
