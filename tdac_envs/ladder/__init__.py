"""Generated worlds that are new to a controller, its author and its training."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tdac_envs.ladder.words import world_key
    from tdac_envs.ladder.worlds import WorldSpec, make_world

__all__ = ["WorldSpec", "make_world", "world_key"]


def __getattr__(name: str) -> Any:
    """Imports the exports on first use: they load compiled code."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from tdac_envs.ladder import words, worlds

    return getattr(words if name == "world_key" else worlds, name)
