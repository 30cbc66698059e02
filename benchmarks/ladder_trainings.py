"""Trains the learned entrants of `results/ladder` (`make results-rl`).

    python -m benchmarks.ladder_trainings OUT [NAME...] [--keep results/ladder/learned]

NAME is `ALGO-LEVEL-SEED`, by default all of them, in the order of `TRAININGS`: PPO with
five seeds on `known`, `unknown` and `crowd`, RecurrentPPO with five on `unknown`,
`lost` and `moving`, one seed of PPO on the other levels, and one of PPO with a view of
the map (`ppo-with-map`) on `known`. OUT has a folder for each;
finished ones are left as they are, and an interrupted one goes on from its last
evaluation. `--keep` copies policies, facts and learning curves of the finished ones to
a folder that is small enough to be kept.
"""

from __future__ import annotations

import argparse
import multiprocessing
import shutil
import sys
from pathlib import Path
from typing import cast

from benchmarks.baseline_trainings import finished
from tdac_agent.episodes.sb3_file import POLICY
from tdac_agent.training.curve import CURVE_FILE, PLAN_FILE
from tdac_agent.training.hyperparameters import Algo
from tdac_agent.training.plan import TrainingPlan
from tdac_agent.training.policy_files import FACTS
from tdac_agent.training.set_plan import make_set_plan
from tdac_agent.training.train import train

SEEDS = range(5)
WITH_MAP = "ppo-with-map"
"""PPO with the view of the map, which it does not have by default."""
TRAININGS = [
    *(
        ("ppo", level, seed)
        for seed in SEEDS
        for level in ("unknown", "known", "crowd")
    ),
    *(
        ("recurrent-ppo", level, seed)
        for seed in SEEDS
        for level in ("unknown", "lost", "moving")
    ),
    *(("ppo", level, 0) for level in ("lost", "moving", "epuck")),
    (WITH_MAP, "known", 0),
]
"""Algorithm, level and seed."""
NAMES = {"-".join(map(str, each)): each for each in TRAININGS}
KEPT = POLICY, FACTS, PLAN_FILE, CURVE_FILE


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ladder_trainings")
    parser.add_argument("out", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    # A process for each, since its thousands of worlds take gigabytes.
    processes = multiprocessing.get_context("spawn")
    for name in options.names or NAMES:
        arguments = name, options.out / name, options.keep
        process = processes.Process(target=train_one, args=arguments)
        process.start()
        process.join()
        if process.exitcode != 0:
            sys.exit(f"{name} ended with exit code {process.exitcode}")


def plan_of(algo: str, level: str, seed: int) -> TrainingPlan:
    """The plan of a training in `TRAININGS`."""
    if algo == WITH_MAP:
        seen = "goal-relative", "closeness", "map-view", "flatten"
        return make_set_plan(level, "ppo", seed=seed, wrappers=seen)
    return make_set_plan(level, cast(Algo, algo), seed=seed)


def train_one(name: str, folder: Path, keep: Path | None) -> None:
    """Runs a training, or what is left of it, and keeps what came out."""
    algo, level, seed = NAMES[name]
    points = train(plan_of(algo, level, seed), folder)
    best = max(points, key=lambda point: point.worth)
    print(name, f"{best.steps} steps, reached {best.success_rate:.2f}", flush=True)
    if keep is not None and finished(folder):
        (keep / name).mkdir(parents=True, exist_ok=True)
        for file in KEPT:
            shutil.copyfile(folder / file, keep / name / file)


if __name__ == "__main__":
    main()
