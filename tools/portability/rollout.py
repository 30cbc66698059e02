"""Steps each environment and writes all observations and rewards to a file.

python rollout.py FILE
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import tdac_envs  # noqa: F401  (registers the environments)

STEPS = 200
ROBOTS = 3
ENVIRONMENTS: dict[str, dict[str, Any]] = {
    "TDAC-Map2D-v0": {},
    "TDAC-EPuck-v0": {"world": "maze"},
}


def main(file: Path) -> None:
    """Writes the numbers by name, for each environment, single and as a batch."""
    numbers = {}
    for name, arguments in ENVIRONMENTS.items():
        numbers[name] = alone(gym.make(name, **arguments))
        batch = gym.make_vec(name, num_envs=ROBOTS, **arguments)
        numbers[f"{ROBOTS} x {name}"] = together(batch)
    file.write_text(json.dumps(numbers))


def alone(env: gym.Env[Any, Any]) -> list[float]:
    """All observations and rewards of several episodes."""
    env.action_space.seed(1)
    observation, _ = env.reset(seed=0)
    seen = flat(observation)
    for _ in range(STEPS):
        observation, reward, terminated, truncated, _ = env.step(
            env.action_space.sample()
        )
        seen += [*flat(observation), float(reward)]
        if terminated or truncated:
            observation, _ = env.reset()
            seen += flat(observation)
    return seen


def together(envs: gym.vector.VectorEnv[Any, Any, Any]) -> list[float]:
    """All observations and rewards of a batch with autoreset."""
    envs.action_space.seed(1)
    observations, _ = envs.reset(seed=0)
    seen = flat(observations)
    for _ in range(STEPS):
        observations, rewards, *_ = envs.step(envs.action_space.sample())
        seen += [*flat(observations), *rewards.tolist()]
    return seen


def flat(observation: dict[str, Any]) -> list[float]:
    """The numbers of an observation, in the order of its keys."""
    values = (np.ravel(observation[name]) for name in sorted(observation))
    return [float(value) for value in np.concatenate(list(values))]


if __name__ == "__main__":
    main(Path(sys.argv[1]))
