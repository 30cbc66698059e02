"""The loop for a task set: writing, testing on `dev`, and repairing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tdac_agent.models.provider import is_fixed
from tdac_agent.prompting.feedback import Feedback
from tdac_agent.prompting.python_source import same_code
from tdac_agent.runs.run_record import Attempt
from tdac_agent.set_synthesis.feedback import set_feedback, summary_of
from tdac_agent.set_synthesis.pictures import world_picture
from tdac_agent.set_synthesis.trials import Candidate, Trials
from tdac_agent.synthesis.dialogue import Dialogue, ModelAnswer, same_as
from tdac_agent.synthesis.iterations import MOST_SPENT, given_up
from tdac_agent.verification.episode_report import EpisodeReport

if TYPE_CHECKING:
    from tdac_agent.verification.diagnosis.model_picture import FailurePicture

NO_EPISODES = "all feedback episodes were driven"


def search(
    dialogue: Dialogue, given: str | None, trials: Trials, candidates: list[Candidate]
) -> str:
    """Writes and tests candidates until no feedback episodes are left.

    It also ends after K iterations, or when an iteration brings no new code.

    Args:
        dialogue: The models.
        given: Source of an initial controller, if there is one.
        trials: Tests candidates.
        candidates: Receives the candidates.

    Returns:
        What ended it early; empty after K iterations.

    Raises:
        OutOfBudget: The budget of money or tokens is used up.
        Fault: A model does not answer, or gives no code again and again.
    """
    loop = _Search(dialogue, trials, candidates, is_given=given is not None)
    for ks, answers in dialogue.new_candidates(given):
        ending = loop.iteration(ks, answers)
        if ending:
            return ending
    return ""


@dataclass(slots=True)
class _Begun:
    """A candidate at the beginning of its repair.

    Attributes:
        k: Its iteration.
        source: Its source as answered.
        candidate: The candidate, which may be an earlier one with the same code.
        failure: How it failed; None if it did not.
        new: Whether its code is new.
    """

    k: int
    source: str
    candidate: Candidate
    failure: Feedback | None
    new: bool


Notes = tuple[str, ...]
_Made = tuple[Candidate, Notes]


class _Search:
    """The state of the loop: the candidates so far, and answers without code.

    Args:
        dialogue: The models.
        trials: Tests candidates.
        candidates: Receives the candidates.
        is_given: Whether the first one is the initial controller.
    """

    def __init__(
        self,
        dialogue: Dialogue,
        trials: Trials,
        candidates: list[Candidate],
        *,
        is_given: bool,
    ) -> None:
        self._dialogue, self._trials = dialogue, trials
        self._recorder = trials.recorder
        self._candidates, self._is_given = candidates, is_given
        self._empty = 0

    def iteration(self, ks: Sequence[int], answers: Sequence[ModelAnswer]) -> str:
        """Tests new candidates and repairs the best one.

        Args:
            ks: Their iterations.
            answers: Their sources.

        Returns:
            Why the writing ends, or nothing.
        """
        dialogue, run = self._dialogue, self._recorder.run
        begun = self._begin(ks, answers)
        if begun is None:
            return ""
        k, new = begun.k, begun.new
        source, parent, failure = begun.source, begun.candidate, begun.failure
        for j in range(run.patience + 1):
            if j > 0:
                assert failure is not None
                picture = self._picture(parent)
                edited, notes = dialogue.edit(k, j, source, failure, picture)
                if edited is None:
                    self._no_code(k, j, notes)
                    return ""
                source, self._empty = edited, 0
                candidate = self._known(source)
                if candidate is None:
                    new, candidate = True, self._made(k, j, source)
                    failure = self._tested(candidate, notes)
                else:
                    same = candidate is parent
                    failure = self._again(k, j, candidate, notes, same)
                parent = candidate
            if self._is_last(parent):
                return f"{dialogue.learner.name} has one controller"
            if failure is None or not self._trials.feedback_left:
                return NO_EPISODES
        if run.refine and failure is not None:
            dialogue.summarise(k, run.patience, source, failure)
        return "" if new else f"iteration {k} brought no new code"

    def _begin(
        self, ks: Sequence[int], answers: Sequence[ModelAnswer]
    ) -> _Begun | None:
        """Tests new candidates; returns the best one, or None if there is no code."""
        made: list[_Made] = []
        known: list[tuple[int, str, Candidate, Notes]] = []
        for k, (source, notes) in zip(ks, answers, strict=True):
            if source is None:
                self._no_code(k, 0, notes)
                continue
            self._empty = 0
            candidate = self._known(source)
            if candidate is None:
                made.append((self._made(k, 0, source), notes))
            else:
                known.append((k, source, candidate, notes))
        best = self._best(made)
        for candidate, notes in made:
            if best is None or candidate is not best[0]:
                self._tested(candidate, notes, goes_on=False)
        again = None
        for k, source, candidate, notes in known:
            failure = self._again(k, 0, candidate, notes, unedited=False)
            again = again or _Begun(k, source, candidate, failure, new=False)
        if best is None:
            return again
        # Seen last, because the next question is about it.
        chosen, notes = best
        failure = self._tested(chosen, notes)
        return _Begun(chosen.k, chosen.source, chosen, failure, new=True)

    def _best(self, made: list[_Made]) -> _Made | None:
        """Compares new candidates on the same worlds; of equals, the first one."""
        if len(made) > 1:
            self._trials.test_alike([candidate for candidate, _ in made])
        if not made:
            return None
        return max(made, key=lambda each: (each[0].feedback_score, each[0].drives))

    def _picture(self, failed: Candidate) -> FailurePicture | None:
        """A picture of a failure, if the models are shown pictures."""
        report, folder = failed.first_failure, failed.failure_folder
        if not self._recorder.run.vision or report is None:
            return None
        return world_picture(self._trials.tasks, report, folder)

    def _is_last(self, candidate: Candidate) -> bool:
        """Whether the models have nothing else to answer, however it drives."""
        dialogue, first = self._dialogue, (candidate.k, candidate.j) == (1, 0)
        fixed = is_fixed(dialogue.learner) and is_fixed(dialogue.optimizer)
        return fixed and not (self._is_given and first)

    def _test(self, candidate: Candidate) -> EpisodeReport | None:
        """The first report with a failure, if there is one.

        The last candidate has one test, since nobody uses what more of them tell.
        """
        if not self._is_last(candidate):
            return self._trials.test(candidate)
        if self._trials.feedback_left and not candidate.feedback:
            self._trials.drive_next(candidate)
        return candidate.first_failure

    def _known(self, source: str) -> Candidate | None:
        """The candidate with this code, if there is one."""
        same = (each for each in self._candidates if same_code(source, each.source))
        return next(same, None)

    def _made(self, k: int, j: int, source: str) -> Candidate:
        folder: Path = self._recorder.candidate(k, j, source)
        candidate = Candidate(k, j, source, folder)
        self._candidates.append(candidate)
        return candidate

    def _tested(
        self, candidate: Candidate, notes: tuple[str, ...], *, goes_on: bool = True
    ) -> Feedback | None:
        """Tests a candidate and records the result; returns how it failed, if it did.

        Args:
            candidate: The candidate.
            notes: Notes on the answer.
            goes_on: Whether it drives on further worlds if it has not failed so far.
        """
        k, j = candidate.k, candidate.j
        report = candidate.first_failure
        if report is None and goes_on:
            report = self._test(candidate)
        drives = [each for each in candidate.feedback if each.count]
        worlds = sum(each.count for each in drives)
        reached = sum(each.successes for each in drives)
        said = f"the goal reached in {reached} of {worlds} worlds"
        if not candidate.feedback:
            said = "not tested: no feedback episodes are left"
        if report is not None:
            before = f"{worlds - report.count} worlds without a failure, then "
            said = summary_of(report)
            said = before + said if worlds > report.count else said
        failure = None if report is None else set_feedback(report)
        self._recorder.attempted(
            Attempt(
                k=k,
                j=j,
                valid=True,
                passed=failure is None and worlds > 0,
                failed_tests=() if failure is None else failure.failed,
                notes=(*notes, said),
            )
        )
        if failure is not None:
            self._dialogue.saw(k, j, failure)
        return failure

    def _again(
        self,
        k: int,
        j: int,
        candidate: Candidate,
        notes: tuple[str, ...],
        unedited: bool,
    ) -> Feedback | None:
        """Records an answer with the code of a candidate; returns how this failed.

        Only a candidate that has not failed so far is tested further.

        Args:
            k: Its iteration.
            j: Its edit.
            candidate: The candidate.
            notes: Notes on the answer.
            unedited: Whether the answer should have edited this candidate.
        """
        report = self._test(candidate)
        failure = None if report is None else set_feedback(report)
        said = same_as(candidate.k, candidate.j)
        self._recorder.candidate(k, j, candidate.source)
        self._recorder.attempted(
            Attempt(
                k=k,
                j=j,
                valid=True,
                passed=failure is None,
                failed_tests=() if failure is None else failure.failed,
                notes=(*notes, said),
                unchanged=True,
            )
        )
        if unedited:
            self._dialogue.saw_no_change(k, j)
        else:
            self._dialogue.saw_again(k, j, (candidate.k, candidate.j))
        return failure

    def _no_code(self, k: int, j: int, notes: tuple[str, ...]) -> None:
        """Records an answer without code.

        Raises:
            Fault: A paid model has given none in some iterations in a row.
        """
        invalid = Attempt(k=k, j=j, valid=False, passed=False, notes=notes)
        # Recorded answers do not count, so that a resumed run asks as often again.
        new = self._recorder.attempted(invalid)
        self._empty += new and j == 0
        learner, most = self._dialogue.learner, self._recorder.run.iterations
        if learner.paid and self._empty >= MOST_SPENT and k < most:
            raise given_up(learner, self._empty, notes)
