"""Calls of all kernels for maps, so that they get compiled."""

from __future__ import annotations

import numpy as np

import tdac_envs
from tdac_agent.environments.kernels_used import use_robot
from tdac_envs.map2d import rays


def use_kernels() -> None:
    """Calls each kernel through its usual caller, on a small map."""
    image = np.full((60, 90), 255, np.uint8)
    image[25:35, 30:] = 0
    start, goal, radius = (12.0, 12.0), (80.0, 50.0), 5.0
    grid, _ = tdac_envs.preprocess(image, start, goal, radius, preset="paper")
    ends = {"start": start, "goal": goal, "robot_radius": radius}
    disc = use_robot("TDAC-Map2D-v0", map=grid.cells, **ends)
    rays.sees(disc.nominal.terrain.leaps, 12.0, 12.0, 80.0, 50.0)
