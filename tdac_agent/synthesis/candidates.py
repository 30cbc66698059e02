"""Tests a candidate of a run on one task, and delivers a verified one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tdac_agent.runs.recorder import Recorder
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.figures import draw_trajectories
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify import kept_report, load_trajectories, verify


@dataclass(frozen=True, slots=True)
class Tests:
    """Where candidates are tested: on a task, by a judge, in a sandbox tier."""

    task: Task
    judge: WarmJudge
    tier: str


def verify_candidate(
    recorder: Recorder,
    k: int,
    j: int,
    source: str,
    folder: Path,
    tests: Tests,
) -> Report:
    """The report on a candidate; a recorded one is reused."""
    task, seed = tests.task, recorder.run.seed
    recorder.event("verify.start", k=k, j=j)
    kept = kept_report(folder, task, source, seed) if recorder.run.mark else None
    return kept or verify(
        folder / "controller.py",
        task,
        tier=tests.tier,
        seed=seed,
        out=folder,
        judge=tests.judge,
    )


def deliver(
    recorder: Recorder, task: Task, k: int, source: str, report: Report, evidence: Path
) -> None:
    """Copies the verified controller and its evidence to the top of the run folder."""
    folder = recorder.run.folder
    write_atomic(folder / "controller.py", source)
    write_atomic(folder / "report.json", report.model_dump_json(indent=2) + "\n")
    (folder / "trajectories").mkdir(exist_ok=True)
    for path in sorted((evidence / "trajectories").glob("*.npz")):
        write_atomic(folder / "trajectories" / path.name, path.read_bytes())
    outcomes = {episode.name: episode.outcome for episode in report.episodes}
    trajectories = load_trajectories(folder / "trajectories")
    draw_trajectories(task, trajectories, outcomes, folder / "trajectory.png")
    recorder.run.tau = k
    recorder.finish("verified", k=k)
