"""Time of one step of TDAC-Map2D-v0 through `gym.make`, next to CartPole-v1.

Run `python benchmarks/env_step.py`. The envs take turns in short bursts and the best
burst of each counts, so that other work on the machine disturbs the ratio little.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Iterable
from itertools import cycle
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


def burst(env: Env, actions: Iterable[Any]) -> float:
    """Mean time of a step, us, resets included."""
    count = 0
    began = time.perf_counter()
    for action in actions:
        _, _, terminated, truncated, _ = env.step(action)
        count += 1
        if terminated or truncated:
            env.reset()
    return 1e6 * (time.perf_counter() - began) / count


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


def main() -> None:
    """Prints the times and their ratios to CartPole-v1."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=2000, help="steps a burst")
    parser.add_argument("--bursts", type=int, default=15)
    options = parser.parse_args()
    envs, scripts, best = {}, {}, {}
    for name, (arguments, drive) in CASES.items():
        envs[name] = env = gym.make(**arguments)
        env.reset(seed=0)
        scripts[name] = drive(env, 4 * options.steps)
        env.reset(seed=0)
        best[name] = math.inf
    streams = {name: cycle(script) for name, script in scripts.items()}
    for _ in range(options.bursts):
        for name, env in envs.items():
            actions = [next(streams[name]) for _ in range(options.steps)]
            best[name] = min(best[name], burst(env, actions))
    reference = best["CartPole-v1, random"]
    for name, microseconds in best.items():
        ratio = microseconds / reference
        print(f"{name:30} {microseconds:7.2f} us a step {ratio:6.2f} x CartPole-v1")


if __name__ == "__main__":
    main()
