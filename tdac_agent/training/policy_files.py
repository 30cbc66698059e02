"""The files of a trained policy: its weights and metadata."""

from __future__ import annotations

import importlib.metadata
import json
import math
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tdac_agent.episodes.sb3_file import POLICY, SavedPolicy, write_metadata
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.provenance import versions
from tdac_agent.training.curve import Point
from tdac_agent.training.plan import TrainingPlan
from tdac_agent.training.set_plan import set_of

FACTS = "policy.json"
LAST = "last.zip"
"""The policy at the end of a training, beside the best one."""
LEARNERS = ("stable_baselines3", "sb3_contrib", "torch")


def write_best(model: Any, folder: Path, plan: TrainingPlan, point: Point) -> None:
    """Writes `policy.zip`, which `tdac evaluate` reads, and `policy.json`.

    Args:
        model: Model of stable-baselines3.
        folder: Folder of the training.
        plan: Plan of the training.
        point: Evaluation of the model.
    """
    write_policy(model, folder / POLICY, plan, point.steps)
    write_atomic(folder / FACTS, _facts(plan, point))


def write_policy(model: Any, file: Path, plan: TrainingPlan, steps: int) -> None:
    """Writes a policy with its metadata.

    Args:
        model: Model of stable-baselines3.
        file: File to write or replace, `NAME.zip`.
        plan: Plan of the training.
        steps: Steps of the training so far.
    """
    saved = SavedPolicy(
        algo=plan.algo,
        tasks=plan.tasks,
        set=None if plan.set is None else set_of(plan).name,
        set_sha256=plan.set_sha256,
        wrappers=plan.wrappers,
        variation=plan.env_kwargs.get("variation", plan.variation),
        steps=steps,
        seed=plan.seed,
    )
    draft = file.with_name(f".{file.name}")
    model.save(draft)
    write_metadata(draft, saved)
    os.replace(draft, file)


def _facts(plan: TrainingPlan, point: Point) -> str:
    """The text of `policy.json`."""
    # JSON has no nan; the training success rate is nan until an episode has ended.
    evaluation = {
        key: None if math.isnan(value) else value
        for key, value in asdict(point).items()
    }
    learners = {name: importlib.metadata.version(name) for name in LEARNERS}
    facts = {
        **plan.model_dump(mode="json"),
        "steps_planned": plan.steps,
        "steps": point.steps,
        "seconds": point.seconds,
        "evaluation": evaluation,
        "cores": os.cpu_count(),
        "versions": {**versions(), **learners},
    }
    return json.dumps(facts, indent=2, allow_nan=False) + "\n"
