"""The judge's server, which forks a worker for each job.

Run by `tdac_agent.verification.judge.warm` as `python -m
tdac_agent.verification.judge.server`. A worker runs a suite with pytest, isolated from
the caller. The controller's code runs only in sandboxed children.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import io
import json
import os
import pickle
import select
import signal
import sys
import tempfile
import threading
import traceback
from collections.abc import Iterator
from functools import partial
from math import inf
from pathlib import Path
from typing import Any, NoReturn

import cv2
import numpy as np

from tdac_agent.episodes.episode import Record, run_policy
from tdac_agent.sandbox.inner.decode import decode
from tdac_agent.sandbox.inner.encode import encode
from tdac_agent.tasks.registry import DEFAULT, OWN, environment
from tdac_agent.tasks.task import read_task
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.jobs import SUITE, Job
from tdac_agent.verification.judge.suite_episode import SuitePool, drive_known
from tdac_agent.verification.judge.suite_run import judge_suite
from tdac_agent.verification.judge.worker_pool import WorkerPool, end_with_parent
from tdac_agent.verification.suite.starts import spread_starts
from tdac_envs.core.code_cache import has_code
from tdac_envs.drive.env import Observation

EXIT_SECONDS = 1.0
# Exit codes of a worker; a suite may end it with any other code.
NO_JOB, DID_JOB = 77, 78
# Answers to a request; the server gives the second one for a worker that has died.
DONE, DIED = b"done", b"died"
# Imported when a job needs them, or earlier if there is time.
LOADED_LATE = (
    "tdac_agent.verification.judge.findings",
    "tdac_agent.verification.judge.episode_job",
    "tdac_agent.verification.judge.series",
)
# The same, unless the judge is for a task: its controllers need neither.
LOADED_FOR_ALL = (
    "tdac_agent.verification.judge.drivers",
    "tdac_agent.verification.judge.set_worlds",
)


def serve(child_pool: ChildPool | None = None, known: Path | None = None) -> None:
    """Forks one worker after another until there is no further job.

    Writes the process id of each worker, and a line when a job of it is done. The
    worker writes that line itself, before it cleans up; the server writes another one
    if the worker has died.

    Args:
        child_pool: Child pool of the first worker, whose job is due at once. By default
            the server makes one, and first loads everything that a job needs.
        known: Folder of the task of most jobs; only used without `child_pool`.
    """
    # OpenCV's threads would not survive the fork.
    cv2.setNumThreads(1)
    # Messages quote what a controller returned, which may be long.
    np.set_printoptions(threshold=16, edgeitems=1)
    if child_pool is None:
        child_pool = ChildPool()
        _warm_up(known)
        gc.collect()
    # Keeps the memory of existing objects shared with the workers.
    gc.freeze()
    more = True
    while more:
        worker = os.fork()
        if worker == 0:
            work(child_pool)
        _write_line(b"worker %d" % worker)
        code = os.waitstatus_to_exitcode(_status_of(worker))
        child_pool.kill()
        more = code != NO_JOB
        if more:
            child_pool = ChildPool()
        if code != DID_JOB:
            _write_line(DIED)


def _status_of(worker: int) -> int:
    """Waits for a worker to end, killing it if the caller ends; returns its status."""
    ended, writer = os.pipe()

    def wait() -> None:
        os.waitid(os.P_PID, worker, os.WEXITED | os.WNOWAIT)
        os.close(writer)

    # A pidfd would be simpler, but not every kernel and container provides one.
    waiting, watch = threading.Thread(target=wait, daemon=True), select.poll()
    waiting.start()
    watch.register(ended, 0)
    watch.register(0, 0)  # reports when the caller has closed its end
    watch.poll()
    watch.unregister(0)
    # A worker without a job ends by itself.
    if not watch.poll(1000 * EXIT_SECONDS):
        os.killpg(worker, signal.SIGKILL)
    waiting.join()  # back to a single thread before the next fork
    os.close(ended)
    return os.waitpid(worker, 0)[1]


def _write_line(text: bytes, descriptor: int = 1) -> None:
    os.write(descriptor, text + b"\n")


def work(child_pool: ChildPool) -> NoReturn:
    """Prepares children, waits for a job on standard input, runs it and exits."""
    os.setpgid(0, 0)
    end_with_parent()
    answers = os.dup(1)
    os.dup2(2, 1)
    # Prepares only until the job arrives.
    while not _is_readable(0) and child_pool.prepare():
        continue
    worker_pool = None
    if not _is_readable(0):
        # Forked after the children, which its processes share.
        worker_pool = _ready_worker_pool(child_pool)
        _run_empty_suite()
    request = _read_line(0)
    code = NO_JOB
    try:
        with contextlib.ExitStack() as later:
            later.callback(child_pool.close)
            if worker_pool is not None:
                later.callback(worker_pool.close)
            if request:
                with (Path(request).parent / "output.txt").open("wb") as output:
                    os.dup2(output.fileno(), 1)
                    os.dup2(output.fileno(), 2)
                code = 1
                further = _further(answers)
                do_job(Path(request), child_pool, worker_pool, later, further)
                code = DID_JOB
                _flush()
                _write_line(DONE, answers)
    except BaseException:
        traceback.print_exc()
    finally:
        _flush()
        os._exit(code)


def _further(answers: int) -> Iterator[Path]:
    """Further requests of a series, up to an empty line; answers the one before."""
    while True:
        _flush()
        _write_line(DONE, answers)
        request = _read_line(0)
        if not request:
            return
        yield Path(request)


def _flush() -> None:
    sys.stdout.flush()
    sys.stderr.flush()


def _is_readable(descriptor: int) -> bool:
    return bool(select.select([descriptor], [], [], 0.0)[0])


def _read_line(descriptor: int) -> str:
    """Reads a line without buffering, since the next one is for another worker."""
    line = b""
    while not line.endswith(b"\n"):
        read = os.read(descriptor, 1)
        if not read:
            return ""
        line += read
    return line[:-1].decode()


def _warm_up(known: Path | None) -> None:
    """Loads compiled code, and everything that pytest needs for a suite.

    Args:
        known: Folder of the task of most jobs, if there is one; what others need is
            left out.
    """
    for name in LOADED_LATE if known else LOADED_LATE + LOADED_FOR_ALL:
        importlib.import_module(name)
    used = [read_task(known).setting.nominal.env_id] if known else [*OWN]
    # Without compiling: a job would wait for an environment that it may not use.
    for one in (environment(env_id) for env_id in used if env_id in OWN):
        if has_code(one.kernels):
            _warm_up_episode(one.small_env())
    _run_empty_suite()


def _warm_up_episode(env: Any) -> None:
    env.reset(seed=0)
    env.step(np.zeros(2, np.float32))
    env.nominal.path_from(env.nominal.start)
    spread_starts(env.nominal, 0, 1)


def _run_empty_suite() -> None:
    from tdac_agent.verification.judge.plugin import run_tests

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "test_nothing.py").write_text("def test_nothing(): pass\n")
        with contextlib.redirect_stdout(io.StringIO()):
            run_tests([folder], folder / "report.jsonl")


def _ready_worker_pool(child_pool: ChildPool) -> SuitePool:
    """A worker pool whose processes have already driven some steps."""
    work = partial(drive_known, child_pool)
    return WorkerPool(work, child_pool.close, first=_drive_some_steps)


def _drive_some_steps() -> None:
    record = Record(environment(DEFAULT).small_env(), None, max_steps=20)
    rollout = run_policy(_Still(), record, "nominal", held_out=False, deadline=inf)
    pickle.dumps(rollout)


class _Still:
    """A policy that stands still, and encodes its values as a child does."""

    def reset(self, observation: Observation) -> object:
        return self.policy(observation)

    def policy(self, observation: Observation) -> object:
        decode(encode(observation))
        return decode(encode((0.0, 0.0)))

    def waited(self) -> float:
        return 0.0


def do_job(
    request: Path,
    child_pool: ChildPool,
    worker_pool: SuitePool | None,
    later: contextlib.ExitStack,
    further: Iterator[Path],
) -> None:
    """Runs a job of any kind in its folder; the caller closes `later` after it.

    Args:
        request: File with the job.
        child_pool: The child pool.
        worker_pool: The worker pool of a suite.
        later: What ends after the job.
        further: Requests that follow, if the job is the first one of a series.
    """
    # raw read: our temporary folder
    job = json.loads(request.read_text(encoding="utf-8"))
    os.chdir(request.parent)
    if job["kind"] == SUITE:
        judge_suite(Job.model_validate(job), child_pool, worker_pool, later)
    else:
        # Imported late, since it loads policies of all kinds.
        from tdac_agent.verification.judge.episode_job import EpisodeJob, judge_episodes
        from tdac_agent.verification.judge.series import judge_series

        first = EpisodeJob.model_validate(job)
        if first.series:
            # raw read: our temporary folder
            texts = (each.read_text(encoding="utf-8") for each in further)
            jobs = map(EpisodeJob.model_validate_json, texts)
            judge_series(first, child_pool, jobs)
        else:
            judge_episodes(first, child_pool)


if __name__ == "__main__":
    serve(known=Path(sys.argv[1]) if sys.argv[1:] else None)
