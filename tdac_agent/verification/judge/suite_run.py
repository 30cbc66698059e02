"""Runs a suite on one controller with pytest, in the judge's process."""

from __future__ import annotations

import contextlib
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.jobs import Job
from tdac_agent.verification.judge.judge import Judge
from tdac_agent.verification.judge.level import Level
from tdac_agent.verification.judge.suite_episode import SuitePool, task_of
from tdac_envs.physics.moved import EXACT


def judge_suite(
    job: Job,
    child_pool: ChildPool,
    worker_pool: SuitePool | None,
    later: contextlib.ExitStack,
) -> None:
    """Runs the suite of a job, and writes the findings."""
    level = None if job.set_file is None else _level_of(job.set_file, job.split)
    task = task_of(job.task, level)
    judge = Judge(
        task,
        job.controller.read_bytes(),  # raw read: our temporary folder
        job.task,
        tier=job.tier,
        seed=job.seed,
        limits=job.limits,
        child_pool=child_pool,
        worker_pool=worker_pool,
        level=level,
    )
    later.callback(judge.close)
    checks = None
    if level is None:
        judge.begin(jitters=not job.paper, own_loop=job.profile == "paper")
    else:
        checks = _checks_of(judge)
    # Loaded while the first episodes are under way.
    from tdac_agent.verification.judge.findings import driven, findings_of
    from tdac_agent.verification.judge.plugin import JudgePlugin, run_tests

    if level is not None or len(job.suites) > 1:
        # Bytecode stored beside a user's tests may not match them.
        sys.pycache_prefix = str(job.out / "bytecode")
    plugin = JudgePlugin(judge, profile=job.profile, paper=job.paper)
    run_tests(job.suites, job.out / "report.jsonl", plugin)
    with ThreadPoolExecutor() as pool:  # saving is mostly compression
        if job.trajectories is not None:
            for rollout in driven(judge):
                name = f"{rollout.name.replace(' ', '_')}.npz"
                if rollout.trajectory.steps:
                    pool.submit(rollout.trajectory.save, job.trajectories / name)
        judge.settle()
        shown = None
        if job.metres:
            assert isinstance(task, Task)
            shown = task.setting.in_metres().shown
        findings = findings_of(judge, plugin.expected, shown, checks)
    if job.physics != EXACT and findings.fault is None:
        from tdac_agent.verification.judge.driven_again import drive_again

        opinion = drive_again(judge, job.physics)
        changes = {"second_opinion": opinion, "fault": judge.fault}
        findings = findings.model_copy(update=changes)
    text = findings.model_dump_json()
    (job.out / "findings.json").write_text(text, encoding="utf-8")


def _level_of(set_file: Path, split: str) -> Level:
    from tdac_envs.ladder.task_sets import load_set  # not needed on a task

    return Level(set_file, split, load_set(set_file).file.cpu)


def _checks_of(judge: Judge) -> dict[str, str | None]:
    """The static and contract tests of a controller for a task set."""
    from tdac_agent.verification.judge.set_checks import (
        CHECKED_STEPS,
        STABLE,
        static_checks,
    )

    results = static_checks(judge.source)
    if len(results) > 1:  # it parses
        results[STABLE] = judge.rollout(steps=CHECKED_STEPS).error
    return results
