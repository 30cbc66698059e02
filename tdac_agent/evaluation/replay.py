"""Drives one episode to look at: the one that an evaluation drives."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from tdac_agent.errors import Fault
from tdac_agent.evaluation.policies import Entrant
from tdac_agent.problems.episodes import episodes_of
from tdac_agent.problems.part import Part
from tdac_agent.sandbox import SandboxError
from tdac_agent.tasks.deviation import Deviation
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.episode_job import (
    Driven,
    EpisodeJob,
    EpisodeRun,
    drive_number,
)
from tdac_agent.verification.judge.policy_spec import written
from tdac_agent.verification.judge.worlds import Case, DeviatedWorlds
from tdac_envs.core.arguments import one_of
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.task_sets import TaskSet

SHOWN = ("train", "dev", "test")


def drive_episode(
    entrant: Entrant,
    problem: Task | TaskSet,
    part: Part,
    tier: str = "auto",
    deviation: Deviation | None = None,
) -> Driven:
    """Drives the first episode of a part.

    In the split `train`, the disturbances are new each time.

    Args:
        entrant: The policy, from `fitted`.
        problem: The task or the task set.
        part: The episode.
        tier: Sandbox tier; `auto` for the best one on this machine.
        deviation: What differs from what the policy is told; None for nothing.

    Raises:
        TaskError: There is no such world, or no feasible episode with the deviation.
        Fault: The sandbox is broken.
    """
    own = episodes_of(problem)
    with tempfile.TemporaryDirectory(prefix="tdac-play-") as name:
        folder, child_pool = Path(name), ChildPool(ahead=False)
        policy = written(entrant.policy, folder, entrant.source, entrant.weights)
        worlds: Any = own.worlds(part, folder, policy)
        number = part.first
        if deviation is not None:
            case = Case(number=number, deviation=deviation)
            worlds, number = DeviatedWorlds(within=worlds, cases=(case,)), 0
        job = EpisodeJob(
            worlds=worlds,
            policy=policy,
            numbers=(number,),
            tier=tier,
            limits=own.limits,
            out=folder / "results",
        )
        try:
            return drive_number(EpisodeRun.of(job, child_pool), number)
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
