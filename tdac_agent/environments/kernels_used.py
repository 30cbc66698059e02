"""Calls of the kernels that all environments share."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

import tdac_envs  # noqa: F401 - registers the environments
from tdac_agent.tasks.registry import environment
from tdac_agent.verification.suite.reference import steer
from tdac_envs.grid.plan import plan_path


def use_robot(env_id: str, **options: Any) -> Any:
    """Plans and drives as a judge does, for one step; returns the environment."""
    plan_path(np.ones((3, 3), np.bool_), (0, 0), (2, 2))  # as the oracle does
    env: Any = gym.make(env_id, variation="jitter", **options).unwrapped
    task = env.nominal
    start, goal = task.start, task.goal
    path = environment(env_id).reference_path(task, start.x, start.y)
    steer((start.x, start.y, start.heading), path[-1], 1.0, 1.0)
    env.reset(seed=0)
    env.reset(options={"start": start[:2], "goal": goal})
    env.step(env.action_space.sample())
    env.watch_gap().note()
    return env


def use_batch(env_id: str, **options: Any) -> None:
    """Drives a batch of robots for one step, as for a training."""
    from tdac_envs.learning.wrapping import wrap_for_rl

    wrapped = wrap_for_rl(gym.make_vec(env_id, 2, "vector_entry_point", **options))
    wrapped.reset(seed=0)
    wrapped.step(wrapped.action_space.sample())
