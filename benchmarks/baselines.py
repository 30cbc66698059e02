"""Trains the baselines, and collects what came of them in results/baselines.

    python -m benchmarks.baselines [--only ppo-maze-0 …] [--runs DIR] [--collect]

Each training has a folder of its own in --runs. Started again, the command goes on with
what was interrupted and leaves what is finished; `--collect` trains nothing.
"""

from __future__ import annotations

import argparse
import json
import sys
from itertools import product
from pathlib import Path
from typing import Any

import pandas as pd

from tdac_agent.files import write_atomic
from tdac_agent.training.curve import CURVE_FILE
from tdac_agent.training.plan import make_plan, read_plan
from tdac_agent.training.policy_files import FACTS
from tdac_agent.training.train import train

RESULTS = Path(__file__).parent.parent / "results" / "baselines"
SEEDS = (0, 1, 2)
PPO_TASKS = ("maze", "epuck", "office", "cave", "rooms", "epuck-maze")
SAC_TASKS = ("maze", "epuck")
TRAININGS = {
    f"{algo}-{task}-{seed}": (algo, task, seed)
    for algo, tasks in (("ppo", PPO_TASKS), ("sac", SAC_TASKS))
    for task, seed in product(tasks, SEEDS)
}


def main() -> int:
    """Returns the exit code."""
    options = _options()
    for name in () if options.collect else options.only or TRAININGS:
        algo, task, seed = TRAININGS[name]
        print(name, flush=True)
        train(make_plan((task,), algo, seed=seed), options.runs / name)
    collect(options.runs)
    return 0


def collect(runs: Path) -> None:
    """Writes `curves.csv` and `trainings.csv` of what is in a folder of trainings."""
    curves, rows = [], []
    for name in TRAININGS:
        folder = runs / name
        if not (folder / FACTS).is_file():
            continue
        curve = pd.read_csv(folder / CURVE_FILE)
        curve.insert(0, "training", name)
        curves.append(curve)
        rows.append(_row(name, folder, curve))
    if not rows:
        return
    RESULTS.mkdir(parents=True, exist_ok=True)
    write_atomic(RESULTS / "curves.csv", pd.concat(curves).to_csv(index=False))
    write_atomic(RESULTS / "trainings.csv", pd.DataFrame(rows).to_csv(index=False))


def _row(name: str, folder: Path, curve: pd.DataFrame) -> dict[str, Any]:
    plan, best = read_plan(folder), json.loads((folder / FACTS).read_text())
    last = curve.iloc[-1]
    found = best["evaluation"]
    return {
        "training": name,
        "algo": plan.algo,
        "task": plan.tasks[0],
        "seed": plan.seed,
        "steps_planned": plan.steps,
        "steps": int(last.steps),
        "seconds": last.seconds,
        "best_steps": found["steps"],
        "best_seconds": found["seconds"],
        "success_rate": found["success_rate"],
        "collision_rate": found["collision_rate"],
        "episodes": plan.episodes,
    }


def _options() -> argparse.Namespace:
    about = (__doc__ or "").partition("\n")[0]
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.baselines", description=about
    )
    parser.add_argument("--only", nargs="+", choices=TRAININGS, metavar="NAME")
    parser.add_argument("--runs", type=Path, default=Path("runs") / "baselines")
    parser.add_argument("--collect", action="store_true", help="train nothing")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
