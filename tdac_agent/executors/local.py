"""The executor `local`: worker processes on this machine."""

from __future__ import annotations

import json
import os
import selectors
import signal
import subprocess
import time
from collections.abc import Generator, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import IO, Any

from tdac_agent.executors.cores import core_locks
from tdac_agent.executors.executor import (
    Ended,
    Executor,
    ExecutorJob,
    J,
    Next,
    O,
    Reported,
    RetryQueue,
    Started,
    Update,
    Work,
)
from tdac_agent.interpreter import python, safe_environment

ERRORS = "errors.log"
EXIT_SECONDS = 15.0
"""Time for interrupted workers to save their progress."""
MOST_JOBS = 500
"""Maximum number of jobs of one process, in case its memory grows."""
CHUNK = 1 << 16
LIBRARIES = ("OMP", "OPENBLAS", "MKL", "NUMEXPR", "NUMBA", "VECLIB_MAXIMUM")
ONE_THREAD = [f"{name}_NUM_THREADS" for name in LIBRARIES]


@dataclass(slots=True, eq=False)
class _Worker:
    """A worker process, and its current job."""

    process: subprocess.Popen[bytes]
    job: Any = None
    jobs: int = 0
    reported_death: str = ""
    _partial: bytes = b""

    @property
    def answers(self) -> IO[bytes]:
        assert self.process.stdout is not None
        return self.process.stdout

    def begin(self, job: ExecutorJob) -> None:
        """Sends a job; a dead process is noticed when its answers are read."""
        assert self.process.stdin is not None
        self.job = job
        self.jobs += 1
        with suppress(BrokenPipeError):
            self.process.stdin.write(job.to_json().encode() + b"\n")
            self.process.stdin.flush()

    def messages(self) -> list[dict[str, Any]] | None:
        """Reads new messages; None if the process has ended."""
        raw = os.read(self.answers.fileno(), CHUNK)
        *lines, self._partial = (self._partial + raw).split(b"\n")
        return [json.loads(line) for line in lines] if raw else None

    @property
    def death(self) -> str:
        """Why the process ended, by its own report if it sent one."""
        code = self.process.returncode
        if self.reported_death:
            return self.reported_death
        if code < 0:
            return f"killed by {signal.Signals(-code).name}"
        return f"ended with exit code {code}; see {ERRORS}"

    def end(self) -> None:
        """Closes its input, at which an idle process ends, and waits for it."""
        assert self.process.stdin is not None
        with suppress(BrokenPipeError):
            self.process.stdin.close()
        self.process.wait()
        self.answers.close()


@dataclass(slots=True)
class _Pool:
    """All workers."""

    work: Work[Any]
    errors: IO[bytes]
    selector: selectors.BaseSelector = field(default_factory=selectors.DefaultSelector)

    @property
    def workers(self) -> list[_Worker]:
        return [key.data for key in self.selector.get_map().values()]

    @property
    def busy(self) -> list[_Worker]:
        return [worker for worker in self.workers if worker.job is not None]

    def idle(self) -> _Worker | None:
        """An idle worker, or a new one; None if all workers are busy."""
        for worker in self.workers:
            if worker.job is None and worker.jobs < MOST_JOBS:
                return worker
            if worker.job is None:
                self.dismiss(worker)
        if len(self.workers) < self.work.workers:
            return self._start()
        return None

    def dismiss(self, worker: _Worker) -> None:
        self.selector.unregister(worker.answers)
        worker.end()

    def _start(self) -> _Worker:
        arguments = [str(os.getpid()), self.work.module, json.dumps(self.work.terms)]
        process = subprocess.Popen(
            python("-m", "tdac_agent.executors.worker", *arguments),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.errors,
            env=safe_environment() | dict.fromkeys(ONE_THREAD, "1"),
            # Ctrl-C interrupts only the driver, which passes it on.
            start_new_session=True,
        )
        worker = _Worker(process)
        self.selector.register(worker.answers, selectors.EVENT_READ, worker)
        return worker

    def close(self) -> None:
        """Interrupts busy workers, kills late ones, and waits until all have ended."""
        for worker in self.busy:
            worker.process.send_signal(signal.SIGINT)
        deadline = time.monotonic() + EXIT_SECONDS
        for worker in self.workers:
            if worker.job is not None:
                with suppress(subprocess.TimeoutExpired):
                    worker.process.wait(max(0.0, deadline - time.monotonic()))
                worker.process.kill()
            self.dismiss(worker)
        self.selector.close()


def run_locally(work: Work[O], next_job: Next[J]) -> Generator[Update[J, O]]:
    """Executes jobs in worker processes, `work.workers` at a time.

    Args:
        work: What all jobs have in common.
        next_job: Returns the next job.

    Raises:
        Fault: There is no private folder for the core locks.
    """
    core_locks()  # fails here once instead of in every worker
    jobs = RetryQueue(work, next_job)
    with (work.folder / ERRORS).open("ab") as errors:
        pool = _Pool(work, errors)
        try:
            yield from _hand_out(pool, jobs)
            while pool.busy:
                for key, _ in pool.selector.select():
                    yield from _receive(pool, key.data, jobs)
                yield from _hand_out(pool, jobs)
        finally:
            pool.close()


def _hand_out(pool: _Pool, jobs: RetryQueue[J, O]) -> Iterator[Update[J, O]]:
    """Gives each idle worker a job, while there are jobs."""
    while len(pool.busy) < pool.work.workers:
        job = jobs.next()
        worker = None if job is None else pool.idle()
        if job is None or worker is None:
            return
        worker.begin(job)
        yield Started(job)


def _receive(
    pool: _Pool, worker: _Worker, jobs: RetryQueue[J, O]
) -> Iterator[Update[J, O]]:
    """The updates in a worker's messages, or its death."""
    job, messages = worker.job, worker.messages()
    if messages is None:
        pool.dismiss(worker)
        if job is not None:
            yield jobs.died(job, worker.death)
        return
    for message in messages:
        if "death" in message:
            worker.reported_death = message["death"]
            continue
        assert job is not None
        if "outcome" in message:
            worker.job = None
            yield Ended(job, jobs.work.read(message["outcome"]))
        else:
            yield Reported(job, message["record"])


def executor_of(name: str) -> Executor[Any, Any]:
    """The executor `local` or `ray`."""
    if name == "ray":
        from tdac_agent.executors.on_ray import run_on_ray  # an extra

        return run_on_ray
    return run_locally
