"""What each setting of `tdac train --set` brings: one changed at a time, three seeds.

    python -m benchmarks.recipe OUT [NAME...] [--level L] [--steps N] [--csv FILE]

NAME is a key of `CHANGES`, by default all of them. OUT has a folder for each, with the
trainings of its seeds; finished ones are left as they are, and interrupted ones go on.
The table has the share of goals reached on 200 worlds of `dev` by the most likely
actions: at the end of each training, and in the best of its evaluations.
"""

from __future__ import annotations

import argparse
import copy
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from tdac_agent.training.hyperparameters import config_file
from tdac_agent.training.seeds import train_seeds
from tdac_agent.training.set_plan import make_set_plan
from tdac_envs.ladder.env import TaskSetEnv

SEEDS, WORLDS = range(3), 200
CHANGES: dict[str, dict[str, Any]] = {
    "as it is": {},
    "begins at rest": {"initial_action": 0.0},
    "gSDE, 16 steps": {"use_sde": True, "sde_sample_freq": 16},
    "Tanh": {"policy_kwargs": {"activation_fn": "Tanh"}},
    "2 x 64 units": {"policy_kwargs": {"net_arch": [64, 64]}},
    "less noise": {"policy_kwargs": {"log_std_init": -1.5}},
    "3 epochs": {"n_epochs": 3},
    "batches of 4,096": {"batch_size": 4096},
    "target_kl 0.03": {"target_kl": 0.03},
    "no entropy bonus": {"ent_coef": 0.0},
    "a contact costs 1": {"env_kwargs": {"reward_weights": {"collision": 1.0}}},
    "a contact costs 5": {"env_kwargs": {"reward_weights": {"collision": 5.0}}},
    "own starts alone": {"env_kwargs": {"nearer_starts": 0.0}},
    "cut at 600 steps": {"env_kwargs": {"max_episode_steps": 600}},
}
"""What differs from the shipped file, by name."""


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.recipe")
    parser.add_argument("out", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--level", default="unknown")
    parser.add_argument("--steps", type=int, default=2_000_000)
    parser.add_argument("--csv", type=Path)
    options = parser.parse_args()
    rows = []
    for name in options.names or CHANGES:
        if name not in CHANGES:
            parser.error(f"no change {name!r}: expected some of {', '.join(CHANGES)}")
        rows += trained(name, options.out, options.level, options.steps)
        table = pd.DataFrame(rows)
        print(shown(table).to_string(), flush=True)
        if options.csv is not None:
            table.to_csv(options.csv, index=False)


def trained(name: str, out: Path, level: str, steps: int) -> list[dict[str, Any]]:
    """Trains with a change; a row for each seed."""
    folder = out / "".join(c if c.isalnum() else "-" for c in name)
    folder.mkdir(parents=True, exist_ok=True)
    config = folder / "ppo.yml"
    own = yaml.safe_load(config_file("ppo").read_text())[TaskSetEnv.title]
    config.write_text(yaml.safe_dump({TaskSetEnv.title: changed(own, CHANGES[name])}))
    plan = make_set_plan(level, steps=steps, episodes=WORLDS, config=config)
    curves = train_seeds(plan, SEEDS, folder, lambda *_: None)
    return [
        {
            "change": name,
            "seed": seed,
            "last": points[-1].success_rate,
            "best": max(point.success_rate for point in points),
            "hit": points[-1].collision_rate,
        }
        for seed, points in curves.items()
    ]


def changed(own: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
    """Settings with some of them replaced, also within dicts."""
    new = copy.deepcopy(own)
    for key, value in change.items():
        inner = isinstance(value, dict) and isinstance(new.get(key), dict)
        new[key] = changed(new[key], value) if inner else value
    return new


def shown(table: pd.DataFrame) -> pd.DataFrame:
    """Means over the seeds, and the lowest and highest of them."""
    groups = table.groupby("change", sort=False)
    figures = groups.agg(
        last=("last", "mean"),
        low=("last", "min"),
        high=("last", "max"),
        best=("best", "mean"),
        hit=("hit", "mean"),
    )
    return figures.round(3)


if __name__ == "__main__":
    main()
