"""The files of a run on a task set: those it begins with, and what was selected."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from tdac_agent.prompting.prompt import PromptTemplate
from tdac_agent.runs.recorder import Recorder
from tdac_agent.runs.selection_record import (
    SELECTION_FILE,
    CandidateFigures,
    Improvement,
    Selection,
)
from tdac_agent.set_synthesis.selection import scores_of_selected
from tdac_agent.set_synthesis.trials import BLOCKS, Candidate, Trials
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.tasks.task_file import SET_FILE
from tdac_agent.verification.judge.set_files import level_params
from tdac_envs.ladder.task_sets import TaskSet


def start_on_set(
    tasks: TaskSet, template: PromptTemplate, given: str | None
) -> Callable[..., None]:
    """Returns what writes the files of a new run; see `open_record`.

    Args:
        tasks: The task set.
        template: Template of the first question.
        given: Source of an initial controller, if there is one.
    """
    return partial(
        Recorder.begin,
        write=partial(_write_level, tasks),
        last=(SET_FILE, _set_text(tasks)),
        template=template,
        given=given,
    )


def deliver_selected(
    trials: Trials,
    written: list[Candidate],
    chosen: Candidate,
    stopped: str,
    improvement: Improvement | None = None,
) -> None:
    """Writes the selected controller and the report to the top of the run folder.

    Args:
        trials: How the candidates drove.
        written: All candidates.
        chosen: The selected one.
        stopped: What ended the writing early.
        improvement: What a search for improvements brought; None without one.
    """
    run, first = trials.recorder.run, trials.first
    assert run.episodes is not None
    selection = Selection(
        set=trials.tasks.name,
        set_sha256=trials.tasks.sha256,
        first_feedback=first,
        first_validation=BLOCKS + first,
        episodes=run.episodes,
        feedback_used=trials.feedback_used,
        validation_used=trials.validation_used,
        improve=run.improve,
        improve_used=trials.explore_used + trials.comparison_used,
        candidates=tuple(map(_figures, written)),
        k=chosen.k,
        j=chosen.j,
        controller_sha256=sha256_of(chosen.source),
        optimistic=scores_of_selected(chosen),
        improvement=improvement,
        stopped=stopped,
    )
    trials.recorder.deliver(chosen.source)
    write_atomic(
        run.folder / SELECTION_FILE, selection.model_dump_json(indent=2) + "\n"
    )
    values = selection.model_dump(mode="json", exclude={"candidates", "stopped"})
    trials.recorder.event("select.end", **values)


def _figures(candidate: Candidate) -> CandidateFigures:
    drives = candidate.feedback
    return CandidateFigures(
        k=candidate.k,
        j=candidate.j,
        controller_sha256=sha256_of(candidate.source),
        feedback_worlds=sum(report.count for report in drives),
        feedback_reached=sum(report.successes for report in drives),
        validation_worlds=len(candidate.validation),
        validation_reached=sum(each.success for each in candidate.validation),
        validation_time=candidate.score if candidate.validation else None,
        improve_time=candidate.explored_score,
    )


def _write_level(tasks: TaskSet, folder: Path) -> None:
    """Writes what every controller of the level has in its folder."""
    text = json.dumps(level_params(tasks.file), indent=2) + "\n"
    write_atomic(folder / "params.json", text)


def _set_text(tasks: TaskSet) -> str:
    values: Any = tasks.file.model_dump(mode="json", by_alias=True)
    return json.dumps(values, indent=2) + "\n"  # JSON is YAML
