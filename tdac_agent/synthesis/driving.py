"""Drives candidates in many episodes; a report on record is reused."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdac_agent.problems.episodes import episodes_of
from tdac_agent.problems.part import identity_of
from tdac_agent.synthesis.candidates import Candidate
from tdac_agent.synthesis.terms import Terms
from tdac_agent.tasks.task import Task
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.store import REPORT_FILE, kept_report
from tdac_agent.verification.verify_episodes import verify_episodes

if TYPE_CHECKING:
    from tdac_envs.ladder.task_sets import TaskSet


def drive_candidate(
    terms: Terms,
    candidate: Candidate,
    problem: Task | TaskSet,
    numbers: range,
    out: Path,
    about: dict[str, Any],
    **part: Any,
) -> EpisodeReport:
    """The report on a candidate in some episodes.

    Args:
        terms: What the trials share.
        candidate: The candidate.
        problem: The task or the task set.
        numbers: Numbers of the episodes.
        out: Folder of the report and the trajectories.
        about: What a watcher is told of the drive.
        **part: Which episodes of the problem: a `disturbance`, or a `split`.
    """
    recorder, file = terms.recorder, out / REPORT_FILE
    if recorder.vouches(file):
        wanted = {
            "controller_sha256": candidate.sha256,
            **identity_of(episodes_of(problem)),
            **part,
        }
        kept = kept_report(out, wanted, numbers)
        if kept is not None:
            return kept
    report = verify_episodes(
        candidate.raw,
        problem,
        len(numbers),
        first=numbers.start,
        tier=terms.tier,
        out=out,
        trajectories=True,
        judge=terms.judge,
        watch=terms.watch(**about),
        **part,
    )
    recorder.vouch(file)
    return report
