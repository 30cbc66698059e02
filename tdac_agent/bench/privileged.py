"""Planners that know the true world and all movers: a reference, not a competitor.

These are the planners that admit worlds to a set. Among discs that bounce it is the
earliest arrival on a lattice in space and time, with turns that take no time; among
people it is a driver by ORCA.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from tdac_agent.evaluation.kept_sets import keep_report, keep_sealed
from tdac_agent.evaluation.set_report import SetProvenance, SetReport, summarise
from tdac_agent.tasks.provenance import sha256_of
from tdac_agent.verification.judge.set_job import WorldEpisode, figures_of_world
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder import orca_driver, space_time
from tdac_envs.ladder.orca_driver import OrcaDrive, drive_by_orca
from tdac_envs.ladder.scores import barn_score, path_score, time_score
from tdac_envs.ladder.source import read_salt
from tdac_envs.ladder.space_time import earliest_arrival
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.map2d.task import Map2DTask

PRIVILEGED = "privileged"
"""The word for this entrant."""


def planner_sha256() -> str:
    """Hash of the planners' source code."""
    files = (space_time.__file__, orca_driver.__file__)
    return sha256_of(b"".join(Path(file).read_bytes() for file in files))


def check_movers(tasks: TaskSet) -> None:
    """Checks that a set has movers.

    Raises:
        TaskError: It has none.
    """
    if not tasks.file.movers:
        raise TaskError(
            "without movers, a planner that knows the world takes the least possible "
            "time: its time score is 1 by definition"
        )


def plan_worlds(
    tasks: TaskSet, split: str, count: int, salt_file: Path | None, folder: Path
) -> SetReport:
    """Plans on the first worlds of a split, and writes the report to a folder."""
    began = time.monotonic()
    salt = None if salt_file is None else read_salt(salt_file)
    episodes = [_episode(tasks, split, index, salt) for index in range(count)]
    provenance = SetProvenance.unconfined(tasks, split, salt, planner_sha256())
    seconds = time.monotonic() - began
    report = summarise(provenance, episodes, None, seconds, per_world=salt is None)
    keep_report(report, folder)
    if salt is not None:
        keep_sealed(episodes, folder)
    return report


def _episode(
    tasks: TaskSet, split: str, index: int, salt: bytes | None
) -> WorldEpisode:
    """What the planner reaches on a world."""
    began = time.process_time()
    world, task = tasks.world_and_task(split, index, salt)
    assert isinstance(task, Map2DTask)
    found, hard = _plan(tasks, task, split, index, salt), world.difficulty
    reached, steps = found is not None, found.steps if found else task.horizon
    return WorldEpisode(
        index=index,
        generator=tasks.kind(split, index),
        outcome="reached" if reached else "out of time",
        steps=steps,
        horizon=task.horizon,
        time_score=time_score(reached, steps, hard.steps),
        path_score=path_score(reached, found.driven if found else 0.0, hard.length),
        barn_score=barn_score(reached, steps, hard.length / tasks.file.full_step),
        d_min=0.0 if reached else hard.length,
        **figures_of_world(world, task),
        cpu_seconds=round(time.process_time() - began, 3),
    )


def _plan(
    tasks: TaskSet, task: Map2DTask, split: str, index: int, salt: bytes | None
) -> OrcaDrive | None:
    """Steps and length of the planner's drive; None if it does not arrive."""
    if any(group.kind == "crowd" for group in tasks.file.movers):
        return drive_by_orca(task, tasks.file.errors, tasks.noise(split, index, salt))
    arrival = earliest_arrival(task)
    if arrival is None:
        return None
    legs = np.hypot(*np.diff(arrival.path[:, 1:], axis=0).T)
    return OrcaDrive(arrival.steps, float(legs.sum()))
