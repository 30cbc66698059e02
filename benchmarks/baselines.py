"""Trains and evaluates the baselines, and collects results in results/baselines.

    python -m benchmarks.baselines [STAGE …] [--only ppo-maze-0 …] [--runs DIR]

Stages: `train`; `evaluate`: all policies on the same episodes; `generalise`: learned
policies on other maps and worlds; `collect`: tables and figures of the results. All of
them run by default. Each item has a separate folder in --runs: the command resumes
interrupted items and skips finished ones.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import pandas as pd

from benchmarks import baseline_evaluation as evaluation
from benchmarks import baseline_generalisation as generalisation
from benchmarks import baseline_trainings as trainings
from tdac_agent.plots import baselines as plots
from tdac_agent.plots import save_figure
from tdac_agent.storage.files import write_atomic

RESULTS = Path(__file__).parent.parent / "results" / "baselines"
STAGES = ("train", "evaluate", "generalise", "collect")


def main() -> int:
    """Returns the exit code."""
    options = _options()
    names = options.only or list(trainings.TRAININGS)
    stages: dict[str, Callable[[], object]] = {
        "train": lambda: trainings.train_all(names, options.runs),
        "evaluate": lambda: evaluation.evaluate_all(names, options.runs),
        "generalise": lambda: generalisation.drive_all(names, options.runs),
        "collect": lambda: collect(options.runs),
    }
    for stage in options.stages or STAGES:
        stages[stage]()
    return 0


def collect(runs: Path) -> None:
    """Writes tables and figures of the results in a folder of trainings."""
    tables = {
        "trainings": trainings.training_table(runs),
        "curves": trainings.curve_table(runs),
        "evaluation": evaluation.table(runs),
        "generalisation": generalisation.table(runs),
    }
    RESULTS.mkdir(parents=True, exist_ok=True)
    for name, table in tables.items():
        if not table.empty:
            write_atomic(RESULTS / f"{name}.csv", table.to_csv(index=False))
    draw(RESULTS)


def draw(results: Path) -> None:
    """Draws the figures from the tables."""
    found = {file.stem: pd.read_csv(file) for file in sorted(results.glob("*.csv"))}
    if {"curves", "trainings"} <= found.keys():
        curves = found["curves"].merge(
            found["trainings"][["training", "algo", "task", "seed"]], on="training"
        )
        save_figure(plots.plot_learning_curves(curves), results / "curves.svg")
    if "evaluation" in found:
        figure = plots.plot_success_by_policy(found["evaluation"])
        save_figure(figure, results / "evaluation.svg")
    if "generalisation" in found:
        figure = plots.plot_generalisation(found["generalisation"])
        save_figure(figure, results / "generalisation.svg")


def _options() -> argparse.Namespace:
    about = (__doc__ or "").partition("\n")[0]
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.baselines", description=about
    )
    parser.add_argument("stages", nargs="*", metavar="STAGE", help=", ".join(STAGES))
    parser.add_argument(
        "--only", nargs="+", choices=trainings.TRAININGS, metavar="NAME"
    )
    parser.add_argument("--runs", type=Path, default=Path("runs") / "baselines")
    options = parser.parse_args()
    wrong = [stage for stage in options.stages if stage not in STAGES]
    if wrong:
        parser.error(f"no stage {wrong[0]!r}; the stages are {', '.join(STAGES)}")
    return options


if __name__ == "__main__":
    sys.exit(main())
