"""The executor `ray`: tasks on an existing Ray cluster, or on a new local one.

All machines must share the campaign folder under the same path, and the environment of
Ray's processes must have the API keys.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Generator
from typing import Any

from tdac_agent.campaign.cores import own_core
from tdac_agent.campaign.executor import Begun, Ended, Next, RetryQueue, Update
from tdac_agent.campaign.perform import Outcome, Terms, perform
from tdac_agent.campaign.plan import PlannedRun
from tdac_agent.errors import Fault, ProviderError
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.core.extras import install_command

STORE_BYTES = 96 << 20
"""Object store of a local cluster; small, since runs exchange data as files."""
WAIT_SECONDS = 1.0


def run_on_ray(terms: Terms, next_run: Next) -> Generator[Update]:
    """Executes runs as Ray tasks of one CPU each, `terms.workers` at a time.

    Args:
        terms: Settings that all runs share.
        next_run: Returns the next run.

    Raises:
        ProviderError: Ray is not installed.
        Fault: Ray does not start, or cannot be reached.
    """
    ray = _start(terms.workers)
    # No retries by Ray: `RetryQueue` repeats a task whose process has died.
    task = ray.remote(num_cpus=1, max_retries=0)(_in_task)
    runs = RetryQueue(next_run)
    pending: dict[Any, PlannedRun] = {}
    try:
        while True:
            while len(pending) < terms.workers:
                planned = runs.next()
                if planned is None:
                    break
                pending[task.remote(planned, terms)] = planned
                yield Begun(planned)
            if not pending:
                return
            done, _ = ray.wait(list(pending), timeout=WAIT_SECONDS)
            for reference in done:
                yield _update(ray, reference, pending.pop(reference), runs)
    finally:
        for reference in pending:
            ray.cancel(reference, force=True)
        ray.shutdown()


def _update(ray: Any, reference: Any, planned: PlannedRun, runs: RetryQueue) -> Update:
    try:
        outcome: Outcome = ray.get(reference)
    except ray.exceptions.WorkerCrashedError as error:
        return runs.died(planned, " ".join(str(error).split())[:300])
    except ray.exceptions.RayError as error:
        reason = " ".join(str(error).split())[:300]
        return Ended(planned, Outcome(planned.name, "error", reason))
    return Ended(planned, outcome)


def _in_task(planned: PlannedRun, terms: Terms) -> Outcome:
    """Executes one run, in a process of Ray."""
    try:
        with own_core() as turn, WarmJudge(turn=turn) as judge:
            return perform(planned, terms, judge)
    except Fault as fault:
        return Outcome(planned.name, "error", str(fault))


def _start(workers: int) -> Any:
    """Returns Ray, connected to the cluster in `RAY_ADDRESS` or to a new local one."""
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
        ray.init(log_to_driver=False, logging_level=logging.ERROR, **options)
    except Exception as error:  # of many types; after 30 s a plain Exception
        reason = " ".join(str(error).split())[:300]
        raise Fault(f"Ray did not start: {reason}") from error
    return ray
