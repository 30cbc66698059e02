"""Trains the learned entrants of `results/ladder` (`make results-rl`).

    python -m benchmarks.ladder_trainings OUT [NAME...] [--keep results/ladder/learned]
        [--jobs N]

NAME is `KIND-LEVEL-STEPS-SEED`, such as `ppo-planner-unknown-10M-0`; by default all of
`TRAININGS`, in their order, as many at a time as there are cores. A kind is what
learns and what it uses (`tdac train --algo`, `--uses`); the settings are those of
`tdac train --set`. OUT has a folder for each; finished ones are left as they are, and
an interrupted one goes on from its last evaluation. `--keep` copies policies, facts and
learning curves of the finished ones to a folder that is small enough to be kept.
"""

from __future__ import annotations

import argparse
import itertools
import multiprocessing
import shutil
import sys
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from benchmarks.baseline_trainings import finished
from tdac_agent.episodes.sb3_file import POLICY
from tdac_agent.training.curve import CURVE_FILE, PLAN_FILE
from tdac_agent.training.hyperparameters import Algo
from tdac_agent.training.plan import TrainingPlan
from tdac_agent.training.policy_files import FACTS, LAST
from tdac_agent.training.set_plan import Uses, make_set_plan
from tdac_agent.training.train import train
from tdac_envs.core.slices import available_cores

KINDS: dict[str, tuple[Algo, Uses]] = {
    "ppo": ("ppo", "rays"),
    "ppo-planner": ("ppo", "planner"),
    "ppo-memory": ("ppo", "memory"),
    "recurrent-ppo": ("recurrent-ppo", "rays"),
}
"""Algorithm, and what the policy uses, by name."""
STEPS = {"2M": 2_000_000, "10M": 10_000_000, "50M": 50_000_000}
HEADLINE, OTHERS = ("unknown", "floor"), ("lost", "known", "moving", "crowd")


def _each(
    steps: str, seeds: range, levels: tuple[str, ...], kinds: Iterable[str]
) -> list[tuple[str, str, str, int]]:
    """Trainings of a budget: all of one seed before those of the next."""
    drawn = itertools.product(seeds, levels, kinds)
    return [(kind, level, steps, seed) for seed, level, kind in drawn]


TRAININGS = [
    # Three seeds of everything first, so that each stop leaves something to compare.
    *_each("2M", range(3), HEADLINE + OTHERS, KINDS),
    *_each("10M", range(3), HEADLINE, ("ppo", "ppo-planner", "ppo-memory")),
    *_each("2M", range(3), ("epuck",), ("ppo", "recurrent-ppo")),
    *_each("2M", range(3, 5), HEADLINE + OTHERS, KINDS),
    *_each("10M", range(3, 5), HEADLINE, ("ppo", "ppo-planner", "ppo-memory")),
    *_each("10M", range(5), HEADLINE, ("recurrent-ppo",)),
    *_each("10M", range(5), OTHERS, KINDS),
    *_each("2M", range(3, 5), ("epuck",), ("ppo", "recurrent-ppo")),
    *_each("10M", range(5), ("epuck",), ("ppo", "recurrent-ppo")),
    *_each("10M", range(5, 10), HEADLINE, KINDS),
    *_each("50M", range(5), HEADLINE, ("ppo", "ppo-planner")),
]
"""Kind, level, steps and seed."""
NAMES = {"-".join(map(str, each)): each for each in TRAININGS}
KEPT = POLICY, LAST, FACTS, PLAN_FILE, CURVE_FILE


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ladder_trainings")
    parser.add_argument("out", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--jobs", type=int, default=available_cores())
    options = parser.parse_args()
    names = options.names or list(NAMES)
    if wrong := [name for name in names if name not in NAMES]:
        parser.error(f"no training {wrong[0]}: expected KIND-LEVEL-STEPS-SEED")
    run = partial(run_one, out=options.out, keep=options.keep)
    with ThreadPoolExecutor(options.jobs) as pool:
        failed = [name for name in pool.map(run, names) if name]
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


def run_one(name: str, out: Path, keep: Path | None) -> str:
    """Runs a training in a process of its own; returns its name if it failed."""
    # Its thousands of worlds take gigabytes.
    processes = multiprocessing.get_context("spawn")
    process = processes.Process(target=train_one, args=(name, out / name, keep))
    process.start()
    process.join()
    return "" if process.exitcode == 0 else name


def plan_of(kind: str, level: str, steps: str, seed: int) -> TrainingPlan:
    """The plan of a training in `TRAININGS`."""
    algo, uses = KINDS[kind]
    return make_set_plan(level, algo, seed=seed, uses=uses, steps=STEPS[steps])


def train_one(name: str, folder: Path, keep: Path | None) -> None:
    """Runs a training, or what is left of it, and keeps what came out."""
    points = train(plan_of(*NAMES[name]), folder, threads=1)
    best = max(points, key=lambda point: point.worth)
    print(name, f"{best.steps} steps, reached {best.success_rate:.2f}", flush=True)
    if keep is not None and finished(folder):
        (keep / name).mkdir(parents=True, exist_ok=True)
        for file in KEPT:
            shutil.copyfile(folder / file, keep / name / file)


if __name__ == "__main__":
    main()
