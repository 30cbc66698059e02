"""Calls of all kernels for maps, so that they get compiled."""

from __future__ import annotations

import numpy as np

import tdac_envs
from tdac_agent.environments.kernels_used import use_robot
from tdac_envs.drive.disturbances import Disturbances
from tdac_envs.ladder.dead_ends import Sensor, dead_ends
from tdac_envs.ladder.generators.clutter import Clutter, draw
from tdac_envs.ladder.orca_driver import drive_by_orca
from tdac_envs.ladder.space_time import earliest_arrival
from tdac_envs.ladder.words import Words
from tdac_envs.ladder.worlds import WorldSpec, make_world
from tdac_envs.map2d import rays
from tdac_envs.movers.orca import velocity_among


def use_kernels() -> None:
    """Calls each kernel through its usual caller, on a small map."""
    image = np.full((60, 90), 255, np.uint8)
    image[25:35, 30:] = 0
    start, goal, radius = (12.0, 12.0), (80.0, 50.0), 5.0
    grid, _ = tdac_envs.preprocess(image, start, goal, radius, preset="paper")
    ends = {"start": start, "goal": goal, "robot_radius": radius}
    disc = use_robot("TDAC-Map2D-v0", map=grid.cells, **ends)
    post = {"kind": "route", "points": [(45.0, 10.0)], "radius": 3.0}
    people = {"kind": "crowd", "count": 2, "radius": 2.0, "speed": 5.0}
    disc = use_robot("TDAC-Map2D-v0", map=grid.cells, movers=[post, people], **ends)
    earliest_arrival(disc.task)
    drive_by_orca(disc.task, Disturbances(), np.random.default_rng(0))
    velocity_among(np.zeros((1, 5)), np.zeros(2), 1.0, 1.0, 0.1, np.empty(2))
    use_robot("TDAC-Map2D-v0", map=grid.cells, sensor="sonar", **ends)
    rays.sees(disc.nominal.terrain.leaps, 12.0, 12.0, 80.0, 50.0)
    _use_ladder()


def _use_ladder() -> None:
    """Makes a small world, and a draft of another kind."""
    maze = {"name": "mazes", "width": 60, "height": 60, "loops": 0.0}
    spec = WorldSpec.model_validate({"generator": maze, "radius": 4, "min_steps": 10})
    dead_ends(make_world(spec, bytes(32)), spec.radius, Sensor(18, 2.0, 40.0))
    clutter = Clutter.model_validate({"name": "clutter", "width": 60, "height": 60})
    draw(Words(bytes(32)), clutter, 2.0 * spec.radius)
