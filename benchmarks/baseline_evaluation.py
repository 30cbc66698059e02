"""Runs all policies on the same episodes of each task with `tdac evaluate`'s judge."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks.baseline_trainings import PPO_TASKS, TRAININGS, trained
from tdac_agent.evaluation.evaluate import evaluate, write_evaluation
from tdac_agent.evaluation.policies import entrants_of
from tdac_agent.verification.judge.warm import WarmJudge

SEED = 0
RECORDED = Path(__file__).parent.parent / "results" / "genuine"
RECORDED_TASKS = ("warehouse", "thin_walls", "epuck-crates", "epuck-yard")
TASKS = (*PPO_TASKS, *RECORDED_TASKS, "epuck-clutter")
OURS = {
    "builtin": "builtin (no language model)",
    "reference": "reference",
    "follow-guidance": "follow-guidance",
    "go-to-goal": "go-to-goal",
    "random": "random",
}
MODEL = "recorded model"
ASK = "tdac synth --task {0} --learner manual:DIR; controller.py to results/genuine/{0}"


@dataclass(frozen=True, slots=True)
class Entry:
    """A policy on a task.

    Attributes:
        task: Name of a bundled task.
        name: Name of its folder.
        label: Displayed name.
        policy: Argument for `tdac evaluate`.
        training: Name of its training, if it was learned.
        seed: Seed of its training.
    """

    task: str
    name: str
    label: str
    policy: str
    training: str | None = None
    seed: int | None = None


def evaluate_all(names: list[str], runs: Path) -> None:
    """Runs every policy on every task unless the result is already recorded."""
    with WarmJudge() as judge:
        for entry in entries(runs):
            learned = entry.training is not None
            if (learned and entry.training not in names) or _done(entry, runs):
                continue
            print(f"{entry.task}: {entry.name}", flush=True)
            found = evaluate([entry.policy], [entry.task], seed=SEED, judge=judge)
            folder = _folder(entry, runs)
            folder.mkdir(parents=True, exist_ok=True)
            write_evaluation(found, folder)


def entries(runs: Path) -> Iterator[Entry]:
    """All entries in the order of the table."""
    files = trained(runs)
    for task in TASKS:
        for training, file in files.items():
            planned = TRAININGS[training]
            if planned.tasks == (task,):
                label = planned.algo.upper()
                yield Entry(task, training, label, str(file), training, planned.seed)
        controller = RECORDED / task / "controller.py"
        if controller.is_file():
            yield Entry(task, "recorded", MODEL, str(controller))
        for name, label in OURS.items():
            yield Entry(task, name, label, name)


def table(runs: Path) -> pd.DataFrame:
    """A row for each policy on each task; an empty one if no model is recorded."""
    rows = []
    for task in TASKS:
        done = [e for e in entries(runs) if e.task == task and _done(e, runs)]
        rows += [_row(entry, runs) for entry in done]
        if done and not (RECORDED / task / "controller.py").is_file():
            note = f"none on record: {ASK.format(task)}"
            rows.append({"task": task, "policy": MODEL, "knows": "+ map", "note": note})
    whole = ["seed", "episodes", "reached", "collided"]
    found = pd.DataFrame(rows)
    return found if found.empty else found.astype(dict.fromkeys(whole, "Int64"))


def _note(row: dict[str, Any]) -> str | None:
    """The note on a row, including its errors and time-outs."""
    notes = [row["note"]] if row["note"] else []
    notes += [f"{count} × {reason}" for reason, count in row["reasons"].items()]
    return "; ".join(notes) or None


def _folder(entry: Entry, runs: Path) -> Path:
    return runs / "evaluated" / entry.task / entry.name


def _done(entry: Entry, runs: Path) -> bool:
    """Whether exactly this policy is recorded."""
    file = _folder(entry, runs) / "evaluation.json"
    if not file.is_file():
        return False
    found = json.loads(file.read_text())["policies"][0]
    return bool(found["sha256"] == entrants_of([entry.policy])[0].sha256)


def _row(entry: Entry, runs: Path) -> dict[str, Any]:
    folder = _folder(entry, runs)
    found = json.loads((folder / "evaluation.json").read_text())
    row, timing = found["rows"][0], pd.read_csv(folder / "timing.csv").iloc[0]
    return {
        "task": entry.task,
        "policy": entry.label,
        "training": entry.training,
        "seed": entry.seed,
        "knows": row["knows"],
        "episodes": row["episodes"],
        "reached": row["successes"],
        "low": round(row["interval"]["low"], 6),
        "high": round(row["interval"]["high"], 6),
        "collided": row["collided"],
        "time_ratio": row["time_ratio"],
        "path_ratio": row["path_ratio"],
        "spl": row["spl"],
        "smoothness": row["smoothness"],
        "clearance_min": row["clearance_min"],
        "clearance_mean": row["clearance_mean"],
        "unit": found["tasks"][0]["unit"],
        "ms_per_step": timing.median_ms,
        "note": _note(row),
    }
