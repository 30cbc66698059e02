"""Robust verification: the success rate over many disturbed episodes."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from tdac_agent.evaluation.robust_report import (
    RobustProvenance,
    RobustReport,
    summarise,
)
from tdac_agent.sandbox import Limits
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.links import refuse_links
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.installation import seed_of
from tdac_agent.tasks.provenance import origin
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.seeded import SeededEpisode
from tdac_agent.verification.judge.sequential import (
    MARGIN,
    MOST_EPISODES,
    SequentialTest,
)
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.seeded_run import controller_job, run_seeds
from tdac_agent.verification.verify import read_source
from tdac_envs.core.arguments import whole_number

EPISODES = 200


def verify_robust(
    controller: str | bytes | Path,
    task: Task,
    episodes: int = EPISODES,
    *,
    disturbance: Disturbance | None = None,
    first_seed: int | None = None,
    accept_at: float | None = None,
    margin: float = MARGIN,
    tier: str = "auto",
    limits: Limits | None = None,
    out: Path | None = None,
    judge: WarmJudge | None = None,
    watch: Callable[[int, int], None] | None = None,
) -> RobustReport:
    """Measures how often a controller reaches the goal under disturbances.

    Each episode depends only on the task, the disturbance and its seed, and has a
    fresh process. The test suite is not run; see `verify`.

    Args:
        controller: Path of the file, or its source (text of several lines, or bytes).
        task: What it must do.
        episodes: Number of episodes; with `accept_at`, the maximum.
        disturbance: Disturbance of the environment.
        first_seed: Seed of the first episode; the following episodes count up from it.
            By default the author of a controller cannot predict it, as for `verify`.
        accept_at: Stops as soon as a sequential test decides whether the success rate
            is at least `accept_at`, or at most `accept_at - margin`. The report then
            has no rate and no interval.
        margin: See `accept_at`.
        tier: Sandbox tier; `auto` for the best one on this machine.
        limits: Limits of the controller's process, `cpu_seconds` too, in each episode.
        out: Folder for `robust.json`; by default nothing is written.
        judge: A warm judge; None starts one for this call.
        watch: Called repeatedly with the numbers of episodes and successes so far.

    Raises:
        ControllerFileError: The file cannot be read.
        TaskError: A number is invalid, or the environment does not have a part of the
            disturbance.
        Fault: The sandbox is broken; the controller neither passes nor fails.
        RunError: A link leads out of `out`, where the report is written.
    """
    began = time.monotonic()
    if out is not None:
        refuse_links(out, "robust.json")
    whole_number("episodes", episodes, 1, MOST_EPISODES)
    disturbance = disturbance or Disturbance()
    task.disturbed_options(disturbance)
    if first_seed is not None:
        whole_number("first seed", first_seed, 0)
    test = None if accept_at is None else SequentialTest(accept_at, episodes, margin)
    source = read_source(controller)
    first = seed_of(source, task) if first_seed is None else first_seed
    with tempfile.TemporaryDirectory(prefix="tdac-robust-") as name:
        job = controller_job(
            Path(name),
            source,
            task,
            disturbance,
            range(first, first + episodes),
            tier=tier,
            limits=limits,
            test=test,
        )
        ended, ending = run_seeds(job, task.nominal, SeededEpisode, judge, watch)
        provenance = RobustProvenance(
            **origin(task, source, job.task, ending.tier, job.limits),
            disturbance=job.disturbance,
            first_seed=first,
        )
    report = summarise(provenance, ended, test, time.monotonic() - began)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        write_atomic(out / "robust.json", report.model_dump_json(indent=2) + "\n")
    return report
