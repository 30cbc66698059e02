"""Whether a counterexample pays as feedback: results/counterexample, see its PLAN.md.

    python -m benchmarks.counterexample_trial plan
    python -m benchmarks.counterexample_trial run RUNS --questions DIR [GROUP …]
    python -m benchmarks.counterexample_trial judge RUNS OUT --salts DIR
    python -m benchmarks.counterexample_trial tables OUT

`run` performs the pairs in their order, with `tdac synth --learner manual:DIR/GROUP`: a
question is written to a file, and the run waits for the file with the answer. Both arms
of a pair have the same folder, so that equal questions, and so the first four, have the
same answer. `judge` drives what each run delivered on hidden worlds, whose salt is
DIR/LEVEL (OUT/scores.csv); `tables` needs this file alone. After an interruption, the
same command continues.
"""

from __future__ import annotations

import argparse
import csv
import functools
import itertools
import json
import math
import sys
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from benchmarks.feedback_tables import holm, sign_flip_p, t_interval
from benchmarks.feedback_trial import (
    CALLS,
    OUT_WEIGHT,
    RACE_FIRST,
    RACE_POOL,
    characters,
    episodes_for,
    has_ended,
)
from benchmarks.recorded_answers import driven_on, episodes_in
from tdac_agent import synthesize
from tdac_agent.evaluation.policies import entrant_of, fitted
from tdac_agent.falsify.falsify import SearchPlan, falsify
from tdac_agent.runs.falsification import read_falsification
from tdac_agent.storage.files import write_atomic
from tdac_agent.synthesis.counterexample import FOLDER
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.ladder.task_sets import load_set

SEED = 20261130
"""Seed of all draws of the plan."""
PAIRS = {"lost": 4, "floor": 4}
WITH, WITHOUT = ARMS = "with", "without"
ENVELOPE = 64
"""Most episodes of each search of the arm `with`, in two worlds of the pool."""
WORLDS = 100
"""Hidden worlds on which a delivered controller drives."""
FAR = SearchPlan(episodes=128, split="test", worlds=2)
"""The search that measures how far a delivered controller carries."""
SCORES = "scores.csv"
OUTCOME, SHARE, NORM = "time_score", "success", "norm"


@dataclass(frozen=True, slots=True)
class Cell:
    """A run of the plan.

    Attributes:
        name: Its name, and that of its folder.
        group: Cells of a group are a pair, and share their answers.
        level: Its task set.
        arm: Its arm.
        seed: Seed of its worlds of `dev`.
    """

    name: str
    group: str
    level: str
    arm: str
    seed: int


@functools.cache
def planned() -> tuple[Cell, ...]:
    """All cells, in the order in which they are performed."""
    random = np.random.default_rng(SEED)
    groups = []
    for level, count in PAIRS.items():
        for number in range(1, count + 1):
            group, seed = f"{level}-{number}", int(random.integers(2**31))
            arms = list(ARMS)
            random.shuffle(arms)
            names = [f"{group}-{arm}" for arm in arms]
            groups.append(
                [
                    Cell(name, group, level, arm, seed)
                    for name, arm in zip(names, arms, strict=True)
                ]
            )
    random.shuffle(groups)
    return tuple(itertools.chain(*groups))


def options_of(cell: Cell) -> dict[str, Any]:
    """The options of `synthesize` for a cell: the arms differ in `envelope` alone."""
    return {
        "seed": cell.seed,
        "search": "race",
        "candidates": RACE_FIRST,
        "iterations": CALLS,
        "episodes": episodes_for(RACE_POOL, CALLS),
        "envelope": ENVELOPE if cell.arm == WITH else 0,
    }


def perform(cell: Cell, out: Path, questions: Path) -> None:
    """Performs a cell, unless it has ended."""
    if has_ended(out / cell.name):
        return
    asked = questions / cell.group
    asked.mkdir(parents=True, exist_ok=True)
    limit = {"out": out / cell.name, "max_tokens": 100_000_000}
    learner = f"manual:{asked}"
    synthesize(load_set(cell.level), learner, **limit, **options_of(cell))
    print(json.dumps({"cell": cell.name}), flush=True)


def judge(runs: Path, out: Path, salts: Path) -> None:
    """Drives what was delivered on hidden worlds, and searches for its failures."""
    out.mkdir(parents=True, exist_ok=True)
    rows = []
    with WarmJudge() as warm:
        for cell in planned():
            folder = runs / cell.name
            assert has_ended(folder), f"{cell.name} has not ended"
            asked, answered = characters(folder)
            searches = len(list(folder.glob(f"iterations/*/*/{FOLDER}/falsify.json")))
            row = {**asdict(cell), "asked": asked, "answered": answered}
            row |= {"cost": asked + OUT_WEIGHT * answered, "searches": searches}
            rows.append(row | _outcomes(cell, folder, out, salts, warm))
            write_atomic(out / SCORES, pd.DataFrame(rows).to_csv(index=False))


def _outcomes(
    cell: Cell, folder: Path, out: Path, salts: Path, warm: WarmJudge
) -> dict[str, float]:
    """Outcomes of a cell; 0 if nothing was delivered."""
    file = folder / "controller.py"
    if not file.is_file():
        return {OUTCOME: 0.0, SHARE: 0.0, NORM: 0.0}
    kept, source = out / "hidden" / cell.name, file.read_text("utf-8")
    driven_on(source, cell.level, WORLDS, salts / cell.level, kept, warm)
    driven = episodes_in(kept)
    tasks = load_set(cell.level)
    entrant = fitted(entrant_of(str(file)), tasks)
    searched = out / "far" / cell.name
    found = read_falsification(searched)
    if found is None or (found.policy_sha256, found.budget) != (
        entrant.sha256,
        FAR.episodes,
    ):
        found = falsify(entrant, tasks, FAR, out=searched, judge=warm)
    failed = found.counterexample
    return {
        OUTCOME: float(driven["time_score"].mean()),
        SHARE: float((driven["outcome"] == "reached").mean()),
        NORM: math.inf if failed is None else failed.norm,
    }


def tables(scores: pd.DataFrame) -> dict[str, Any]:
    """The outcomes, `with` minus `without`.

    The primary one is the mean time score. Holm is over the other two. Norms without a
    failure are larger than all others, so that they are compared by their order alone.
    """
    found: dict[str, Any] = {"pairs": len(scores) // len(ARMS)}
    wide = scores.set_index(["group", "arm"])
    one, other = (wide.xs(arm, level="arm") for arm in ARMS)
    for name in (OUTCOME, SHARE):
        change = (one[name] - other[name]).tolist()
        low, high = t_interval(change)
        mean, p = float(np.mean(change)), sign_flip_p(change)
        found[name] = {"mean": mean, "low": low, "high": high, "p": p}
        found[name]["not_0"] = sum(each != 0.0 for each in change)
    larger, smaller = int((one[NORM] > other[NORM]).sum()), (one[NORM] < other[NORM])
    decided = larger + int(smaller.sum())
    p = stats.binomtest(larger, decided).pvalue if decided else 1.0
    found[NORM] = {"larger": larger, "of": decided, "p": float(p)}
    adjusted = holm([found[SHARE]["p"], found[NORM]["p"]])
    for name, value in zip((SHARE, NORM), adjusted, strict=True):
        found[name]["holm"] = value
    found["cost"] = {
        arm: float(scores[scores["arm"] == arm]["cost"].sum()) for arm in ARMS
    }
    return found


def main() -> None:
    """Prints the plan, performs it, or makes its tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("plan")
    command = commands.add_parser("run")
    command.add_argument("runs", type=Path)
    command.add_argument("groups", nargs="*", help="pairs; all by default")
    command.add_argument("--questions", type=Path, required=True)
    command = commands.add_parser("judge")
    command.add_argument("runs", type=Path)
    command.add_argument("out", type=Path)
    command.add_argument("--salts", type=Path, required=True)
    commands.add_parser("tables").add_argument("out", type=Path)
    options = parser.parse_args()
    if options.command == "plan":
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(field.name for field in fields(Cell))
        writer.writerows(asdict(cell).values() for cell in planned())
    elif options.command == "run":
        unknown = set(options.groups) - {cell.group for cell in planned()}
        if unknown:
            parser.error(f"no such pair: {', '.join(sorted(unknown))}")
        for cell in planned():
            if not options.groups or cell.group in options.groups:
                perform(cell, options.runs, options.questions)
    elif options.command == "judge":
        judge(options.runs, options.out, options.salts)
    else:
        print(json.dumps(tables(pd.read_csv(options.out / SCORES)), indent=2))


if __name__ == "__main__":
    main()
