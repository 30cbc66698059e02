"""One episode by its seed, driven by any policy."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

from tdac_agent.episodes.episode import Record, not_driven, run_policy
from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.sandbox import ControllerFault, Limits
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.setting import Nominal
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.drivers import PolicySpec, driver_of
from tdac_envs.core.intake import RECORD_BYTES, read_file

UNSANDBOXED = "none"
"""Reported as the tier of policies that run without a sandbox."""
FOREVER = 1 << 62


@dataclass(frozen=True, slots=True)
class EpisodeSetup:
    """Everything that an episode depends on, except its seed.

    Attributes:
        task: The task.
        policy: The policy that drives.
        workdir: Folder whose files a controller may read.
        disturbance: Disturbance of the environment.
        tier: Sandbox tier, or `auto`.
        limits: Limits of each child, and so of each episode.
        child_pool: The child pool.
        variation: Variation of start and goal.
    """

    task: Task
    policy: PolicySpec
    workdir: Path
    disturbance: Disturbance
    tier: str
    limits: Limits
    child_pool: ChildPool
    variation: str = "jitter"


@dataclass(frozen=True, slots=True, eq=False)
class SeededResult:
    """The result of an episode.

    Attributes:
        rollout: The judged episode.
        cpu_seconds: CPU time of its child; 0 without one.
        tier: Sandbox tier of its child.
        task: Task with the start and the goal of this episode.
    """

    rollout: Rollout
    cpu_seconds: float
    tier: str
    task: Nominal


def record_of(setup: EpisodeSetup, seed: int) -> Record:
    """An empty record for the episode of a seed."""
    env = setup.task.disturbed_env(setup.disturbance, setup.variation)
    # The environment ends an episode at its horizon, which depends on the goal.
    return Record(env, None, FOREVER, seed=seed)


def drive_seed(setup: EpisodeSetup, seed: int) -> SeededResult:
    """Drives the episode of a seed; a controller runs in a fresh child.

    The environment draws start and noise after `reset(seed=seed)`.
    """
    record = record_of(setup, seed)
    if setup.policy.kind != "controller":
        return _driven_here(setup, record, seed)
    name, source = f"seed {seed}", source_of(setup.policy)
    record.seen = setup.task.setting.seen
    child = setup.child_pool.take(setup.tier, setup.limits)
    try:
        child.copy_files(setup.workdir, source)
        child.load()
        # Single calls and their mean time are limited instead of the episode.
        rollout = run_policy(child, record, name, held_out=False, deadline=math.inf)
    except ControllerFault as fault:
        rollout = not_driven(record, name, fault)
    finally:
        usage = child.close()
    rollout = replace(rollout, printed=usage.printed)
    return SeededResult(rollout, usage.cpu_seconds, child.tier, record.env.task)


def source_of(policy: PolicySpec) -> bytes:
    """Reads the source of a controller."""
    assert policy.file is not None
    return read_file(policy.file, RECORD_BYTES)


def _driven_here(setup: EpisodeSetup, record: Record, seed: int) -> SeededResult:
    """Drives an episode of a baseline or learned policy, which run no foreign code."""
    name = f"seed {seed}"
    try:
        driver = driver_of(setup.policy, record.env, seed)
        rollout = run_policy(driver, record, name, held_out=False, deadline=math.inf)
    except ControllerFault as fault:
        rollout = not_driven(record, name, fault)
    return SeededResult(rollout, 0.0, UNSANDBOXED, record.env.task)
