"""The trainings of the baselines, and tables of their results."""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import pandas as pd

from tdac_agent.episodes.sb3_file import POLICY
from tdac_agent.training.curve import CURVE_FILE, read_curve
from tdac_agent.training.hyperparameters import Algo
from tdac_agent.training.plan import make_plan, read_plan
from tdac_agent.training.policy_files import FACTS
from tdac_agent.training.train import train
from tdac_envs.drive.rewards import RewardWeights

SEEDS = (0, 1, 2)
PPO_TASKS = ("maze", "epuck", "office", "cave", "rooms", "epuck-maze")
SAC_TASKS = ("rooms", "epuck")
FOUR_MAPS = ("maze", "office", "cave", "rooms")
OTHERWISE = {"four-maps": 800_000}
"""Training steps that differ from those in the hyperparameter file."""


@dataclass(frozen=True, slots=True)
class Training:
    """A training: an algorithm, its tasks and its seed."""

    algo: Algo
    tasks: tuple[str, ...]
    seed: int
    steps: int | None = None


TRAININGS = {
    f"{algo}-{name}-{seed}": Training(algo, tasks, seed, OTHERWISE.get(name))
    for algo, sets in (
        ("ppo", {task: (task,) for task in PPO_TASKS} | {"four-maps": FOUR_MAPS}),
        ("sac", {task: (task,) for task in SAC_TASKS}),
    )
    for (name, tasks), seed in product(sets.items(), SEEDS)
}


def train_all(names: list[str], runs: Path) -> None:
    """Runs the trainings, and resumes interrupted ones."""
    for name in names:
        item = TRAININGS[name]
        print(name, flush=True)
        plan = make_plan(item.tasks, item.algo, seed=item.seed, steps=item.steps)
        train(plan, runs / name)


def trained(runs: Path) -> dict[str, Path]:
    """The policy files of the finished trainings in a folder."""
    return {name: runs / name / POLICY for name in TRAININGS if finished(runs / name)}


def finished(folder: Path) -> bool:
    """Whether the training in a folder has run to its end."""
    curve = read_curve(folder)
    return bool(curve) and curve[-1].steps >= read_plan(folder).steps


def _begun(runs: Path) -> list[str]:
    """The trainings in a folder that have been evaluated at least once."""
    return [name for name in TRAININGS if (runs / name / FACTS).is_file()]


def curve_table(runs: Path) -> pd.DataFrame:
    """All learning curves, with a row for each evaluation."""
    curves = []
    for name in _begun(runs):
        curve = pd.read_csv(runs / name / CURVE_FILE)
        curve.insert(0, "training", name)
        curves.append(curve)
    return pd.concat(curves) if curves else pd.DataFrame()


def training_table(runs: Path) -> pd.DataFrame:
    """A row for each training, finished or not."""
    return pd.DataFrame([_row(name, runs / name) for name in _begun(runs)])


def _row(name: str, folder: Path) -> dict[str, Any]:
    plan, best = read_plan(folder), json.loads((folder / FACTS).read_text())
    last = pd.read_csv(folder / CURVE_FILE).iloc[-1]
    found = best["evaluation"]
    weights = plan.env_kwargs.get("reward_weights", {})
    return {
        "training": name,
        "algo": plan.algo,
        "task": " ".join(plan.tasks),
        "seed": plan.seed,
        "starts": plan.env_kwargs.get("variation", plan.variation),
        "contact": weights.get("collision", RewardWeights().collision),
        "steps_planned": plan.steps,
        "steps": int(last.steps),
        "seconds": last.seconds,
        "best_steps": found["steps"],
        "best_seconds": found["seconds"],
        "success_rate": found["success_rate"],
        "collision_rate": found["collision_rate"],
        "last_success_rate": last.success_rate,
        "last_collision_rate": last.collision_rate,
        "episodes": plan.episodes,
    }
