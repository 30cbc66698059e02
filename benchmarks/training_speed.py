"""Measures steps/s of PPO, end to end, on our environments and on CartPole-v1.

    python -m benchmarks.training_speed [--steps N] [--rounds N] [--sets]

It uses the hyperparameters of `tdac train` for maps, and the defaults of
stable-baselines3 (ten epochs in batches of 64). The cases run in turns, and the best
round of each counts. The environments' share is the time within the batch's `step` and
`reset`, as called by PPO.

With `--sets`, the trainings of `tdac train --set` instead, by what the policy uses, in
steps per second of CPU time; the worlds of the pool that are drawn are made before.
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

from tdac_agent.training.hyperparameters import Algo, model_arguments
from tdac_agent.training.learning import ALGOS, POLICIES
from tdac_agent.training.plan import make_batch, make_plan
from tdac_agent.training.set_plan import Uses, make_set_batch, make_set_plan

ON_SETS: list[tuple[str, Algo, Uses]] = [
    *(("unknown", "ppo", uses) for uses in ("rays", "memory", "planner")),
    *((level, "ppo", "rays") for level in ("lost", "floor")),
    ("unknown", "recurrent-ppo", "rays"),
]
POOL = 4096
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

    def __init__(
        self, envs: Any, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        super().__init__(envs)
        self.seconds, self.clock = 0.0, clock

    def reset(self) -> Any:
        return self._timed(self.venv.reset)

    def step_async(self, actions: Any) -> None:
        self._timed(lambda: self.venv.step_async(actions))

    def step_wait(self) -> Any:
        return self._timed(self.venv.step_wait)

    def _timed(self, call: Callable[[], Any]) -> Any:
        began = self.clock()
        found = call()
        self.seconds += self.clock() - began
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
    return _measured(model, timed, steps)


def _measured(model: Any, timed: Timed, steps: int) -> Speed:
    """Measures a model after one rollout, by the clock of its environments."""
    model.learn(model.n_steps * timed.num_envs)
    before, began = timed.seconds, timed.clock()
    model.learn(steps)
    took = timed.clock() - began
    timed.close()
    return Speed(model.num_timesteps / took, (timed.seconds - before) / took)


def of_task(name: str, wrappers: tuple[str, ...] | None = None) -> Callable[[], Any]:
    """A factory of the batch on which `tdac train` trains."""
    plan = make_plan((name,), wrappers=wrappers)
    return lambda: make_batch(plan, plan.n_envs, training=True)


def set_speed(level: str, algo: Algo, uses: Uses, steps: int) -> Speed:
    """Measures a training on a set after one rollout, by CPU time."""
    plan = make_set_plan(level, algo, uses=uses)
    batch = make_set_batch(plan, threads=1)
    pool = batch.batch.batch.setups[0].source
    for index in range(POOL):
        pool.task(index)
    timed = Timed(batch, time.process_time)
    arguments = model_arguments(plan.hyperparameters)
    policy = POLICIES.get(plan.policy, plan.policy)
    model = ALGOS[algo](policy, timed, device="cpu", seed=0, **arguments)
    return _measured(model, timed, steps)


def print_sets(steps: int, rounds: int) -> None:
    """Measures and prints the trainings on sets."""
    best = dict.fromkeys(ON_SETS, Speed(0.0, 0.0))
    for _ in range(rounds):
        for case in ON_SETS:
            best[case] = max(best[case], set_speed(*case, steps))
    for (level, algo, uses), found in best.items():
        print(
            f"{level:<8} {algo:<14} {uses:<8}{found.steps_per_second:>8,.0f} steps per "
            f"CPU second, environments {found.share:.0%} of the time"
        )


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.training_speed")
    parser.add_argument("--steps", type=int, default=65_536)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--sets", action="store_true")
    options = parser.parse_args()
    torch.set_num_threads(1)
    if options.sets:
        print_sets(max(options.steps, 2 * 65_536), options.rounds)
        return
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
