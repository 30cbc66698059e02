"""Which physics moves the robot: the argument `physics` of the environments."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from tdac_envs.core.arguments import positive
from tdac_envs.core.errors import TaskError, hint
from tdac_envs.physics.body import BodySpec
from tdac_envs.physics.moved import EXACT, MEASURED, MUJOCO, VARIED, engine_named
from tdac_envs.robots.bundled import load_robot
from tdac_envs.robots.robot_file import body_in

BODY_KEYS = tuple(one.name for one in fields(BodySpec) if one.name != "radius")
KEYS = "engine", "rays", "resolution", *BODY_KEYS
PhysicsOption = str | Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Engine:
    """A physics and what it needs beyond the task.

    Attributes:
        name: One of `moved.ENGINES`.
        resolution: Metres per px of a map that does not say it.
        body: Values of the `BodySpec`, where they differ from the robot's usual ones.
        measures: Whether it measures the rays of the distance sensors, too.
    """

    name: str = EXACT
    resolution: float | None = None
    body: Mapping[str, float] = field(default_factory=dict)
    measures: bool = False

    @property
    def is_exact(self) -> bool:
        """Whether the compiled step moves the robot."""
        return self.name == EXACT

    def body_like(self, usual: BodySpec) -> BodySpec:
        """The body, given the usual one of the robot.

        Raises:
            TaskError: A value is not valid.
        """
        return usual.changed(**self.body)


EXACT_STEP = Engine()


def engine_of(given: Any, robot: Any = None) -> Engine:
    """The physics that a user asks for.

    Args:
        given: Its name, or a dict with the name as `engine` and any of the other
            `KEYS`.
        robot: Name or path of a robot file, whose `body` counts where `given` says
            nothing.

    Raises:
        TaskError: There is no such physics, or a key or value is not valid.
    """
    if not isinstance(given, Mapping):
        given = {"engine": given}
    for key in given:
        if key not in KEYS:
            raise TaskError(
                f"physics: unknown key {key!r:.60}; expected {', '.join(KEYS)}"
                f"{hint(str(key), KEYS)}"
            )
    name = engine_named(given.get("engine", ""))
    measures = _measures(name, given.get("rays"))
    if name == EXACT:
        return EXACT_STEP
    resolution = given.get("resolution")
    if resolution is not None:
        resolution = positive("physics: resolution", resolution)
    own = {} if robot is None else body_in(load_robot(robot).body)
    own |= {key: given[key] for key in BODY_KEYS if given.get(key) is not None}
    if name == VARIED:
        own.setdefault("varied", 0)
    return Engine(name, resolution, own, measures)


def _measures(name: str, rays: Any) -> bool:
    """Whether a physics measures the rays, too.

    Args:
        name: Name of the physics.
        rays: Who measures them; None for what the name says.

    Raises:
        TaskError: There is no such choice, or the exact step has no rays of MuJoCo.
    """
    if rays is None:
        return name == MEASURED
    if rays not in (EXACT, MUJOCO):
        raise TaskError(
            f"physics: unknown rays {rays!r:.60}; expected {EXACT} or {MUJOCO}"
            f"{hint(str(rays), (EXACT, MUJOCO))}"
        )
    if rays != EXACT and name == EXACT:
        raise TaskError(f"physics: rays {rays!r} need the engine {MUJOCO!r}")
    if rays == EXACT and name == MEASURED:
        raise TaskError(f"physics: {name!r} has rays {MUJOCO!r}; take {MUJOCO!r}")
    return bool(rays == MUJOCO)
