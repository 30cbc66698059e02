"""Calls of every kernel, so that all of them are compiled."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

import tdac_envs
from tdac_agent.environments.epuck.surroundings import world_surroundings
from tdac_agent.verification.suite.privileged.controllers import reference_way
from tdac_agent.verification.suite.reference import steer
from tdac_envs.epuck import infrared, kernels
from tdac_envs.learning.wrapped_vector import WrappedVectorEnv
from tdac_envs.map2d import rays


def use_map_kernels() -> None:
    """Calls each kernel that a map needs, by what calls it in use, on a small one."""
    image = np.full((60, 90), 255, np.uint8)
    image[25:35, 30:] = 0
    start, goal, radius = (12.0, 12.0), (80.0, 50.0), 5.0
    grid, _ = tdac_envs.preprocess(image, start, goal, radius, preset="paper")
    ends = {"start": start, "goal": goal, "robot_radius": radius}
    disc = _use("TDAC-Map2D-v0", map=grid.cells, **ends)
    rays.sees(disc.nominal.terrain.leaps, 12.0, 12.0, 80.0, 50.0)


def use_world_kernels() -> None:
    """Calls each kernel that a world needs."""
    epuck = _use("TDAC-EPuck-v0", world="arena", ground_sensors=True)
    around, pose = world_surroundings(epuck.nominal), epuck.nominal.start
    around.touch(pose, 10.0)
    around.pull(around.path_from(pose))
    points, first, extent = epuck.nominal.ground.solid.arrays()
    infrared.sees(points, first, extent, 0.0, 0.0, 1.0, 1.0)
    (words,) = epuck.addresses.words
    kernels.turn_wheels(words)
    kernels.finish(words)


def _use(name: str, **options: Any) -> Any:
    """Drives a robot, the reference and a batch for a step; returns the environment."""
    env: Any = gym.make(name, variation="jitter", **options).unwrapped
    env.reset(seed=0)
    env.step(env.action_space.sample())
    task = env.nominal
    start, goal = task.start, task.goal
    way = reference_way(task, start.x, start.y)
    steer((start.x, start.y, start.heading), way[-1], 1.0, 1.0)
    env.reset(options={"start": start[:2], "goal": goal})
    batch = gym.make_vec(name, 2, "vector_entry_point", **options)
    wrapped = WrappedVectorEnv(batch, ("goal-relative", "guidance", "flatten"))
    wrapped.reset(seed=0)
    wrapped.step(wrapped.action_space.sample())
    return env
