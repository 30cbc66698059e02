"""One episode of a suite in a fresh child, driven by a process of the worker pool."""

from __future__ import annotations

import functools
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from tdac_agent.episodes.episode import Driver, Record, run_own_loop, run_policy
from tdac_agent.episodes.trajectory import Outcome, Rollout
from tdac_agent.sandbox import (
    Child,
    ChildUsage,
    ControllerFault,
    ControllerTimeout,
    Limits,
)
from tdac_agent.tasks.task import Task, read_task
from tdac_agent.verification.judge.blame import faults_of_judge
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.cpu_budget import Budgeted
from tdac_agent.verification.judge.level import Level
from tdac_agent.verification.judge.worker_pool import WorkerPool
from tdac_envs.drive.task import Pose
from tdac_envs.physics.moved import EXACT

if TYPE_CHECKING:
    from tdac_agent.verification.judge.first_world import FirstWorld

SuiteTask: TypeAlias = "Task | FirstWorld"
"""Where a suite drives: on a task, or in the first world of a task set."""
SHOWN_JITTERS = 2


@dataclass(frozen=True, slots=True)
class VerificationSettings:
    """Settings shared by the episodes of a verification.

    Attributes:
        source: Bytes of `controller.py`.
        workdir: Folder of the task, whose files the controller may read.
        tier: Sandbox tier, or `auto`.
        limits: Limits of each child.
        deadline: Latest end, by `time.monotonic`.
        level: The task set; None for a task.
        physics: What moves the robot.
    """

    source: bytes
    workdir: Path
    tier: str
    limits: Limits
    deadline: float
    level: Level | None = None
    physics: str = EXACT


@dataclass(frozen=True, slots=True)
class EpisodeRequest:
    """A request for an episode.

    Attributes:
        name: `nominal`, or `jitter 1` and so on.
        start: Start pose; None in the first world of a set, which has its own.
        steps: Maximum number of steps; None for the horizon.
        drive: `policy`, `run_episode` or `truncated run_episode`.
        seed: Seed of all that the environment draws, such as movers.
        options: Options of the environment's `reset`, instead of a start.
    """

    name: str
    start: Pose | None
    steps: int | None
    drive: str
    seed: int
    options: dict[str, Any] | None = None

    @property
    def held_out(self) -> bool:
        """Whether feedback may report only pass or fail for this episode."""
        return self.name != "nominal" and int(self.name.split()[1]) > SHOWN_JITTERS


@dataclass(frozen=True, slots=True, eq=False)
class SuiteResult:
    """The result of an episode.

    Attributes:
        rollout: The judged episode.
        usage: Resource usage of its child.
        judge_cpu: CPU time of the judge's process that drove it, s.
        tier: Sandbox tier of its child.
        import_fault: Why the controller could not be imported; None if it could.
    """

    rollout: Rollout
    usage: ChildUsage
    judge_cpu: float
    tier: str
    import_fault: ControllerFault | None = None


SuitePool = WorkerPool[[VerificationSettings, EpisodeRequest], SuiteResult]


def drive_known(
    child_pool: ChildPool, settings: VerificationSettings, request: EpisodeRequest
) -> SuiteResult:
    """The same as `drive`, for the task in the folder of the settings."""
    task = task_of(settings.workdir, settings.level)
    return drive(task, child_pool, settings, request)


@functools.lru_cache(maxsize=1)
def task_of(workdir: Path, level: Level | None) -> SuiteTask:
    """The task in a folder, or the first world of a task set."""
    if level is None:
        return read_task(workdir)
    # Task sets need much that a task does not.
    from tdac_agent.verification.judge.first_world import FirstWorld

    return FirstWorld(level)


@faults_of_judge()
def drive(
    task: SuiteTask,
    child_pool: ChildPool,
    settings: VerificationSettings,
    request: EpisodeRequest,
) -> SuiteResult:
    """Drives an episode in a fresh child.

    Raises:
        Fault: The sandbox or the judge failed.
    """
    began = time.process_time()
    limit = request.steps if request.steps is not None else task.nominal.horizon
    record = _record(task, request, limit, settings.physics)
    record.seen = task.seen
    if request.drive == "truncated run_episode":
        record.truncates, record.collisions_before = True, 2
    child = child_pool.take(settings.tier, settings.limits)
    try:
        driver = _loaded(child, settings)
    except ControllerFault as fault:
        usage = child.close()
        rollout = replace(not_driven(task, request, fault), printed=usage.printed)
        return SuiteResult(
            rollout, usage, time.process_time() - began, child.tier, fault
        )
    try:
        if request.drive != "policy":
            seconds = child.limits.reset_seconds + 2 * limit * task.nominal.dt
            rollout = run_own_loop(
                child, record, request.name, timeout=seconds, deadline=settings.deadline
            )
        else:
            rollout = run_policy(
                driver,
                record,
                request.name,
                held_out=request.held_out,
                deadline=settings.deadline,
            )
    finally:
        usage = child.close()
    rollout = replace(rollout, printed=usage.printed)
    return SuiteResult(rollout, usage, time.process_time() - began, child.tier)


def _record(
    task: SuiteTask, request: EpisodeRequest, most: int, physics: str = EXACT
) -> Record:
    options = request.options
    if physics == EXACT:
        env = task.make_env()
    else:
        assert isinstance(task, Task)
        env = task.make_env(physics=physics)
    return Record(env, request.start, most, seed=request.seed, options=options)


def _loaded(child: Child, settings: VerificationSettings) -> Driver:
    """The controller in a child; its CPU time is limited on a task set."""
    if settings.level is None:
        load_controller(child, settings)
        return child
    child.copy_files(settings.workdir, settings.source)
    driver = Budgeted(child, settings.level.cpu)
    driver.load()
    return driver


def load_controller(child: Child, settings: VerificationSettings) -> None:
    """Copies the task's files and the controller to a child, and imports it there.

    Raises:
        ControllerFault: The controller cannot be imported.
        SandboxError: The files cannot be copied.
    """
    child.copy_files(settings.workdir, settings.source)
    child.load()


def not_driven(
    task: SuiteTask, request: EpisodeRequest, fault: ControllerFault
) -> Rollout:
    """The episode of a controller that cannot be imported, or is out of resources."""
    return replace(
        skipped(task, request, "error", str(fault)),
        timed_out=isinstance(fault, ControllerTimeout),
        is_retryable=fault.is_retryable,
    )


def skipped(
    task: SuiteTask, request: EpisodeRequest, outcome: Outcome, reason: str
) -> Rollout:
    """An episode without steps."""
    record = _record(task, request, 1)
    record.reset()
    nominal = task.nominal
    return Rollout(
        request.name,
        request.held_out,
        outcome,
        record.trajectory(),
        nominal.goal,
        nominal.body_radius,
        nominal.goal_tolerance,
        error=reason,
    )
