"""Calls of all kernels for maps, so that they get compiled: in parts, as they are used.

Modules that only one part needs are imported in it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tdac_agent.environments.kernels_used import use_batch, use_robot
from tdac_agent.tasks.first_run import CodePart
from tdac_envs.grid.grid import BoolGrid

ENV_ID = "TDAC-Map2D-v0"
ENDS: dict[str, Any] = {"start": (12.0, 12.0), "goal": (80.0, 50.0), "robot_radius": 5}


def _map() -> BoolGrid:
    cells = np.zeros((60, 90), np.bool_)
    cells[25:35, 30:] = True
    return cells


def _drive() -> None:
    """Plans on a map without movers, and drives up to a contact."""
    from tdac_envs.map2d import rays

    env = use_robot(ENV_ID, map=_map(), **ENDS)
    rays.sees(env.nominal.terrain.leaps, 12.0, 12.0, 80.0, 50.0)


def _movers() -> list[dict[str, Any]]:
    post = {"kind": "route", "points": [(45.0, 10.0)], "radius": 3.0}
    return [post, {"kind": "crowd", "count": 2, "radius": 2.0, "speed": 5.0}]


def _drive_among_movers() -> None:
    use_robot(ENV_ID, map=_map(), movers=_movers(), **ENDS)


def _make_worlds() -> None:
    """Makes a small world, and a draft of another kind."""
    from tdac_envs.ladder.dead_ends import RangeSensor, dead_ends
    from tdac_envs.ladder.generators.clutter import Clutter, draw
    from tdac_envs.ladder.random_stream import RandomStream
    from tdac_envs.ladder.worlds import WorldSpec, make_world
    from tdac_envs.mapping.ray_angles import fan

    clutter = Clutter.model_validate({"name": "clutter", "width": 60, "height": 60})
    draw(RandomStream(bytes(32)), clutter, 8.0)
    maze = {"name": "mazes", "width": 60, "height": 60, "loops": 0.0}
    spec = WorldSpec.model_validate({"generator": maze, "radius": 4, "min_steps": 10})
    sensor = RangeSensor(fan(110.0, 18), 40.0)
    dead_ends(make_world(spec, bytes(32)), spec.radius, sensor)


def _plan_among_movers() -> None:
    """Drives as the planners do that admit a world with movers."""
    from tdac_envs.drive.disturbances import Disturbances
    from tdac_envs.ladder.orca_driver import drive_by_orca
    from tdac_envs.ladder.space_time import earliest_arrival
    from tdac_envs.map2d.env import Map2DEnv
    from tdac_envs.movers.orca import velocity_among

    velocity_among(np.zeros((1, 5)), np.zeros(2), 1.0, 1.0, 0.1, np.empty(2))
    env = Map2DEnv(map=_map(), movers=_movers(), **ENDS)
    env.reset(seed=0)
    earliest_arrival(env.task)
    drive_by_orca(env.task, Disturbances(), np.random.default_rng(0))


ROBOT = CodePart(_drive, "tdac_envs.map2d", "rays.sees", 9.0)
MOVERS = CodePart(_drive_among_movers, "tdac_envs.map2d", "among.drive_among", 18.0)
WORLDS = CodePart(_make_worlds, "tdac_envs.ladder", "dead_ends._look", 6.0)
PLANNERS = CodePart(_plan_among_movers, "tdac_envs.ladder", "orca_driver._choose", 8.0)


def use_kernels() -> None:
    """Calls each kernel through its usual caller, on a small map."""
    import tdac_envs

    image = np.where(_map(), 0, 255).astype(np.uint8)
    start, goal, radius = ENDS.values()
    tdac_envs.preprocess(image, start, goal, radius, preset="paper")
    for part in (ROBOT, MOVERS, WORLDS, PLANNERS):
        part.use()
    use_robot(ENV_ID, map=_map(), on_collision="block", **ENDS)
    use_robot(ENV_ID, map=_map(), sensor="sonar", **ENDS)
    use_batch(ENV_ID, map=_map(), **ENDS)
    use_batch(ENV_ID, map=_map(), movers=_movers(), **ENDS)
