"""The judge's process: pytest over a suite, away from the caller and hermetic.

Run by `tdac_agent.warm` as `python -m tdac_agent.judging`; the controller's code never
runs here, only in the sandboxed children that the judge starts.
"""

from __future__ import annotations

import contextlib
import gc
import io
import os
import select
import sys
import tempfile
import traceback
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NoReturn

import cv2
import gymnasium as gym
import numpy as np
import pytest
from pydantic import TypeAdapter

from tdac_agent.crew import end_with_parent
from tdac_agent.diagnosis import diagnose
from tdac_agent.files import write_atomic
from tdac_agent.jobs import Findings, Job
from tdac_agent.judge import Judge
from tdac_agent.nursery import Nursery
from tdac_agent.report import Episode
from tdac_agent.seeded import SeededJob, judge_seeds
from tdac_agent.suite_plugin import JudgePlugin, rollout_key
from tdac_agent.task import Task, load_task
from tdac_agent.trajectory import Rollout
from tdac_envs.map2d import Map2DEnv

# Exit codes of a worker; a suite may well end it with another one.
NO_JOB, DID_JOB = 77, 78
DONE = b"done"
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


def serve(*, rehearse: bool = True) -> None:
    """Forks one worker after another until there is no further job.

    Says of each worker its process id, and that its job is done. The worker itself
    says so, and clears up afterwards; one that could not is spoken for.

    Args:
        rehearse: Whether there is time before the first job.
    """
    # OpenCV's threads would not survive the fork.
    cv2.setNumThreads(1)
    nursery = Nursery()
    _warm_up()
    if rehearse:
        _rehearse()
        gc.collect()
    # What is alive now stays shared with the workers.
    gc.freeze()
    more = True
    while more:
        worker = os.fork()
        if worker == 0:
            work(nursery)
        _say(b"worker %d" % worker)
        code = os.waitstatus_to_exitcode(os.waitpid(worker, 0)[1])
        nursery.kill()
        more = code != NO_JOB
        if more:
            nursery = Nursery()
        if code != DID_JOB:
            _say(DONE)


def _say(word: bytes, descriptor: int = 1) -> None:
    os.write(descriptor, word + b"\n")


def work(nursery: Nursery) -> NoReturn:
    """Prepares children, waits for a job on standard input, does it and ends."""
    os.setpgid(0, 0)
    end_with_parent()
    while not _is_readable(0) and nursery.prepare():
        continue
    request = _read_line(0)
    code, answers = NO_JOB, os.dup(1)
    try:
        with contextlib.ExitStack() as later:
            later.callback(nursery.close)
            if request:
                with (Path(request).parent / "output.txt").open("wb") as output:
                    os.dup2(output.fileno(), 1)
                    os.dup2(output.fileno(), 2)
                code = 1
                do_job(Path(request), nursery, later)
                code = DID_JOB
                _flush()
                _say(DONE, answers)
    except BaseException:
        traceback.print_exc()
    finally:
        _flush()
        os._exit(code)


def _flush() -> None:
    sys.stdout.flush()
    sys.stderr.flush()


def _is_readable(descriptor: int) -> bool:
    return bool(select.select([descriptor], [], [], 0.0)[0])


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


def _rehearse() -> None:
    """Loads what else is compiled, and has pytest load what it needs for a suite."""
    world = gym.make("tdac_envs:TDAC-EPuck-v0")
    world.reset(seed=0)
    world.step(np.zeros(2, np.float32))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "test_nothing.py").write_text("def test_nothing(): pass\n")
        with contextlib.redirect_stdout(io.StringIO()):
            pytest.main(_arguments([folder], folder / "report.jsonl"))


def do_job(request: Path, nursery: Nursery, later: contextlib.ExitStack) -> None:
    """Does a job of either kind, in its folder; `later` is to be closed after it."""
    jobs = TypeAdapter[Job | SeededJob](Job | SeededJob)
    job = jobs.validate_json(request.read_text(encoding="utf-8"))
    os.chdir(request.parent)
    if isinstance(job, Job):
        judge_suite(job, nursery, later)
    else:
        judge_seeds(job, nursery)


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
    plugin = JudgePlugin(judge, profile=job.profile, paper=job.paper)
    judge.begin(jitters=not job.paper, own_loop=job.profile == "paper")
    pytest.main(_arguments(job.suites, job.out / "report.jsonl"), plugins=[plugin])
    judge.settle()
    folder = job.out / "trajectories"
    folder.mkdir(exist_ok=True)
    with ThreadPoolExecutor() as pool:  # most of it is compression
        for rollout in judge.rollouts.values():
            if rollout.returned is None and rollout.trajectory.steps:
                name = rollout.name.replace(" ", "_")
                pool.submit(rollout.trajectory.save, folder / f"{name}.npz")
        findings = _findings(task, judge, plugin).model_dump_json()
    write_atomic(job.out / "findings.json", findings)


def _arguments(suites: list[Path], log: Path) -> list[str]:
    root = suites[0].parent
    return [
        *(str(folder) for folder in suites),
        f"--rootdir={root}",
        f"--confcutdir={root}",
        "-c",
        os.devnull,
        "-p",
        "pytest_reportlog.plugin",
        f"--report-log={log}",
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
