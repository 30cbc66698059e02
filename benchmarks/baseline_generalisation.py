"""Runs learned policies on maps and worlds seen and not seen in training."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks.baseline_trainings import TRAININGS, trained
from tdac_agent import load_task
from tdac_agent.evaluation.evaluate import EPISODES, episode_seeds
from tdac_agent.evaluation.policies import entrants_of
from tdac_agent.metrics.exact import exact_interval
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.task_file import bundled_tasks
from tdac_agent.training.plan import read_plan

SEED = 0


def drive_all(names: list[str], runs: Path) -> None:
    """Runs policies on all tasks of their robot that are not recorded yet."""
    wanted = [
        (training, task)
        for training in trained(runs)
        if training in names
        for task in _places(TRAININGS[training].tasks)
    ]
    # The tasks they were trained on come first.
    for training, task in sorted(wanted, key=lambda pair: not _seen(*pair)):
        known = _read(training, runs)
        if task not in known:
            print(f"{training}: {task}", flush=True)
            _write(training, {**known, task: _drive(training, task, runs)}, runs)


def _seen(training: str, task: str) -> bool:
    return task in TRAININGS[training].tasks


def _drive(training: str, task: str, runs: Path) -> dict[str, int]:
    """Counts the episodes that reached the goal, and those with a contact."""
    from stable_baselines3.common.vec_env import VecMonitor

    from tdac_agent.training.learning import ALGOS, evaluate_batch
    from tdac_agent.training.plan import make_batch

    folder = runs / training
    plan = read_plan(folder).model_copy(
        update={"tasks": (task,), "task_sha256": (load_task(task).sha256(),)}
    )
    model: Any = ALGOS[plan.algo].load(trained(runs)[training], device="cpu")
    envs = VecMonitor(make_batch(plan, EPISODES), info_keywords=("collision",))
    found = evaluate_batch(model, envs, episode_seeds(SEED, EPISODES))
    envs.close()
    rates = {"reached": found.success_rate, "collided": found.collision_rate}
    return {name: round(rate * EPISODES) for name, rate in rates.items()}


def table(runs: Path) -> pd.DataFrame:
    """A row for each policy on each map or world."""
    return pd.DataFrame(
        [
            _row(training, task, counts)
            for training in trained(runs)
            for task, counts in sorted(_read(training, runs).items(), key=_order)
        ]
    )


def _order(found: tuple[str, dict[str, int]]) -> int:
    return bundled_tasks().index(found[0])


def _row(training: str, task: str, counts: dict[str, int]) -> dict[str, Any]:
    planned = TRAININGS[training]
    low, high = exact_interval(counts["reached"], EPISODES)
    return {
        "training": training,
        "algo": planned.algo,
        "trained_on": " ".join(planned.tasks),
        "seed": planned.seed,
        "evaluated_on": task,
        "seen": _seen(training, task),
        "episodes": EPISODES,
        "reached": counts["reached"],
        "low": round(low, 6),
        "high": round(high, 6),
        "collided": counts["collided"],
    }


def _places(tasks: tuple[str, ...]) -> list[str]:
    """The bundled tasks in the same environment."""
    env = load_task(tasks[0]).spec.env
    return [name for name in bundled_tasks() if load_task(name).spec.env == env]


def _file(training: str, runs: Path) -> Path:
    return runs / "elsewhere" / f"{training}.json"


def _read(training: str, runs: Path) -> dict[str, dict[str, int]]:
    """Recorded counts of exactly this policy, by task."""
    file = _file(training, runs)
    if not file.is_file():
        return {}
    found = json.loads(file.read_text())
    same = found["sha256"] == _sha256(training, runs)
    return dict(found["tasks"]) if same else {}


def _write(training: str, known: dict[str, dict[str, int]], runs: Path) -> None:
    file = _file(training, runs)
    file.parent.mkdir(parents=True, exist_ok=True)
    found = {"sha256": _sha256(training, runs), "tasks": known}
    write_atomic(file, json.dumps(found, indent=1) + "\n")


def _sha256(training: str, runs: Path) -> str | None:
    return entrants_of([trained(runs)[training]])[0].sha256
