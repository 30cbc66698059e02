"""A suite of tests over one controller: run by pytest, hermetic; its findings."""

from __future__ import annotations

import contextlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tdac_agent.jobs import Findings, Job
from tdac_agent.judge import Judge, rollout_key
from tdac_agent.nursery import Nursery
from tdac_agent.report import Episode
from tdac_agent.task import Task, load_task
from tdac_agent.trajectory import Rollout


def judge_suite(job: Job, nursery: Nursery, later: contextlib.ExitStack) -> None:
    """Runs a suite as asked, and writes the findings."""
    task = load_task(job.task)
    judge = Judge(
        task,
        job.controller.read_bytes(),
        job.task,
        tier=job.tier,
        seed=job.seed,
        limits=job.limits,
        nursery=nursery,
    )
    later.callback(judge.close)
    judge.begin(jitters=not job.paper, own_loop=job.profile == "paper")
    # Loaded while the first episodes are under way.
    from tdac_agent.suite_plugin import JudgePlugin, run_tests

    plugin = JudgePlugin(judge, profile=job.profile, paper=job.paper)
    run_tests(job.suites, job.out / "report.jsonl", plugin)
    judge.settle()
    with ThreadPoolExecutor() as pool:  # most of it is compression
        if job.trajectories is not None:
            _save(judge, job.trajectories, pool)
        findings = _findings(task, judge, plugin.expected).model_dump_json()
    (job.out / "findings.json").write_text(findings, encoding="utf-8")


def _driven(judge: Judge) -> list[Rollout]:
    """The whole episodes that `policy` drove."""
    return [
        rollout
        for (_, steps, drive), rollout in judge.rollouts.items()
        if steps is None and drive == "policy"
    ]


def _save(judge: Judge, folder: Path, pool: ThreadPoolExecutor) -> None:
    for rollout in _driven(judge):
        if rollout.trajectory.steps:
            file = folder / f"{rollout.name.replace(' ', '_')}.npz"
            pool.submit(rollout.trajectory.save, file)


def _findings(task: Task, judge: Judge, expected: list[str]) -> Findings:
    from tdac_agent.diagnosis import diagnose

    diagnoses = {
        rollout_key(*key): diagnose(rollout, task.nominal).model_dump_json()
        for key, rollout in judge.rollouts.items()
        if rollout.outcome != "not run"
        and (rollout.held_out or rollout.outcome not in ("reached", "stopped"))
    }
    return Findings(
        expected=expected,
        episodes=[_episode(rollout, task) for rollout in _driven(judge)],
        diagnoses=diagnoses,
        tier=judge.tier,
        child_cpu_seconds=round(judge.cpu_seconds, 3),
        fault=judge.fault,
    )


def _episode(rollout: Rollout, task: Task) -> Episode:
    fraction, within = task.spec.progress.fraction, task.progress_steps + 1
    figures = {}
    for kind, suffix in (("geodesic", ""), ("euclidean", "_euclidean")):
        distances = rollout.distances(kind)
        figures[f"d0{suffix}"] = float(distances[0])
        figures[f"d_min{suffix}"] = float(distances.min())
        best = float(distances[:within].min())
        figures[f"progress_passed{suffix}"] = best <= fraction * float(distances[0])
    return Episode(
        name=rollout.name,
        held_out=rollout.held_out,
        outcome=rollout.outcome,
        steps=rollout.trajectory.steps,
        collisions=rollout.collisions,
        call_ms_mean=round(rollout.call_ms[0], 3),
        call_ms_p99=round(rollout.call_ms[1], 3),
        error=rollout.error,
        **figures,
    )
