"""Calls of all kernels for worlds, so that they get compiled."""

from __future__ import annotations

from typing import Any

import numpy as np

from tdac_agent.environments.epuck.surroundings import WorldSurroundings
from tdac_agent.environments.kernels_used import use_batch, use_robot
from tdac_agent.tasks.first_run import CodePart
from tdac_envs.epuck import infrared, kernels

ENV_ID = "TDAC-EPuck-v0"


def _drive() -> Any:
    """Plans and drives in a bundled world, up to a contact; returns the environment."""
    epuck = use_robot(ENV_ID, world="arena", ground_sensors=True)
    around, pose = WorldSurroundings(epuck.nominal), epuck.nominal.start
    around.touch(pose, 10.0)
    around.pull(around.path_from(pose))
    points, first, extent = epuck.nominal.ground.solid.arrays()
    infrared.sees(points, first, extent, 0.0, 0.0, 1.0, 1.0)
    return epuck


ROBOT = CodePart(_drive, "tdac_envs.epuck", "infrared.sees", 13.0)


def use_kernels() -> None:
    """Calls each kernel through its usual caller, in a bundled world."""
    from tdac_envs.core.compiled import read_only
    from tdac_envs.webots.rays import nearest_hit, scan
    from tdac_envs.webots.rendering import look_through
    from tdac_envs.webots.scenery import Scenery
    from tdac_envs.worlds.wbt.colours import BLACK_SKY

    epuck = _drive()
    use_robot(ENV_ID, world="arena", on_collision="block")
    use_batch(ENV_ID, world="arena", ground_sensors=True)
    points, first, extent = epuck.nominal.ground.solid.arrays()
    nearest_hit(points, first, extent, 0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 1.0)
    (words,) = epuck.addresses.words
    kernels.turn_wheels(words)
    kernels.finish(words)
    view = look_through(np.zeros(3), np.eye(3), 1.0, 4, 3)
    scenery = Scenery.of(epuck.nominal.ground.world, BLACK_SKY)
    scenery.image(view, 0.01, 4, 3, epuck.things())
    place, ahead = read_only(np.zeros(3)), read_only(np.eye(3)[:1])
    scan(*scenery.prisms.arrays(), place, ahead, 0.01, 1.0, np.empty(1))
