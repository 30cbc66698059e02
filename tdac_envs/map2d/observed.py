"""Observations of a robot on a map: the space, and disturbed ranges."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from tdac_envs.drive import batching
from tdac_envs.drive.stepping import CONTACT
from tdac_envs.map2d.setup import Map2DSetup
from tdac_envs.map2d.task import Map2DTask

CONTACTS = None, "wall", "mover", "mover_standing"
"""What the robot touched in a step, by `outcome[CONTACT]`."""


def info_of(outcome: list[float]) -> dict[str, Any]:
    """The `info` of a step, from its `outcome` as a list; see `Map2DEnv`."""
    # In one literal, because it is made in each step.
    (
        _, _, _, reached, touched, collisions, clipped, gap, remaining, room, contact,
    ) = outcome  # fmt: skip
    return {
        "is_success": reached == 1.0,
        "collision": touched == 1.0,
        "contact": CONTACTS[int(contact)] if contact else None,
        "collisions": int(collisions),
        "clipped": int(clipped),
        "distance_to_goal": gap,
        "path_distance": remaining,
        "clearance": room,
    }


def infos_of(outcome: NDArray[np.float64], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """The infos of a batch, as of `drive.batching.infos_of`."""
    infos = batching.infos_of(outcome, mask)
    contacts = np.full(len(mask), None, object)
    for i in np.flatnonzero(outcome[:, CONTACT]).tolist():
        contacts[i] = CONTACTS[int(outcome[i, CONTACT])]
    infos["contact"] = contacts
    infos["_contact"] = mask.copy()
    return infos


def noisy(
    ranges: NDArray[np.float32], setup: Map2DSetup, random: np.random.Generator
) -> NDArray[np.float64]:
    """The ranges of one robot with noise, `range_min` and dropouts.

    They are in [0, range_max].
    """
    seen, most = ranges.astype(np.float64), setup.nominal.robot.range_max
    if setup.range_noise:
        noise = random.normal(1.0, setup.range_noise, ranges.size)
        np.clip(ranges * noise, 0.0, most, out=seen)
    if setup.range_min:
        seen[seen < setup.range_min] = setup.blind
    if setup.range_dropout:
        seen[random.random(ranges.size) < setup.range_dropout] = most
    return seen


def observation_space(task: Map2DTask) -> spaces.Dict:
    """The observation space of a task; see `Map2DEnv`."""
    grid, robot = task.terrain.grid, task.robot
    corner = np.array([grid.width - 0.5, grid.height - 0.5], np.float32)
    least = np.full(2, -0.5, np.float32)
    pi = np.float32(math.pi)
    return spaces.Dict(
        {
            "pose": spaces.Box(np.append(least, -pi), np.append(corner, pi)),
            "goal": spaces.Box(least, corner),
            "wheel_speeds": spaces.Box(-1.0, 1.0, (2,), np.float32),
            "ranges": spaces.Box(0.0, robot.range_max, (robot.n_rays,), np.float32),
        }
    )
