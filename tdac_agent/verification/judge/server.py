"""The judge's process: pytest over a suite, away from the caller and hermetic.

Run by `tdac_agent.verification.judge.warm` as `python -m
tdac_agent.verification.judge.server`; the controller's code never runs here, only in
the sandboxed children that the judge starts.
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
from functools import partial
from math import inf
from pathlib import Path
from typing import Any, NoReturn

import cv2
import numpy as np

from tdac_agent.episodes.episode import Record, run_policy
from tdac_agent.sandbox.inner.decode import decode
from tdac_agent.sandbox.inner.encode import encode
from tdac_agent.tasks.registry import DEFAULT, environment, own_environments
from tdac_agent.tasks.task import load_task
from tdac_agent.verification.judge.children import Nursery
from tdac_agent.verification.judge.jobs import SUITE, Job
from tdac_agent.verification.judge.suite_episode import SuiteCrew, drive_known
from tdac_agent.verification.judge.suite_run import judge_suite
from tdac_agent.verification.judge.workers import Crew, end_with_parent
from tdac_agent.verification.suite.starts import spread_starts
from tdac_envs.core.code_cache import has_code
from tdac_envs.drive.env import Observation

FAREWELL_SECONDS = 1.0
# Exit codes of a worker; a suite may well end it with another one.
NO_JOB, DID_JOB = 77, 78
DONE = b"done"
# What a job loads when it needs it, unless there was time before.
LOADED_LATE = (
    "tdac_agent.verification.judge.findings",
    "tdac_agent.verification.judge.seeded",
)


def serve(nursery: Nursery | None = None, known: Path | None = None) -> None:
    """Forks one worker after another until there is no further job.

    Says of each worker its process id, and that its job is done. The worker itself
    says so, and clears up afterwards; one that could not is spoken for.

    Args:
        nursery: Of the first worker, which has a job at once; by default there is
            time to load all that a job needs.
        known: Folder of a task that is read ahead, where there is time.
    """
    # OpenCV's threads would not survive the fork.
    cv2.setNumThreads(1)
    # What a controller returned is told in messages, and may be long.
    np.set_printoptions(threshold=16, edgeitems=1)
    if nursery is None:
        nursery = Nursery()
        _rehearse()
        if known is not None:
            load_task(known)
        gc.collect()
    # What is alive now stays shared with the workers.
    gc.freeze()
    more = True
    while more:
        worker = os.fork()
        if worker == 0:
            work(nursery)
        _say(b"worker %d" % worker)
        code = os.waitstatus_to_exitcode(_status_of(worker))
        nursery.kill()
        more = code != NO_JOB
        if more:
            nursery = Nursery()
        if code != DID_JOB:
            _say(DONE)


def _status_of(worker: int) -> int:
    """Of a worker that has ended; one whose caller has gone has no more to do."""
    ended, tell = os.pipe()

    def wait() -> None:
        os.waitid(os.P_PID, worker, os.WEXITED | os.WNOWAIT)
        os.close(tell)

    # A process descriptor would do, but not every kernel and container gives one.
    waiting, watch = threading.Thread(target=wait, daemon=True), select.poll()
    waiting.start()
    watch.register(ended, 0)
    watch.register(0, 0)  # tells when nobody can write any more
    watch.poll()
    watch.unregister(0)
    # Without a job it ends by itself.
    if not watch.poll(1000 * FAREWELL_SECONDS):
        os.killpg(worker, signal.SIGKILL)
    waiting.join()  # the next fork should find a single thread
    os.close(ended)
    return os.waitpid(worker, 0)[1]


def _say(word: bytes, descriptor: int = 1) -> None:
    os.write(descriptor, word + b"\n")


def work(nursery: Nursery) -> NoReturn:
    """Prepares children, waits for a job on standard input, does it and ends."""
    os.setpgid(0, 0)
    end_with_parent()
    answers = os.dup(1)
    os.dup2(2, 1)
    # Nothing but what is worth while before the job has come.
    while not _is_readable(0) and nursery.prepare():
        continue
    crew = None
    if not _is_readable(0):
        # After the children, which its members share.
        crew = _ready_crew(nursery)
        _run_a_test()
    request = _read_line(0)
    code = NO_JOB
    try:
        with contextlib.ExitStack() as later:
            later.callback(nursery.close)
            if crew is not None:
                later.callback(crew.close)
            if request:
                with (Path(request).parent / "output.txt").open("wb") as output:
                    os.dup2(output.fileno(), 1)
                    os.dup2(output.fileno(), 2)
                code = 1
                do_job(Path(request), nursery, crew, later)
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


def _rehearse() -> None:
    """Loads what is compiled, and has pytest load what it needs for a suite."""
    for name in LOADED_LATE:
        importlib.import_module(name)
    # A job would wait for the compiling of an environment that it has no use for.
    for one in own_environments():
        if has_code(one.kernels):
            _rehearse_episode(one.small_env())
    _run_a_test()


def _rehearse_episode(env: Any) -> None:
    env.reset(seed=0)
    env.step(np.zeros(2, np.float32))
    env.nominal.path_from(env.nominal.start)
    spread_starts(env.nominal, 0, 1)


def _run_a_test() -> None:
    from tdac_agent.verification.judge.plugin import run_tests

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "test_nothing.py").write_text("def test_nothing(): pass\n")
        with contextlib.redirect_stdout(io.StringIO()):
            run_tests([folder], folder / "report.jsonl")


def _ready_crew(nursery: Nursery) -> SuiteCrew:
    """Processes that have used what an episode uses: forks share it until then."""
    work = partial(drive_known, nursery)
    return Crew(work, nursery.close, first=_drive_a_little)


def _drive_a_little() -> None:
    record = Record(environment(DEFAULT).small_env(), None, max_steps=20)
    rollout = run_policy(_Still(), record, "nominal", held_out=False, deadline=inf)
    pickle.dumps(rollout)


class _Still:
    """A policy of ours that does not move, and speaks as a child would."""

    def reset(self, observation: Observation) -> object:
        return self.policy(observation)

    def policy(self, observation: Observation) -> object:
        decode(encode(observation))
        return decode(encode((0.0, 0.0)))

    def waited(self) -> float:
        return 0.0


def do_job(
    request: Path,
    nursery: Nursery,
    crew: SuiteCrew | None,
    later: contextlib.ExitStack,
) -> None:
    """Does a job of either kind, in its folder; `later` is to be closed after it."""
    text = request.read_text(encoding="utf-8")
    os.chdir(request.parent)
    if json.loads(text)["kind"] == SUITE:
        judge_suite(Job.model_validate_json(text), nursery, crew, later)
    else:
        # It loads policies of all kinds.
        from tdac_agent.verification.judge.seeded import SeededJob, judge_seeds

        judge_seeds(SeededJob.model_validate_json(text), nursery)


if __name__ == "__main__":
    serve(known=Path(sys.argv[1]) if sys.argv[1:] else None)
