"""What a run delivers: the controller with its evidence, and what a search brought."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from tdac_agent.metrics.paired import paired_change
from tdac_agent.runs.improvement_record import (
    MemberFigures,
    PairedChange,
    TaskImprovement,
)
from tdac_agent.runs.recorder import Recorder
from tdac_agent.runs.selection_record import CandidateFigures, Improvement, Selection
from tdac_agent.storage.files import write_atomic
from tdac_agent.synthesis.archive import Member
from tdac_agent.synthesis.candidates import Candidate
from tdac_agent.synthesis.terms import Chosen, Terms
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.figures import draw_trajectories
from tdac_agent.verification.judge.episode_row import scores_of
from tdac_agent.verification.verify import load_trajectories
from tdac_envs.core.intake import IMAGE_BYTES, read_file

if TYPE_CHECKING:
    from tdac_envs.ladder.task_sets import TaskSet

Compare = Callable[[Candidate], dict[str, list[float]]]
"""Drives the episodes of the comparison; returns scores of each, by name."""


def place_verified(task: Task, candidate: Candidate, recorder: Recorder) -> None:
    """Copies a verified controller and its evidence to the top of the run folder."""
    report, folder = candidate.report, recorder.run.folder
    assert report is not None
    recorder.deliver(candidate.source)
    write_atomic(folder / "report.json", report.model_dump_json(indent=2) + "\n")
    (folder / "trajectories").mkdir(exist_ok=True)
    for path in sorted((candidate.folder / "trajectories").glob("*.npz")):
        write_atomic(folder / "trajectories" / path.name, read_file(path, IMAGE_BYTES))
    outcomes = {episode.name: episode.outcome for episode in report.episodes}
    trajectories = load_trajectories(folder / "trajectories")
    draw_trajectories(task, trajectories, outcomes, folder / "trajectory.png")


def compared(
    compare: Compare, base: Candidate, chosen: Candidate
) -> dict[str, PairedChange]:
    """How the selected candidate changed what it improves; empty if it is the same."""
    if chosen is base:
        return {}
    before, after = compare(base), compare(chosen)
    return {
        name: PairedChange(**asdict(paired_change(before[name], after[name])))
        for name in before
    }


def task_improvement(
    terms: Terms,
    task: Task,
    chosen: Chosen,
    changes: dict[str, PairedChange],
    **facts: Any,
) -> TaskImprovement:
    """The record of a search on a task.

    Args:
        terms: What the trials share.
        task: The task.
        chosen: The candidate that was selected, and the archive.
        changes: How it compares with what the search began with, by figure.
        **facts: `first`, `used`, `first_seed` and `first_comparison`.
    """
    archive, selected = chosen.archive, chosen.candidate
    assert archive is not None
    return TaskImprovement(
        unit=task.setting.units.place,
        disturbance=task.own_disturbance(),
        block=terms.shares.block,
        improve=terms.recorder.run.improve,
        asked=chosen.asked,
        members=tuple(map(_member, archive.members)),
        founders=len(archive.founders),
        k=selected.k,
        j=selected.j,
        controller_sha256=selected.sha256,
        episodes=terms.shares.comparison if changes else 0,
        stopped=chosen.stopped,
        **changes,
        **facts,
    )


def selection_of(
    terms: Terms,
    tasks: TaskSet,
    chosen: Chosen,
    changes: dict[str, PairedChange],
    used: Mapping[str, int],
    **facts: Any,
) -> Selection:
    """The record of a selection on a task set.

    Args:
        terms: What the trials share.
        tasks: The task set.
        chosen: The candidate that was selected.
        changes: How it compares with the best founder of the archive.
        used: Number of episodes that were driven, by purpose.
        **facts: `first_feedback` and `first_validation`.
    """
    run, selected, archive = terms.recorder.run, chosen.candidate, chosen.archive
    assert run.episodes is not None
    improvement = None
    if archive is not None:
        improvement = Improvement(
            variations=archive.variations,
            k=archive.base.k,
            j=archive.base.j,
            worlds=terms.shares.comparison if changes else 0,
            **(changes["time"].model_dump() if changes else {}),
        )
    return Selection(
        set=tasks.name,
        set_sha256=tasks.sha256,
        dynamics=tasks.dynamics,
        episodes=run.episodes,
        feedback_used=used["feedback"],
        validation_used=used["validation"],
        improve=run.improve,
        improve_used=used["improve"] + used["comparison"],
        candidates=tuple(map(_candidate, chosen.written)),
        k=selected.k,
        j=selected.j,
        controller_sha256=selected.sha256,
        optimistic=scores_of(selected.validation) if selected.validation else None,
        improvement=improvement,
        stopped=chosen.stopped,
        **facts,
    )


def _member(member: Member) -> MemberFigures:
    candidate, parent = member.candidate, member.parent
    return MemberFigures(
        k=candidate.k,
        j=candidate.j,
        parent=None if parent is None else (parent.candidate.k, parent.candidate.j),
        controller_sha256=candidate.sha256,
        **{name: round(value, 6) for name, value in member.figures.by_name.items()},
    )


def _candidate(candidate: Candidate) -> CandidateFigures:
    explored = candidate.explored
    drives = [row for report in candidate.feedback for row in report.episodes]
    figures = None if explored is None else explored.figures
    return CandidateFigures(
        k=candidate.k,
        j=candidate.j,
        controller_sha256=candidate.sha256,
        feedback_worlds=len(drives),
        feedback_reached=sum(each.success for each in drives),
        validation_worlds=len(candidate.validation),
        validation_reached=sum(each.success for each in candidate.validation),
        validation_time=candidate.score if candidate.validation else None,
        improve_time=None if figures is None else figures.time,
    )
