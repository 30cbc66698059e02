"""An iteration of Algorithm 2: new candidates, tests, repairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from tdac_agent.errors import Fault
from tdac_agent.models.picture import LARGEST_SIDE
from tdac_agent.models.provider import Provider
from tdac_agent.prompting.feedback import feedback_of
from tdac_agent.prompting.python_source import same_code
from tdac_agent.synthesis.candidates import (
    Tests,
    deliver,
    place,
    verify_all,
    verify_candidate,
)
from tdac_agent.synthesis.dialogue import Dialogue, ModelAnswer, same_as
from tdac_agent.synthesis.improve_task import TaskCandidate, improve_verified
from tdac_agent.verification.diagnosis.model_picture import (
    FailurePicture,
    failure_picture,
)
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.verify import load_trajectories

MOST_SPENT = 3
"""Iterations in a row without code, after which a paid model is given up."""


@dataclass(frozen=True, slots=True)
class _Tested:
    """A candidate and its report."""

    k: int
    j: int
    source: str
    report: Report
    folder: Path


class _New(NamedTuple):
    """A new candidate (k, 0).

    Attributes:
        k: Its iteration.
        source: Its source.
        notes: Notes on the answer.
        folder: Its folder.
        same: Iteration of an earlier one of its group with the same code.
    """

    k: int
    source: str
    notes: tuple[str, ...]
    folder: Path
    same: int | None


class Iterations:
    """One iteration after another: tests new candidates, repairs the best one.

    Args:
        dialogue: The models.
        tests: Where candidates are tested.
    """

    def __init__(self, dialogue: Dialogue, tests: Tests) -> None:
        self._dialogue, self._tests = dialogue, tests
        self._recorder = dialogue.calls.recorder
        # Recorded answers do not count, so that a resumed run asks as often again.
        self._empty = 0
        # Verified ones beside the best of a group.
        self._others: list[_Tested] = []

    def iteration(self, ks: Sequence[int], answers: Sequence[ModelAnswer]) -> bool:
        """Tests new candidates, and repairs the best; returns whether one passed.

        Args:
            ks: Their iterations.
            answers: Their sources.
        """
        best = self._begin(ks, answers)
        if best is None:
            return False
        dialogue, run = self._dialogue, self._recorder.run
        k, source, report = best.k, best.source, best.report
        failure = feedback_of(report)
        for j in range(1, run.patience + 1):
            if report.passed:
                break
            parent, picture = source, self._picture(best)
            edited, notes = dialogue.edit(k, j, source, failure, picture)
            if edited is None:
                self._no_code(k, j, notes)
                return False
            source, self._empty = edited, 0
            folder = self._recorder.candidate(k, j, source)
            if same_code(source, parent):
                said = same_as(k, j - 1)
                self._recorder.judged(k, j, report, (*notes, said), unchanged=True)
                dialogue.saw_no_change(k, j)
                continue
            report = verify_candidate(self._recorder, k, j, source, folder, self._tests)
            self._recorder.judged(k, j, report, notes)
            failure = feedback_of(report)
            dialogue.saw(k, j, failure)
            best = _Tested(k, j, source, report, folder)
        if report.passed:
            self._finish(best)
            return True
        if run.refine:
            dialogue.summarise(k, run.patience, source, failure)
        return False

    def _begin(
        self, ks: Sequence[int], answers: Sequence[ModelAnswer]
    ) -> _Tested | None:
        """Tests new candidates; returns the best one, or None if there is no code.

        Those with the same code are tested once.
        """
        begun: list[_New] = []
        for k, (source, notes) in zip(ks, answers, strict=True):
            if source is None:
                self._no_code(k, 0, notes)
                continue
            self._empty = 0
            folder = self._recorder.candidate(k, 0, source)
            first = (each.k for each in begun if same_code(source, each.source))
            begun.append(_New(k, source, notes, folder, next(first, None)))
        new = [each for each in begun if each.same is None]
        if not new:
            return None
        jobs = [(each.k, 0, each.source, each.folder) for each in new]
        reports = verify_all(self._recorder, jobs, self._tests)
        tested = [
            _Tested(each.k, 0, each.source, report, each.folder)
            for each, report in zip(new, reports, strict=True)
        ]
        by_k = {each.k: each.report for each in tested}
        for k, _, notes, _, same in begun:
            if same is None:
                self._recorder.judged(k, 0, by_k[k], notes)
                continue
            said = same_as(same, 0)
            self._recorder.judged(k, 0, by_k[same], (*notes, said), unchanged=True)
            self._dialogue.saw_again(k, 0, (same, 0))
        best = min(tested, key=lambda each: (len(each.report.failures), each.k))
        self._others = [one for one in tested if one.report.passed and one is not best]
        # The next question is about the last one that was seen.
        for each in [*(one for one in tested if one is not best), best]:
            self._dialogue.saw(each.k, 0, feedback_of(each.report))
        return best

    def _picture(self, failed: _Tested) -> FailurePicture | None:
        """A picture of a failure, if the models are shown pictures."""
        if not self._recorder.run.vision:
            return None
        trajectories = load_trajectories(failed.folder / "trajectories")
        task = self._tests.task
        return failure_picture(task, failed.report, trajectories, LARGEST_SIDE)

    def _no_code(self, k: int, j: int, notes: tuple[str, ...]) -> None:
        """Records an answer without code.

        Raises:
            Fault: A paid model has given none in some iterations in a row.
        """
        new = self._recorder.judged(k, j, None, notes)
        self._empty += new and j == 0
        learner, most = self._dialogue.learner, self._recorder.run.iterations
        if learner.paid and self._empty >= MOST_SPENT and k < most:
            raise given_up(learner, self._empty, notes)

    def _finish(self, first: _Tested) -> None:
        """Delivers a verified candidate, or the best variation of it."""
        recorder, task = self._recorder, self._tests.task
        first_at = (first.source, first.report, first.folder)
        if not recorder.run.improve:
            deliver(recorder, task, first.k, *first_at)
            return
        # An interrupted search leaves a verified controller.
        place(recorder, task, *first_at)
        recorder.run.tau = first.k
        recorder.save()
        founders = [
            TaskCandidate(each.k, each.j, each.source, each.folder, each.report)
            for each in (first, *self._others)
        ]
        chosen, stopped = improve_verified(self._dialogue, self._tests, founders)
        if chosen is not founders[0]:
            assert chosen.report is not None
            place(recorder, task, chosen.source, chosen.report, chosen.folder)
        recorder.finish("verified", k=chosen.k, j=chosen.j, reason=stopped)


def given_up(model: Provider, count: int, notes: tuple[str, ...]) -> Fault:
    """The fault of a model that gives no code, with the note on its last answers."""
    return Fault(
        f"{model.name}: {count} iterations in a row without a controller; in the last "
        f"one, {notes[-1]}"
    )
