"""The executor `ray`: tasks on an existing Ray cluster, or on a new local one.

All machines must share the folder of the jobs under the same path, and Ray's processes
must have the API keys in their environment.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Generator
from contextlib import chdir, suppress
from importlib import import_module
from typing import Any

from tdac_agent.errors import Fault, ProviderError
from tdac_agent.executors.cores import own_core
from tdac_agent.executors.executor import (
    Ended,
    J,
    Next,
    O,
    RetryQueue,
    Started,
    Update,
    Work,
)
from tdac_agent.interpreter import make_safe
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.core.extras import install_command

STORE_BYTES = 96 << 20
"""Object store of a local cluster; small, since runs exchange data as files."""
WAIT_SECONDS = 1.0


def run_on_ray(work: Work[O], next_job: Next[J]) -> Generator[Update[J, O]]:
    """Executes jobs as Ray tasks of one CPU each, `work.workers` at a time.

    Args:
        work: What all jobs have in common.
        next_job: Returns the next job.

    Raises:
        ProviderError: Ray is not installed.
        Fault: Ray does not start, or cannot be reached.
    """
    ray = _start(work.workers)
    # No retries by Ray: `RetryQueue` repeats a task whose process has died.
    task = ray.remote(num_cpus=1, max_retries=0)(_in_task)
    jobs = RetryQueue(work, next_job)
    pending: dict[Any, J] = {}
    try:
        while True:
            while len(pending) < work.workers:
                job = jobs.next()
                if job is None:
                    break
                arguments = job.to_json(), work.module, work.terms, os.getcwd()
                pending[task.remote(*arguments)] = job
                yield Started(job)
            if not pending:
                return
            done, _ = ray.wait(list(pending), timeout=WAIT_SECONDS)
            for reference in done:
                yield _update(ray, reference, pending.pop(reference), jobs)
    finally:
        for reference in pending:
            ray.cancel(reference, force=True)
        ray.shutdown()


def _update(ray: Any, reference: Any, job: J, jobs: RetryQueue[J, O]) -> Update[J, O]:
    try:
        outcome, problem = ray.get(reference)
    except ray.exceptions.WorkerCrashedError as error:
        return jobs.died(job, " ".join(str(error).split())[:300])
    except ray.exceptions.RayError as error:
        outcome, problem = None, " ".join(str(error).split())[:300]
    if outcome is None:
        return Ended(job, jobs.work.failed(job.name, problem))
    return Ended(job, jobs.work.read(outcome))


def _in_task(
    job: str, module: str, terms: dict[str, Any], place: str
) -> tuple[dict[str, Any] | None, str]:
    """Executes one job in a process of Ray; the outcome, or why there is none."""
    with suppress(OSError):  # another machine may not have it
        os.chdir(place)
    try:
        perform_job = import_module(module).perform_job
        with own_core() as turn, WarmJudge(turn=turn) as judge:
            return perform_job(job, terms, judge, lambda _: None), ""
    except Fault as fault:
        return None, str(fault)


def _start(workers: int) -> Any:
    """Returns Ray, connected to the cluster in `RAY_ADDRESS` or to a new local one."""
    make_safe()
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    # By default Ray runs tasks at low priority, and the judge would starve.
    os.environ.setdefault("RAY_worker_niceness", "0")
    try:
        import ray
    except ImportError as error:
        raise ProviderError(
            f"--executor ray needs a package: {install_command('ray')}"
        ) from error
    local: dict[str, Any] = {
        "num_cpus": workers,
        "object_store_memory": STORE_BYTES,
        "include_dashboard": False,
    }
    options = {} if os.environ.get("RAY_ADDRESS") else local
    try:
        # Ray's processes take modules from the working directory of this moment.
        with chdir("/"):
            ray.init(log_to_driver=False, logging_level=logging.ERROR, **options)
    except Exception as error:  # of many types; after 30 s a plain Exception
        reason = " ".join(str(error).split())[:300]
        raise Fault(f"Ray did not start: {reason}") from error
    return ray
