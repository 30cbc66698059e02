"""Calls of the kernels that all environments share."""

from __future__ import annotations

from typing import Any

import gymnasium as gym

import tdac_envs  # noqa: F401 - registers the environments
from tdac_agent.tasks.registry import environment
from tdac_agent.verification.suite.reference import steer
from tdac_envs.learning.wrapping import wrap_for_rl


def use_robot(env_id: str, **options: Any) -> Any:
    """Drives a robot, the reference and a batch one step; returns the environment."""
    env: Any = gym.make(env_id, variation="jitter", **options).unwrapped
    env.reset(seed=0)
    env.step(env.action_space.sample())
    task = env.nominal
    start, goal = task.start, task.goal
    path = environment(env_id).reference_path(task, start.x, start.y)
    steer((start.x, start.y, start.heading), path[-1], 1.0, 1.0)
    env.reset(options={"start": start[:2], "goal": goal})
    batch = gym.make_vec(env_id, 2, "vector_entry_point", **options)
    wrapped = wrap_for_rl(batch)
    wrapped.reset(seed=0)
    wrapped.step(wrapped.action_space.sample())
    return env
