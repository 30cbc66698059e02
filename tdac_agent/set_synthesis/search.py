"""The loop for a task set: writing, testing on `dev`, and repairing."""

from __future__ import annotations

from pathlib import Path

from tdac_agent.models.provider import is_fixed
from tdac_agent.prompting.extract import same_code
from tdac_agent.prompting.feedback import Feedback
from tdac_agent.runs.run_record import Attempt
from tdac_agent.set_synthesis.feedback import set_feedback, summary_of
from tdac_agent.set_synthesis.trials import Candidate, Trials
from tdac_agent.synthesis.dialogue import Dialogue, ModelAnswer
from tdac_agent.synthesis.loop import MOST_SPENT, given_up

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
    first = None if given is None else ModelAnswer(given)
    loop = _Search(dialogue, trials, candidates, first)
    for k in range(1, trials.recorder.run.iterations + 1):
        ending = loop.iteration(k, (k == 1 and first) or dialogue.generate(k))
        if ending:
            return ending
    return ""


class _Search:
    """The state of the loop: the candidates so far, and answers without code.

    Args:
        dialogue: The models.
        trials: Tests candidates.
        candidates: Receives the candidates.
        given: The initial controller, if there is one.
    """

    def __init__(
        self,
        dialogue: Dialogue,
        trials: Trials,
        candidates: list[Candidate],
        given: ModelAnswer | None,
    ) -> None:
        self._dialogue, self._trials = dialogue, trials
        self._recorder = trials.recorder
        self._candidates, self._given = candidates, given
        self._empty = 0

    def iteration(self, k: int, answer: ModelAnswer) -> str:
        """Iteration k; returns why the writing ends, or nothing."""
        dialogue, run, new = self._dialogue, self._recorder.run, False
        parent: Candidate | None = None
        for j in range(run.patience + 1):
            source, notes = answer
            if source is None:
                self._no_code(k, j, notes)
                return ""
            self._empty = 0
            candidate = self._known(source)
            if candidate is None:
                new = True
                candidate = self._made(k, j, source)
                failure = self._tested(candidate, notes)
            else:
                failure = self._again(k, j, candidate, notes, candidate is parent)
            parent = candidate
            if failure is None or not self._trials.feedback_left:
                return NO_EPISODES
            if answer is not self._given and self._fixed():
                return f"{dialogue.learner.name} has one controller"
            if j < run.patience:
                answer = dialogue.edit(k, j + 1, source, failure)
            elif run.refine:
                dialogue.summarise(k, j, source, failure)
        return "" if new else f"iteration {k} brought no new code"

    def _fixed(self) -> bool:
        """Whether the models have nothing else to answer."""
        return is_fixed(self._dialogue.learner) and is_fixed(self._dialogue.optimizer)

    def _known(self, source: str) -> Candidate | None:
        """The candidate with this code, if there is one."""
        same = (each for each in self._candidates if same_code(source, each.source))
        return next(same, None)

    def _made(self, k: int, j: int, source: str) -> Candidate:
        folder: Path = self._recorder.candidate(k, j, source)
        candidate = Candidate(k, j, source, folder)
        self._candidates.append(candidate)
        return candidate

    def _tested(self, candidate: Candidate, notes: tuple[str, ...]) -> Feedback | None:
        """Tests a candidate; returns how it failed, if it did."""
        k, j = candidate.k, candidate.j
        report = self._trials.test(candidate)
        drives = [each for each in candidate.feedback if each.worlds]
        worlds = sum(each.worlds for each in drives)
        reached = sum(each.successes for each in drives)
        said = f"the goal reached in {reached} of {worlds} worlds"
        if report is not None:
            before = f"{worlds - report.worlds} worlds without a failure, then "
            said = summary_of(report)
            said = before + said if worlds > report.worlds else said
        failure = None if report is None else set_feedback(report)
        self._recorder.attempted(
            Attempt(
                k=k,
                j=j,
                valid=True,
                passed=failure is None,
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
    ) -> Feedback:
        """Records an answer with the code of a candidate, which is not tested again.

        Args:
            k: Its iteration.
            j: Its edit.
            candidate: The candidate.
            notes: Notes on the answer.
            unedited: Whether the answer should have edited this candidate.
        """
        # A candidate without a failure ends the loop, so this one has failed.
        failure = set_feedback(candidate.feedback[-1])
        said = f"same code as k={candidate.k} j={candidate.j}"
        self._recorder.candidate(k, j, candidate.source)
        self._recorder.attempted(
            Attempt(
                k=k,
                j=j,
                valid=True,
                passed=False,
                failed_tests=failure.failed,
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
