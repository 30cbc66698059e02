"""Drives one episode on a world of a task set, to look at."""

from __future__ import annotations

import tempfile
from pathlib import Path

from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.errors import Fault
from tdac_agent.evaluation.entrants import Entrant
from tdac_agent.evaluation.set_learned import LearnedRuns
from tdac_agent.evaluation.set_verify import limits_of, write_set
from tdac_agent.sandbox import SandboxError
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.set_job import SetJob, SetRun, drive_once
from tdac_agent.verification.verify import read_source
from tdac_envs.core.arguments import one_of
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.task_sets import AnyTask, TaskSet

SHOWN = ("train", "dev", "test")


def play_world(
    entrant: Entrant, tasks: TaskSet, split: str, index: int, tier: str = "auto"
) -> tuple[Rollout, AnyTask]:
    """Drives the episode that `tdac verify --set` and `evaluate --set` drive.

    In the split `train`, the disturbances are new each time.

    Args:
        entrant: The policy, from `set_entrants`.
        tasks: The task set.
        split: One of `SHOWN`.
        index: Number of the world.
        tier: Sandbox tier; `auto` for the best one on this machine.

    Raises:
        TaskError: The split is hidden or unknown, or has no such world.
        Fault: The sandbox is broken.
    """
    check_shown(split)
    task = tasks.task(split, index)
    if entrant.policy.kind == "sb3":
        return LearnedRuns.of(entrant, tasks, split).drive(index), task
    assert entrant.policy.file is not None
    with tempfile.TemporaryDirectory(prefix="tdac-play-") as name:
        folder, child_pool = Path(name), ChildPool(ahead=False)
        job = SetJob(
            set_file=write_set(tasks, folder / "set.yaml"),
            split=split,
            salt_file=None,
            worlds=(index,),
            controller=entrant.policy.file,
            test=None,
            per_world=True,
            tier=tier,
            limits=limits_of(tasks),
            out=folder / "results",
        )
        run = SetRun(job, read_source(entrant.policy.file), child_pool)
        try:
            return drive_once(run, index)[0], task
        except SandboxError as error:
            raise Fault(error.fault) from error
        finally:
            child_pool.close()


def check_shown(split: str) -> None:
    """Checks that worlds of a split may be shown.

    Raises:
        TaskError: The split is hidden or unknown.
    """
    if split == "hidden":
        raise TaskError("hidden worlds are not shown: give --split train, dev or test")
    one_of("split", split, SHOWN)
