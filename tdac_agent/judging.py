"""The judge's process: pytest over a suite, away from the caller and hermetic.

Run by `tdac_agent.warm` as `python -m tdac_agent.judging`; the controller's code never
runs here, only in the sandboxed children that the judge starts.
"""

from __future__ import annotations

import os
import sys
import traceback
from pathlib import Path
from typing import NoReturn

import cv2
import numpy as np
import pytest
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from tdac_agent.crew import end_with_parent
from tdac_agent.diagnosis import diagnose
from tdac_agent.files import write_atomic
from tdac_agent.judge import Judge
from tdac_agent.nursery import Nursery
from tdac_agent.report import Episode
from tdac_agent.sandbox import Limits
from tdac_agent.seeded import SeededJob, judge_seeds
from tdac_agent.suite_plugin import JudgePlugin, rollout_key
from tdac_agent.task import Task, load_task
from tdac_agent.task_file import Profile
from tdac_agent.trajectory import Rollout
from tdac_envs.map2d import Map2DEnv

NO_JOB = 77
# Threads drive episodes beside the tests: none of them should wait for another long.
SWITCH_SECONDS = 2e-4
# Some of these cost a verification more than its tests do.
UNUSED_PLUGINS = (
    "cacheprovider",
    "unraisableexception",
    "threadexception",
    "doctest",
    "pastebin",
    "stepwise",
    "faulthandler",
    "legacypath",
)


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


def serve() -> None:
    """Forks one worker after another until there is no further job.

    For each worker, prints its process id and, when it has ended, its exit code.
    """
    # OpenCV's threads would not survive the fork.
    cv2.setNumThreads(1)
    sys.setswitchinterval(SWITCH_SECONDS)
    _warm_up()
    more = True
    while more:
        worker = os.fork()
        if worker == 0:
            work()
        _say(worker)
        code = os.waitstatus_to_exitcode(os.waitpid(worker, 0)[1])
        more = code != NO_JOB
        _say(code)


def _say(number: int) -> None:
    os.write(1, b"%d\n" % number)


def work() -> NoReturn:
    """Starts children, waits for a job on standard input, does it and ends."""
    os.setpgid(0, 0)
    end_with_parent()
    nursery = Nursery()
    request = _read_line(0)
    code = NO_JOB
    try:
        if request:
            with (Path(request).parent / "output.txt").open("wb") as output:
                os.dup2(output.fileno(), 1)
                os.dup2(output.fileno(), 2)
            code = 1
            do_job(Path(request), nursery)
            code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        nursery.close()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _read_line(descriptor: int) -> str:
    """A line without its end, read without buffering: the next one is not ours."""
    line = b""
    while not line.endswith(b"\n"):
        read = os.read(descriptor, 1)
        if not read:
            return ""
        line += read
    return line[:-1].decode()


def _warm_up() -> None:
    """Loads what is compiled."""
    cells = np.zeros((40, 60), np.bool_)
    env = Map2DEnv(map=cells, start=(10, 10), goal=(50, 30), robot_radius=3)
    env.reset(seed=0)
    env.step(np.zeros(2, np.float32))
    env.nominal.path_from(env.nominal.start)


def do_job(request: Path, nursery: Nursery) -> None:
    """Does a job of either kind, in its folder."""
    jobs = TypeAdapter[Job | SeededJob](Job | SeededJob)
    job = jobs.validate_json(request.read_text(encoding="utf-8"))
    os.chdir(request.parent)
    if isinstance(job, Job):
        judge_suite(job, nursery)
    else:
        judge_seeds(job, nursery)


def judge_suite(job: Job, nursery: Nursery) -> None:
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
    plugin = JudgePlugin(judge, profile=job.profile, paper=job.paper)
    judge.begin(jitters=not job.paper, own_loop=job.profile == "paper")
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
        *(word for name in UNUSED_PLUGINS for word in ("-p", f"no:{name}")),
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
    serve()
