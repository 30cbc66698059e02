"""Registry of environments by Gymnasium id; each is loaded at first use."""

from __future__ import annotations

import functools
from importlib.metadata import entry_points
from pkgutil import resolve_name

from tdac_agent.tasks.environment import Environment
from tdac_envs.core.errors import TaskError, hint

GROUP = "tdac.environments"
DEFAULT = "TDAC-Map2D-v0"
OWN = {
    DEFAULT: "tdac_agent.environments.map2d.entry:MAP2D",
    "TDAC-EPuck-v0": "tdac_agent.environments.epuck.entry:EPUCK",
}


@functools.cache
def environment(env_id: str) -> Environment:
    """Returns the environment with a Gymnasium id.

    Raises:
        TaskError: The id is unknown, or the environment cannot be loaded.
    """
    if env_id in OWN:
        return _checked(resolve_name(OWN[env_id]), env_id)
    others = {point.name: point for point in entry_points(group=GROUP)}
    if env_id not in others:
        known = [*OWN, *others]
        raise TaskError(
            f"unknown environment {env_id!r}{hint(env_id, known)}; "
            f"known: {', '.join(known)}"
        )
    try:
        return _checked(others[env_id].load(), env_id)
    except Exception as error:
        raise TaskError(
            f"the environment {env_id!r} ({others[env_id].value}) cannot be loaded: "
            f"{type(error).__name__}: {error}"
        ) from error


def own_environments() -> list[Environment]:
    """Returns this package's environments; others load when a task names them."""
    return [environment(env_id) for env_id in OWN]


def environment_with_key(key: str) -> Environment:
    """Returns the environment of this package that has a certain task file key."""
    return next(one for one in own_environments() if key in one.keys)


def _checked(found: object, env_id: str) -> Environment:
    if not isinstance(found, Environment) or found.id != env_id:
        raise TypeError(
            f"expected an Environment with the id {env_id!r}, got {found!r}"
        )
    return found
