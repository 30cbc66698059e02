"""`tdac warm`: compiles everything ahead, for this user or for all of a machine."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from rich.console import Console
from rich.markup import escape

import tdac_envs
from tdac_agent.privileged.controllers import reference_way
from tdac_agent.reference import steer
from tdac_agent.surroundings_epuck import world_surroundings
from tdac_envs import rays
from tdac_envs.code_cache import cache_folder
from tdac_envs.epuck import infrared, kernels
from tdac_envs.wrapped_vector import WrappedVectorEnv


def run() -> int:
    """Compiles what is not compiled yet; 3 where it cannot be kept."""
    use_every_kernel()
    folder = cache_folder()
    if folder is not None:
        told = f"compiled code lies ready in {escape(str(folder))}"
        Console(emoji=False).print(told, highlight=False, soft_wrap=True)
    return 3 if folder is None else 0


def use_every_kernel() -> None:
    """Calls each kernel, by what calls it in use, on a small map and a small world."""
    image = np.full((60, 90), 255, np.uint8)
    image[25:35, 30:] = 0
    start, goal, radius = (12.0, 12.0), (80.0, 50.0), 5.0
    grid, _ = tdac_envs.preprocess(image, start, goal, radius, preset="paper")
    ends = {"start": start, "goal": goal, "robot_radius": radius}
    disc = _use("TDAC-Map2D-v0", map=grid.cells, **ends)
    rays.sees(disc.nominal.terrain.leaps, 12.0, 12.0, 80.0, 50.0)
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
