"""Robust verification: many disturbed episodes in, a success rate out."""

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
from tdac_agent.evaluation.seeded_run import run_seeds
from tdac_agent.sandbox import Limits
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.installation import seed_of
from tdac_agent.tasks.provenance import origin
from tdac_agent.tasks.task import Task, lay_out
from tdac_agent.verification.judge.contenders import Contender
from tdac_agent.verification.judge.seeded import SeededEpisode, SeededJob
from tdac_agent.verification.judge.sequential import (
    MARGIN,
    MOST_EPISODES,
    SequentialTest,
)
from tdac_agent.verification.judge.warm import WarmJudge
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
    """Counts how often a controller reaches the goal when it is disturbed.

    Each episode depends on the task, the disturbance and its seed alone, and has a
    fresh process. The suite is not run; see `verify`.

    Args:
        controller: Path of the file, or its source (text of several lines, or bytes).
        task: What it must do.
        episodes: How many; with `accept_at`, how many at most.
        disturbance: Of the environment.
        first_seed: The episodes have this seed and the following ones; by default one
            that no author can know, as for `verify`.
        accept_at: Stop as soon as a sequential test decides whether the success rate
            is at least this, or at most `margin` less; then there is no interval.
        margin: See `accept_at`.
        tier: Sandbox tier, `auto` for the best one here.
        limits: Of the controller's process in each episode, `cpu_seconds` too.
        out: Folder for `robust.json`; none by default.
        judge: A warm one; one of its own by default.
        watch: Called now and then with the number of episodes and of successes.

    Raises:
        ControllerFileError: The file cannot be read.
        TaskError: A number makes no sense.
        Fault: The sandbox is broken: neither pass nor fail.
    """
    began = time.monotonic()
    whole_number("episodes", episodes, 1, MOST_EPISODES)
    if first_seed is not None:
        whole_number("first seed", first_seed, 0)
    test = None if accept_at is None else SequentialTest(accept_at, episodes, margin)
    source = read_source(controller)
    first = seed_of(source, task) if first_seed is None else first_seed
    with tempfile.TemporaryDirectory(prefix="tdac-robust-") as name:
        folder = Path(name)
        controller_file = folder / "controller.py"
        write_atomic(controller_file, source)
        job = SeededJob(
            task=lay_out(task, folder / "work"),
            contender=Contender("controller", controller_file),
            disturbance=disturbance or Disturbance(),
            variation="jitter",
            seeds=tuple(range(first, first + episodes)),
            test=test,
            measured=False,
            tier=tier,
            limits=limits or Limits(),
            out=folder / "results",
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
