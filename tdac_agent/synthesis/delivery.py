"""What a run delivers: the controller with its evidence, and what a search brought."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, NamedTuple

from tdac_agent.metrics.paired import paired_change
from tdac_agent.runs.improvement_record import (
    MemberFigures,
    PairedChange,
    TaskImprovement,
)
from tdac_agent.runs.recorder import Recorder
from tdac_agent.runs.run_record import Attempt
from tdac_agent.runs.selection_record import CandidateFigures, Improvement, Selection
from tdac_agent.storage.files import write_atomic
from tdac_agent.synthesis.archive import Member
from tdac_agent.synthesis.candidates import Candidate
from tdac_agent.synthesis.pool_feedback import mean_losses
from tdac_agent.synthesis.terms import Chosen, Terms
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.figures import draw_trajectories
from tdac_agent.verification.judge.episode_row import EpisodeRow, scores_of
from tdac_agent.verification.verify import load_trajectories
from tdac_envs.core.intake import IMAGE_BYTES, read_file

if TYPE_CHECKING:
    from tdac_envs.ladder.task_sets import TaskSet

Compare = Callable[[Candidate], Sequence[EpisodeRow]]
"""Drives the episodes of the comparison."""
Figure = Callable[[EpisodeRow], float]


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


class Compared(NamedTuple):
    """How the selected candidate changed what it improves.

    Attributes:
        changes: Means and differences by figure; empty if it is the same candidate.
        lost_before: Mean shares of the score that were lost before, by cause.
        lost_after: Those that are lost now.
        reached: In how many episodes the goal was reached before, and now.
    """

    changes: dict[str, PairedChange]
    lost_before: dict[str, float]
    lost_after: dict[str, float]
    reached: tuple[int, int] | tuple[None, None] = (None, None)


def compared(
    compare: Compare,
    base: Candidate,
    chosen: Candidate,
    figures: Mapping[str, Figure],
) -> Compared:
    """Drives both candidates in the same episodes.

    Args:
        compare: Drives a candidate.
        base: What the search has to improve.
        chosen: The selected candidate.
        figures: The figures of an episode, by name.
    """
    if chosen is base:
        return Compared({}, {}, {})
    before, after = compare(base), compare(chosen)
    changes = {
        name: PairedChange(
            **asdict(paired_change(list(map(figure, before)), list(map(figure, after))))
        )
        for name, figure in figures.items()
    }
    reached = [sum(row.success for row in rows) for rows in (before, after)]
    return Compared(
        changes, _rounded(before), _rounded(after), (reached[0], reached[1])
    )


def _rounded(rows: Sequence[EpisodeRow]) -> dict[str, float]:
    return {name: round(each, 6) for name, each in mean_losses(rows).items()}


def task_improvement(
    terms: Terms,
    task: Task,
    chosen: Chosen,
    found: Compared,
    **facts: Any,
) -> TaskImprovement:
    """The record of a search on a task.

    Args:
        terms: What the trials share.
        task: The task.
        chosen: The candidate that was selected, and the archive.
        found: How it compares with what the search began with.
        **facts: `first`, `used`, `first_seed` and `first_comparison`.
    """
    archive, selected, changes = chosen.archive, chosen.candidate, found.changes
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
        lost_before=found.lost_before,
        lost_after=found.lost_after,
        **changes,
        **facts,
    )


def selection_of(
    terms: Terms,
    tasks: TaskSet,
    chosen: Chosen,
    found: Compared,
    used: Mapping[str, int],
    **facts: Any,
) -> Selection:
    """The record of a selection on a task set.

    Args:
        terms: What the trials share.
        tasks: The task set.
        chosen: The candidate that was selected.
        found: How it compares with the best founder of the archive.
        used: Number of episodes that were driven, by purpose.
        **facts: `first_feedback` and `first_validation`.
    """
    run, selected, archive = terms.recorder.run, chosen.candidate, chosen.archive
    asked = {(each.k, each.j): each for each in run.attempts}
    assert run.episodes is not None
    improvement, changes = None, found.changes
    if archive is not None:
        improvement = Improvement(
            variations=archive.variations,
            k=archive.base.k,
            j=archive.base.j,
            worlds=terms.shares.comparison if changes else 0,
            lost_before=found.lost_before,
            lost_after=found.lost_after,
            reached_before=found.reached[0],
            reached_after=found.reached[1],
            **(changes["time"].model_dump() if changes else {}),
        )
    return Selection(
        set=tasks.name,
        set_sha256=tasks.sha256,
        dynamics=tasks.dynamics,
        episodes=run.episodes,
        feedback_used=used["feedback"],
        validation_used=used["validation"],
        search=run.search,
        improve=run.improve,
        improve_used=used["improve"] + used["comparison"],
        candidates=tuple(_candidate(each, asked) for each in chosen.written),
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


def _candidate(
    candidate: Candidate, asked: Mapping[tuple[int, int], Attempt]
) -> CandidateFigures:
    explored, pool = candidate.explored, candidate.pool
    drives = [row for report in candidate.feedback for row in report.episodes]
    figures = None if explored is None else explored.figures
    attempt = asked.get((candidate.k, candidate.j))
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
        asked="" if attempt is None else attempt.asked,
        parents=() if attempt is None else attempt.parents,
        pool_worlds=len(pool),
        pool_reached=sum(each.success for each in pool),
        lost=_rounded(pool) if pool else {},
    )
