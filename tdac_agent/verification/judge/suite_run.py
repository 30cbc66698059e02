"""Runs a suite on one controller with pytest, in the judge's process."""

from __future__ import annotations

import contextlib
import sys
from concurrent.futures import ThreadPoolExecutor

from tdac_agent.tasks.task import read_task
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.jobs import Job
from tdac_agent.verification.judge.judge import Judge
from tdac_agent.verification.judge.suite_episode import SuitePool


def judge_suite(
    job: Job,
    child_pool: ChildPool,
    worker_pool: SuitePool | None,
    later: contextlib.ExitStack,
) -> None:
    """Runs the suite of a job, and writes the findings."""
    task = read_task(job.task)
    judge = Judge(
        task,
        job.controller.read_bytes(),  # raw read: our temporary folder
        job.task,
        tier=job.tier,
        seed=job.seed,
        limits=job.limits,
        child_pool=child_pool,
        worker_pool=worker_pool,
    )
    later.callback(judge.close)
    judge.begin(jitters=not job.paper, own_loop=job.profile == "paper")
    # Loaded while the first episodes are under way.
    from tdac_agent.verification.judge.findings import driven, findings_of
    from tdac_agent.verification.judge.plugin import JudgePlugin, run_tests

    if len(job.suites) > 1:
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
        shown = task.setting.in_metres().shown if job.metres else None
        findings = findings_of(judge, plugin.expected, shown).model_dump_json()
    (job.out / "findings.json").write_text(findings, encoding="utf-8")
