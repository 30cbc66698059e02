"""Measures steps/s of PPO, end to end, on our environments and on CartPole-v1.

    python -m benchmarks.training_speed [--steps N] [--rounds N]

It uses the hyperparameters of `tdac train` for maps, and the defaults of
stable-baselines3 (ten epochs in batches of 64). The cases run in turns, and the best
round of each counts. The environments' share is the time within the batch's `step` and
`reset`, as called by PPO.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecEnvWrapper

from tdac_agent.training.hyperparameters import model_arguments
from tdac_agent.training.plan import make_batch, make_plan

DICT = ("goal-relative", "guidance")


@dataclass(frozen=True, slots=True, order=True)
class Speed:
    """Speed of one training.

    Attributes:
        steps_per_second: Steps per second, end to end.
        share: Fraction of the wall time spent in the environments.
    """

    steps_per_second: float
    share: float


class Timed(VecEnvWrapper):
    """Adds up the seconds of `step` and `reset`."""

    def __init__(self, envs: Any) -> None:
        super().__init__(envs)
        self.seconds = 0.0

    def reset(self) -> Any:
        return self._timed(self.venv.reset)

    def step_async(self, actions: Any) -> None:
        self._timed(lambda: self.venv.step_async(actions))

    def step_wait(self) -> Any:
        return self._timed(self.venv.step_wait)

    def _timed(self, call: Callable[[], Any]) -> Any:
        began = time.perf_counter()
        found = call()
        self.seconds += time.perf_counter() - began
        return found


@dataclass(frozen=True, slots=True)
class Case:
    """A training to time.

    Attributes:
        env: Name of the environment.
        make: Makes a batch.
        policy: Policy class of stable-baselines3.
        ours: Whether the hyperparameters are those of `tdac train`.
    """

    env: str
    make: Callable[[], Any]
    policy: str = "MlpPolicy"
    ours: bool = True


def speed(case: Case, steps: int) -> Speed:
    """Measures a training after one warm-up rollout."""
    envs = case.make()
    timed = Timed(envs)
    ours = model_arguments(make_plan(("maze",)).hyperparameters)
    arguments = ours if case.ours else {"n_steps": ours["n_steps"]}
    model = PPO(case.policy, timed, device="cpu", **arguments)
    model.learn(model.n_steps * envs.num_envs)
    before, began = timed.seconds, time.perf_counter()
    model.learn(steps)
    took = time.perf_counter() - began
    envs.close()
    return Speed(model.num_timesteps / took, (timed.seconds - before) / took)


def of_task(name: str, wrappers: tuple[str, ...] | None = None) -> Callable[[], Any]:
    """A factory of the batch on which `tdac train` trains."""
    plan = make_plan((name,), wrappers=wrappers)
    return lambda: make_batch(plan, plan.n_envs, training=True)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.training_speed")
    parser.add_argument("--steps", type=int, default=65_536)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    torch.set_num_threads(1)
    count = make_plan(("maze",)).n_envs
    several = "MultiInputPolicy"
    cases = [
        Case("CartPole-v1", lambda: make_vec_env("CartPole-v1", count)),
        Case("maze", of_task("maze")),
        Case("epuck", of_task("epuck")),
        Case("maze", of_task("maze", DICT), several),
        Case("epuck", of_task("epuck", DICT), several),
        Case("maze", of_task("maze", DICT), several, ours=False),
        Case("epuck", of_task("epuck", DICT), several, ours=False),
    ]
    best = [Speed(0.0, 0.0)] * len(cases)
    for _ in range(options.rounds):
        for number, case in enumerate(cases):
            best[number] = max(best[number], speed(case, options.steps))
    for case, found in zip(cases, best, strict=True):
        print(
            f"{case.env:<12} {case.policy:<17} {'tdac' if case.ours else 'SB3':<5}"
            f"{found.steps_per_second:>8,.0f} steps/s  "
            f"{found.steps_per_second / best[0].steps_per_second:.2f} x CartPole-v1  "
            f"environments {found.share:.0%} of the time"
        )


if __name__ == "__main__":
    main()
