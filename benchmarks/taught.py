"""A policy that a program teaches (DAgger), for `tdac train --from`.

    python -m benchmarks.taught OUT [--level unknown] [--uses memory] [--rounds 8]
        [--steps 20000] [--seed 0]

The student is the network of `tdac train --set LEVEL --uses USES`. In each round it
drives on worlds of `train`, in the first one together with its teacher, and the teacher
says what it would have done at each step (Ross, Gordon and Bagnell 2011). The student
is then fitted to all that was said so far. The teacher is the level's own controller,
`builtin`, which observes the same; it runs in the sandbox. OUT gets `policy.zip`, and
`rounds.csv` with the share of goals reached on 100 worlds of `dev` after each round.
Then: `tdac train --set LEVEL --uses USES --from OUT/policy.zip`.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3 import PPO

from tdac_agent.builtin.level import controller_of
from tdac_agent.episodes.episode import as_wheels
from tdac_agent.sandbox import Child, ControllerFault, start
from tdac_agent.training.hyperparameters import model_arguments
from tdac_agent.training.learning import evaluate_on_worlds
from tdac_agent.training.policy_files import write_policy
from tdac_agent.training.set_plan import make_set_batch, make_set_plan, make_trials
from tdac_agent.verification.judge.set_files import write_files
from tdac_envs import load_set
from tdac_envs.ladder.env import make
from tdac_envs.learning.wrapping import wrap_for_rl

WORLDS = 100
EPOCHS, BATCH, RATE = 12, 512, 1e-3
MIXED = 1
"""Rounds in which the teacher drives half of the steps."""


class Tap(gym.ObservationWrapper):  # type: ignore[type-arg]
    """Keeps the observation that wrappers get, and counts the steps of the episode."""

    seen: Any
    steps = 0

    def observation(self, observation: Any) -> Any:
        self.seen = observation
        return observation


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.taught")
    parser.add_argument("out", type=Path)
    parser.add_argument("--level", default="unknown")
    parser.add_argument("--uses", default="memory")
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument("--steps", type=int, default=20_000, help="of each round")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    torch.set_num_threads(1)
    plan = make_set_plan(options.level, uses=options.uses, seed=options.seed)
    batch = make_set_batch(plan.model_copy(update={"n_envs": 1}))
    arguments = model_arguments(plan.hyperparameters)
    model: Any = PPO(plan.policy, batch, seed=plan.seed, device="cpu", **arguments)
    trials = make_trials(plan)
    options.out.mkdir(parents=True, exist_ok=True)
    seen: list[Any] = []
    said: list[Any] = []
    rows = []
    for number in range(options.rounds):
        drawn = np.random.default_rng([plan.seed, number])
        share = 1.0 if number == 0 else 0.5 if number <= MIXED else 0.0
        for observation, action in lesson(model, plan, options, share, drawn):
            seen.append(observation)
            said.append(action)
        loss = fit(model, np.array(seen), np.array(said), drawn)
        point = evaluate_on_worlds(model, trials, WORLDS)
        rows.append((number, len(seen), round(loss, 5), point.success_rate))
        print(*rows[-1], flush=True)
        write_policy(model, options.out / "policy.zip", plan, len(seen))
    with (options.out / "rounds.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("round", "steps", "loss", "reached"))
        writer.writerows(rows)


def lesson(
    model: Any, plan: Any, options: Any, share: float, drawn: np.random.Generator
) -> Iterator[tuple[Any, Any]]:
    """What the student observed in a round, and what its teacher would have done.

    Args:
        model: The student.
        plan: Its plan.
        options: Options of the command.
        share: Share of the steps that the teacher drives.
        drawn: Random number generator.
    """
    tapped = Tap(make(options.level, split="train"))
    env = wrap_for_rl(tapped, plan.wrappers)
    source = controller_of(load_set(options.level), "no teacher").read_bytes()
    done = 0
    while done < options.steps:
        observation, _ = env.reset(seed=int(drawn.integers(2**31)))
        with tempfile.TemporaryDirectory() as name:
            inner: Any = tapped.unwrapped
            write_files(Path(name), inner.set.file, inner.task)
            child = start(Path(name), source)
            try:
                yield from _taught(model, env, tapped, child, observation, share, drawn)
            except ControllerFault as fault:
                print(f"  the teacher failed: {fault}", flush=True)
            finally:
                child.close()
        done += tapped.steps


def _taught(
    model: Any,
    env: Any,
    tapped: Any,
    child: Child,
    observation: Any,
    share: float,
    drawn: np.random.Generator,
) -> Iterator[tuple[Any, Any]]:
    child.load()
    child.reset(tapped.seen)
    over, tapped.steps = False, 0
    while not over:
        told = as_wheels(child.policy(tapped.seen))
        assert told is not None
        told = np.clip(told, -1.0, 1.0)
        yield observation, told
        own, _ = model.predict(observation, deterministic=True)
        action = told if drawn.random() < share else own
        observation, _, terminated, truncated, _ = env.step(action)
        tapped.steps += 1
        over = terminated or truncated


def fit(model: Any, seen: Any, said: Any, drawn: np.random.Generator) -> float:
    """Fits the mean action of the student to its teacher's; returns the last loss."""
    policy = model.policy
    policy.set_training_mode(True)
    optimiser = torch.optim.Adam(policy.parameters(), lr=RATE)
    inputs, targets = torch.as_tensor(seen), torch.as_tensor(said)
    loss = torch.zeros(())
    for _ in range(EPOCHS):
        order = torch.as_tensor(drawn.permutation(len(inputs)))
        for rows in order.split(BATCH):
            mean = policy.get_distribution(inputs[rows]).distribution.mean
            loss = torch.nn.functional.mse_loss(mean, targets[rows])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
    policy.set_training_mode(False)
    return float(loss.detach())


if __name__ == "__main__":
    main()
