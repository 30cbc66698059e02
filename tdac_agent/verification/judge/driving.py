"""One episode by its seed, whoever drives."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from tdac_agent.episodes.episode import Record, not_driven, run_policy
from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.sandbox import ControllerFault, Limits
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.setting import Nominal
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.children import Nursery
from tdac_agent.verification.judge.contenders import Contender, driver_of
from tdac_envs.core.intake import RECORD_BYTES, read_file

NO_SANDBOX = "none"
"""In the place of a tier, of policies that need none."""
FOREVER = 1 << 62


@dataclass(frozen=True, slots=True)
class Stage:
    """All that an episode depends on but its seed.

    Attributes:
        task: What is to be done.
        contender: Who drives.
        workdir: Folder whose files a controller may read.
        disturbance: Of the environment.
        tier: Sandbox tier, or `auto`.
        limits: Of each child, and so of each episode.
        nursery: Where children come from.
        variation: Of start and goal.
    """

    task: Task
    contender: Contender
    workdir: Path
    disturbance: Disturbance
    tier: str
    limits: Limits
    nursery: Nursery
    variation: str = "jitter"


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """An episode as it was driven.

    Attributes:
        rollout: What came of it.
        cpu_seconds: Of its child; 0 where it had none.
        tier: Sandbox tier of that.
        task: With the start and the goal of this episode.
    """

    rollout: Rollout
    cpu_seconds: float
    tier: str
    task: Nominal


def record_of(stage: Stage, seed: int) -> Record:
    """The record of the episode of a seed, which is yet to begin."""
    env = stage.task.disturbed_env(stage.disturbance, stage.variation)
    # The environment itself ends an episode at its horizon, which goes with the goal.
    return Record(env, None, FOREVER, seed=seed)


def drive_seed(stage: Stage, seed: int) -> Driven:
    """The episode of a seed, of a controller in a fresh child.

    Start and noise are what the environment draws after `reset(seed=seed)`.
    """
    record = record_of(stage, seed)
    if stage.contender.kind != "controller":
        return _driven_here(stage, record, seed)
    name, source = f"seed {seed}", source_of(stage.contender)
    child = stage.nursery.take(stage.tier, stage.limits)
    try:
        child.furnish(stage.workdir, source)
        child.load()
        # Each call has its limit, and slow ones are cut off by their mean.
        rollout = run_policy(child, record, name, held_out=False, deadline=math.inf)
    except ControllerFault as fault:
        rollout = not_driven(record, name, fault)
    finally:
        usage = child.close()
    return Driven(rollout, usage.cpu_seconds, child.tier, record.env.task)


def source_of(contender: Contender) -> bytes:
    """Source of a controller."""
    assert contender.file is not None
    return read_file(contender.file, RECORD_BYTES)


def _driven_here(stage: Stage, record: Record, seed: int) -> Driven:
    """The episode of one of our policies, or of a network: no code of others runs."""
    name = f"seed {seed}"
    try:
        driver = driver_of(stage.contender, record.env, seed)
        rollout = run_policy(driver, record, name, held_out=False, deadline=math.inf)
    except ControllerFault as fault:
        rollout = not_driven(record, name, fault)
    return Driven(rollout, 0.0, NO_SANDBOX, record.env.task)
