"""Verifies a controller on a task set: worlds that it has never seen."""

from __future__ import annotations

import hashlib
import json
import math
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from tdac_agent.evaluation.seeded_run import run_job
from tdac_agent.evaluation.set_report import SetProvenance, SetReport, summarise
from tdac_agent.sandbox import CONFINING, Limits
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.first_run import compile_first
from tdac_agent.tasks.provenance import sha256_of, versions
from tdac_agent.tasks.registry import environment
from tdac_agent.verification.judge.sequential import SequentialTest
from tdac_agent.verification.judge.set_job import SetJob, WorldEpisode
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify import read_source
from tdac_envs.core.arguments import one_of, whole_number
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.source import read_salt
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.map2d.task import Map2DTask

MOST_WORLDS = 400
"""Worlds after which a sequential test is undecided."""
MOST_EPISODES = 100_000
JUDGED = ("dev", "test", "hidden")


def verify_on_set(
    controller: str | bytes | Path,
    tasks: TaskSet,
    split: str = "test",
    worlds: int | None = None,
    *,
    first: int = 0,
    salt_file: Path | None = None,
    tier: str = "auto",
    out: Path | None = None,
    judge: WarmJudge | None = None,
    watch: Callable[[int, int], None] | None = None,
) -> SetReport:
    """Drives a controller on the worlds of a split, from world `first` on.

    Each episode has a fresh sandboxed process, which is told neither split nor number.

    Args:
        controller: Path of the file, or its source (text of several lines, or bytes).
        tasks: The task set.
        split: `dev`, `test` or `hidden`.
        worlds: Number of worlds, for scores. By default a sequential test of the set's
            bar decides when to stop; then there are no scores.
        first: Number of the first world.
        salt_file: File with the salt of the split `hidden`.
        tier: Sandbox tier; `auto` for the best one on this machine.
        out: Folder for `set.json` and, unless the split is hidden, `trajectories/`.
        judge: A warm judge; None starts one for this call.
        watch: Called repeatedly with the numbers of episodes and successes so far.

    Raises:
        ControllerFileError: The file cannot be read.
        TaskError: An argument is not valid.
        Fault: The sandbox is broken; the controller neither passes nor fails.
    """
    began = time.monotonic()
    one_of("split", split, JUDGED)
    if worlds is not None:
        whole_number("worlds", worlds, 1, MOST_EPISODES)
    whole_number("first", first, 0)
    salt = None if salt_file is None else read_salt(salt_file)
    tasks.key(split, 0, "world", salt)  # checks that salt and split belong together
    source, told = read_source(controller), split != "hidden"
    if not told and tier not in ("auto", *(each.name for each in CONFINING)):
        raise TaskError(
            f"the sandbox tier {tier!r} cannot keep a controller from reading files, "
            "and so not from hidden worlds; leave out --tier"
        )
    test = SequentialTest(tasks.file.bar, MOST_WORLDS) if worlds is None else None
    count = MOST_WORLDS if worlds is None else worlds
    compile_first(environment(Map2DTask.env_id))
    with tempfile.TemporaryDirectory(prefix="tdac-set-") as name:
        folder = Path(name)
        job = SetJob(
            set_file=_written(tasks, folder / "set.yaml"),
            split=split,
            salt_file=None if salt_file is None else salt_file.resolve(),
            worlds=tuple(range(first, first + count)),
            controller=folder / "controller.py",
            test=test,
            told=told,
            tier=tier,
            limits=limits_of(tasks),
            out=folder / "results",
            trajectories=folder / "trajectories" if out is not None and told else None,
        )
        write_atomic(job.controller, source)
        longest = tasks.file.horizon.most * tasks.file.dt * len(job.worlds)
        ended, ending = run_job(job, job.out, longest, WorldEpisode, judge, watch)
        provenance = SetProvenance(
            set=tasks.name,
            set_sha256=tasks.sha256,
            split=split,
            salt_sha256=None if salt is None else hashlib.sha256(salt).hexdigest(),
            controller_sha256=sha256_of(source),
            sandbox=ending.tier,
            limits=asdict(job.limits),
            versions=dict(versions()),
        )
        seconds = time.monotonic() - began
        report = summarise(provenance, ended, test, seconds, told=told)
        if out is not None:
            _keep(report, job.trajectories, out)
    return report


def limits_of(tasks: TaskSet) -> Limits:
    """The limits of an episode's process; the CPU budget ends most episodes before."""
    cpu = tasks.file.cpu
    most = cpu.start + cpu.of_steps(tasks.file.horizon.most)
    return Limits(cpu_seconds=math.ceil(2.0 * most) + 1)


def _written(tasks: TaskSet, path: Path) -> Path:
    values = tasks.file.model_dump(mode="json", by_alias=True)
    path.write_text(json.dumps(values), encoding="utf-8")  # JSON is YAML
    return path


def _keep(report: SetReport, trajectories: Path | None, out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    write_atomic(out / "set.json", report.model_dump_json(indent=2) + "\n")
    if trajectories is None or not trajectories.is_dir():
        return
    kept = out / "trajectories"
    kept.mkdir(exist_ok=True)
    for path in sorted(trajectories.iterdir()):
        write_atomic(kept / path.name, path.read_bytes())
