"""Steps per second of PPO, end to end, on our environments and on CartPole-v1.

    python -m benchmarks.training_speed [--steps N] [--rounds N]

The same hyperparameters for all; they take turns, and the best round of each counts.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env

from tdac_agent.training.hyperparameters import model_arguments
from tdac_agent.training.plan import make_batch, make_plan


def speed(envs: Any, steps: int) -> float:
    """Steps per second of a training that has begun already."""
    plan = make_plan(("maze",))
    model = PPO(
        "MlpPolicy", envs, device="cpu", **model_arguments(plan.hyperparameters)
    )
    per_update = model.n_steps * envs.num_envs
    model.learn(per_update)
    began = time.perf_counter()
    model.learn(steps)
    return float(model.num_timesteps / (time.perf_counter() - began))


def of_task(name: str) -> Callable[[], Any]:
    """The batch on which `tdac train` trains."""
    plan = make_plan((name,))
    return lambda: make_batch(plan, plan.n_envs)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.training_speed")
    parser.add_argument("--steps", type=int, default=65_536)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    torch.set_num_threads(1)
    count = make_plan(("maze",)).n_envs
    cases = {
        "CartPole-v1": lambda: make_vec_env("CartPole-v1", count),
        "maze": of_task("maze"),
        "epuck": of_task("epuck"),
    }
    best = dict.fromkeys(cases, 0.0)
    for _ in range(options.rounds):
        for name, make in cases.items():
            envs = make()
            best[name] = max(best[name], speed(envs, options.steps))
            envs.close()
    for name, found in best.items():
        ratio = found / best["CartPole-v1"]
        print(f"{name:<12} {found:>8,.0f} steps/s  {ratio:.2f} x CartPole-v1")


if __name__ == "__main__":
    main()
