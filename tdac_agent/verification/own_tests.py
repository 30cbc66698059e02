"""Runs the user's own tests of a controller for a task set.

They run together with the static and contract tests, before the controller drives on
worlds. What needs a world drives in the first public one of the set.
"""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from tdac_agent.problems.set_episodes import OfSet
from tdac_agent.sandbox import Limits
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.storage.links import refuse_links
from tdac_agent.tasks.installation import seed_from
from tdac_agent.tasks.provenance import versions
from tdac_agent.verification.diagnosis.report import (
    OWN,
    Failure,
    Provenance,
    Report,
    group_of,
)
from tdac_agent.verification.judge.jobs import Findings, Job
from tdac_agent.verification.judge.report_log import verdict_of
from tdac_agent.verification.judge.set_checks import id_of
from tdac_agent.verification.judge.set_files import write_files, write_set
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.judge.worlds import public_split
from tdac_agent.verification.verify import (
    WRITTEN,
    judged,
    keep,
    read_source,
    report_in,
    suite_folder,
    tests_sha256,
)
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.task_sets import TaskSet

LEVEL = "set"
"""Name of the tests that all controllers for task sets must pass."""


def run_own_tests(
    controller: str | bytes | Path,
    tasks: TaskSet,
    suite: Path,
    *,
    tier: str = "auto",
    seed: int | None = None,
    limits: Limits | None = None,
    out: Path | None = None,
    judge: WarmJudge | None = None,
    meanwhile: Callable[[], None] | None = None,
) -> Report:
    """Runs the static and contract tests of a task set, and the user's own.

    Args:
        controller: Path of the file, or its source (text of several lines, or bytes).
        tasks: The task set.
        suite: Folder of the user's own tests, which may run.
        tier: Sandbox tier; `auto` for the best one on this machine.
        seed: Seed of what tests draw; by default as on a task.
        limits: Limits of the controller's processes; `cpu_seconds` is the total.
        out: Folder for `report.json` and `trajectories/`.
        judge: A warm judge; None starts one for this call.
        meanwhile: Called repeatedly while the judge works.

    Raises:
        ControllerFileError: The file cannot be read, or the folder has no tests.
        TaskError: The set has no public world.
        Fault: The sandbox or a test is broken; this is neither pass nor fail.
        RunError: A link leads out of `out`, where the results are written.
    """
    began, split = time.monotonic(), public_split(tasks)
    if split is None:
        raise TaskError(
            f"{tasks.name} has no public world in which your tests could drive: leave "
            "out --suite"
        )
    if out is not None:
        refuse_links(out, *WRITTEN)
    source, suites = read_source(controller), {OWN: suite_folder(suite)}
    own = OfSet(tasks)
    own.compile()
    drawn = seed_from(source, tasks.sha256) if seed is None else seed
    with contextlib.ExitStack() as stack:
        warm = judge or stack.enter_context(WarmJudge())
        made = tempfile.TemporaryDirectory(prefix="tdac-tests-", dir=warm.folder)
        folder = Path(stack.enter_context(made))
        job = Job(
            task=folder / "work",
            controller=folder / "controller.py",
            suites=[folder / "suites" / OWN],
            profile="policy",
            paper=True,  # a set has no jittered starts
            tier=tier,
            seed=drawn,
            limits=limits or _limits(own),
            out=folder / "results",
            trajectories=None if out is None else folder / "trajectories",
            set_file=write_set(tasks, folder / "set.yaml"),
            split=split,
        )
        job.task.mkdir()
        write_files(job.task, tasks.file, tasks.task(split, 0))
        found, tests, failures = judged(job, source, suites, warm, meanwhile)
        names = {name: id_of(name) for name in found.checks}
        checked = {names[n]: _outcome(why) for n, why in found.checks.items()}
        tests = checked | tests
        refused = [
            Failure(test=names[n], group=group_of(names[n]), message=why)
            for n, why in found.checks.items()
            if why is not None
        ]
        report = Report(
            verdict=verdict_of(tests),
            provenance=_provenance(tasks, source, job, suites[OWN], found),
            failures=(*refused, *failures),
            tests=tests,
            episodes=tuple(found.episodes),
            child_cpu_seconds=found.child_cpu_seconds,
            seconds=round(time.monotonic() - began, 3),
        )
        if out is not None:
            keep(report, folder / "trajectories", out)
    return report


def kept_tests(
    folder: Path, tasks: TaskSet, suite: Path, source: bytes, seed: int | None
) -> Report | None:
    """The report in a folder if it is of the same tests, otherwise None."""
    wanted = {
        "controller_sha256": sha256_of(source),
        "task_sha256": tasks.sha256,
        "dynamics": tasks.dynamics,
        "suite_sha256": tests_sha256(suite),
        "seed": seed_from(source, tasks.sha256) if seed is None else seed,
        "versions": versions(),
    }
    return report_in(folder, wanted)


def _outcome(why: str | None) -> str:
    return "passed" if why is None else "failed"


def _limits(own: OfSet) -> Limits:
    """Those of a suite, with enough CPU time for several episodes."""
    usual = Limits()
    most = max(usual.cpu_seconds, 2 * own.limits.cpu_seconds)
    return replace(usual, cpu_seconds=most)


def _provenance(
    tasks: TaskSet, source: bytes, job: Job, suite: Path, found: Findings
) -> Provenance:
    # raw read: our temporary folder
    params = (job.task / "params.json").read_bytes()
    digest = tests_sha256(suite)
    facts: dict[str, Any] = {"limits": asdict(job.limits), "versions": versions()}
    return Provenance(
        task=tasks.name,
        called=f"set {tasks.name}",
        task_sha256=tasks.sha256,
        dynamics=tasks.dynamics,
        unit=tasks.file.unit,
        map_sha256="",
        params_sha256=sha256_of(params),
        sensors_sha256="",
        controller_sha256=sha256_of(source),
        suite=f"{LEVEL} + {suite.name}",
        suite_sha256=digest,
        own_suite=digest[:8],
        profile="policy",
        paper=False,
        seed=job.seed,
        sandbox=found.tier,
        **facts,
    )
