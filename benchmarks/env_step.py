"""Ways of driving an environment, for benches of its step."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import tdac_envs  # noqa: F401 - registers the env

Actions = list[Any]
Env = gym.Env[Any, Any]


def random_driving(env: Env, count: int) -> Actions:
    """Uniform random actions."""
    env.action_space.seed(0)
    return [env.action_space.sample() for _ in range(count)]


def path_driving(env: Env, count: int) -> Actions:
    """Actions that drive along the shortest path, without a contact."""
    task = env.unwrapped.nominal  # type: ignore[attr-defined]
    path = task.path_from(task.start)
    env.reset(seed=0)
    actions: Actions = []
    while len(actions) < count:
        action = steer(env.unwrapped.pose(), path)  # type: ignore[attr-defined]
        actions.append(action)
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()
    return actions


def steer(pose: NDArray[np.float64], path: NDArray[np.float64]) -> Any:
    """Wheels towards the path point 12 px ahead of the nearest one."""
    x, y, heading = pose
    nearest = int(np.argmin(np.hypot(path[:, 0] - x, path[:, 1] - y)))
    to_x, to_y = path[min(nearest + 12, len(path) - 1)]
    error = math.remainder(math.atan2(to_y - y, to_x - x) - heading, 2 * math.pi)
    turn = max(-1.0, min(1.0, 2.0 * error))
    ahead = max(0.0, 1.0 - 1.5 * abs(error))
    return np.clip([ahead + turn, ahead - turn], -1, 1).astype(np.float32)


def wall_driving(_: Env, count: int) -> Actions:
    """Full speed into whatever is there."""
    return [np.ones(2, np.float32)] * count


Drive = Callable[[Env, int], Actions]
CASES: dict[str, tuple[dict[str, Any], Drive]] = {
    "CartPole-v1, random": ({"id": "CartPole-v1"}, random_driving),
    "maze, random": ({"id": "TDAC-Map2D-v0"}, random_driving),
    "maze, along the path": ({"id": "TDAC-Map2D-v0"}, path_driving),
    "maze, pressed against a wall": (
        {"id": "TDAC-Map2D-v0", "on_collision": "block"},
        wall_driving,
    ),
}
