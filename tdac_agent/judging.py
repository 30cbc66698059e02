"""The judge's process: pytest over a suite, away from the caller and hermetic.

Run as `python -m tdac_agent.judging REQUEST.json`; the controller's code never runs
here, only in the sandboxed children that the judge starts.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from pydantic import BaseModel, ConfigDict, Field

from tdac_agent.diagnosis import diagnose
from tdac_agent.errors import Fault
from tdac_agent.files import write_atomic
from tdac_agent.judge import Judge
from tdac_agent.report import Episode
from tdac_agent.sandbox import Limits
from tdac_agent.suite_plugin import JudgePlugin, rollout_key
from tdac_agent.task import Profile, Task, load_task
from tdac_agent.trajectory import Rollout


class Job(BaseModel):
    """What the judge's process is to do; all paths are absolute."""

    model_config = ConfigDict(extra="forbid")

    task: Path
    controller: Path
    suites: list[Path] = Field(description="In the order in which they run.")
    profile: Profile
    paper: bool
    tier: str
    seed: int
    limits: Limits
    out: Path


class Findings(BaseModel):
    """What the judge's process found, beside pytest's own report log."""

    model_config = ConfigDict(extra="forbid")

    expected: list[str]
    episodes: list[Episode]
    diagnoses: dict[str, str]
    tier: str
    child_cpu_seconds: float
    fault: str | None


def main() -> None:
    """Runs a suite as its only argument asks, and writes the findings."""
    job = Job.model_validate_json(Path(sys.argv[1]).read_text(encoding="utf-8"))
    task = load_task(job.task)
    judge = Judge(
        task,
        job.controller.read_bytes(),
        job.task,
        tier=job.tier,
        seed=job.seed,
        limits=job.limits,
    )
    plugin = JudgePlugin(judge, profile=job.profile, paper=job.paper)
    try:
        pytest.main(_arguments(job), plugins=[plugin])
    finally:
        judge.close()
    (job.out / "trajectories").mkdir(exist_ok=True)
    for rollout in judge.rollouts.values():
        if rollout.returned is None and rollout.trajectory.steps:
            name = rollout.name.replace(" ", "_")
            rollout.trajectory.save(job.out / "trajectories" / f"{name}.npz")
    write_atomic(
        job.out / "findings.json", _findings(task, judge, plugin).model_dump_json()
    )


def _arguments(job: Job) -> list[str]:
    root = job.suites[0].parent
    return [
        *(str(folder) for folder in job.suites),
        f"--rootdir={root}",
        f"--confcutdir={root}",
        "-c",
        os.devnull,
        "-p",
        "pytest_reportlog.plugin",
        f"--report-log={job.out / 'report.jsonl'}",
        "-p",
        "no:cacheprovider",
        "--import-mode=importlib",
        "--assert=plain",
        "--strict-markers",
        "-q",
    ]


def _findings(task: Task, judge: Judge, plugin: JudgePlugin) -> Findings:
    episodes = [
        _episode(rollout, task)
        for (_, steps, drive), rollout in judge.rollouts.items()
        if steps is None and drive == "policy"
    ]
    diagnoses = {
        rollout_key(*key): diagnose(rollout, task.nominal).model_dump_json()
        for key, rollout in judge.rollouts.items()
        if rollout.outcome != "not run"
        and (rollout.held_out or rollout.outcome not in ("reached", "stopped"))
    }
    return Findings(
        expected=plugin.expected,
        episodes=episodes,
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


if __name__ == "__main__":
    try:
        main()
    except Fault as error:
        sys.exit(f"fault: {error}")
