"""Tests candidates of a run on one task, and delivers a verified one."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from queue import SimpleQueue

from tdac_agent.runs.recorder import Recorder
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.figures import draw_trajectories
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify import kept_report, load_trajectories, verify
from tdac_envs.core.intake import IMAGE_BYTES, read_file


@dataclass(frozen=True, slots=True)
class Tests:
    """Where candidates are tested: on a task, by a judge, in a sandbox tier."""

    task: Task
    judge: WarmJudge
    tier: str


Job = tuple[int, int, str, Path]
"""k, j, source and folder of a candidate."""


def verify_all(recorder: Recorder, jobs: Sequence[Job], tests: Tests) -> list[Report]:
    """The reports on candidates; at a time as many as there are cores."""
    if len(jobs) < 2:
        return [verify_candidate(recorder, *job, tests) for job in jobs]
    for k, j, *_ in jobs:
        recorder.event("verify.start", k=k, j=j)
    cores = min(len(jobs), len(os.sched_getaffinity(0)))
    with ExitStack() as stack:
        others = [
            stack.enter_context(WarmJudge(task=tests.task)) for _ in range(cores - 1)
        ]
        judges: SimpleQueue[WarmJudge] = SimpleQueue()
        for judge in (tests.judge, *others):
            judges.put(judge)

        def report(job: Job) -> Report:
            judge = judges.get()
            try:
                return _report(recorder, *job[2:], replace(tests, judge=judge))
            finally:
                judges.put(judge)

        with ThreadPoolExecutor(cores) as pool:
            return list(pool.map(report, jobs))


def verify_candidate(
    recorder: Recorder, k: int, j: int, source: str, folder: Path, tests: Tests
) -> Report:
    """The report on a candidate; a recorded one is reused."""
    recorder.event("verify.start", k=k, j=j)
    return _report(recorder, source, folder, tests)


def _report(recorder: Recorder, source: str, folder: Path, tests: Tests) -> Report:
    task, seed, file = tests.task, recorder.run.seed, folder / "report.json"
    known = recorder.vouches(file)
    kept = kept_report(folder, task, source, seed) if known else None
    if kept is not None:
        return kept
    report = verify(
        folder / "controller.py",
        task,
        tier=tests.tier,
        seed=seed,
        out=folder,
        judge=tests.judge,
    )
    recorder.vouch(file)
    return report


def deliver(
    recorder: Recorder, task: Task, k: int, source: str, report: Report, evidence: Path
) -> None:
    """Ends a run with its first verified controller, of iteration `k`."""
    place(recorder, task, source, report, evidence)
    recorder.run.tau = k
    recorder.finish("verified", k=k)


def place(
    recorder: Recorder, task: Task, source: str, report: Report, evidence: Path
) -> None:
    """Copies a verified controller and its evidence to the top of the run folder."""
    folder = recorder.run.folder
    recorder.deliver(source)
    write_atomic(folder / "report.json", report.model_dump_json(indent=2) + "\n")
    (folder / "trajectories").mkdir(exist_ok=True)
    for path in sorted((evidence / "trajectories").glob("*.npz")):
        write_atomic(folder / "trajectories" / path.name, read_file(path, IMAGE_BYTES))
    outcomes = {episode.name: episode.outcome for episode in report.episodes}
    trajectories = load_trajectories(folder / "trajectories")
    draw_trajectories(task, trajectories, outcomes, folder / "trajectory.png")
