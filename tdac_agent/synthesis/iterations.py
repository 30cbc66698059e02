"""The iterations of Algorithm 2: new candidates, tests, repairs, rules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tdac_agent.errors import Fault
from tdac_agent.models.provider import Provider, is_fixed
from tdac_agent.prompting.python_source import same_code
from tdac_agent.runs.run_record import Attempt
from tdac_agent.synthesis.candidates import Candidate
from tdac_agent.synthesis.dialogue import Dialogue, ModelAnswer, Notes, same_as
from tdac_agent.synthesis.trials import Trials

MOST_SPENT = 3
"""Iterations in a row without code, after which a paid model is given up."""


@dataclass(frozen=True, slots=True)
class _Answered:
    """An answer with code.

    Attributes:
        k: Its iteration.
        j: Its edit.
        source: Its source.
        notes: Notes on the answer.
        candidate: Its candidate, which may be an earlier one with the same code.
        new: Whether its code is new.
    """

    k: int
    j: int
    source: str
    notes: Notes
    candidate: Candidate
    new: bool


class Iterations:
    """One iteration after another: tests new candidates, repairs the best one.

    A candidate with the code of an earlier one is not tested again.

    Args:
        dialogue: The models.
        trials: Tests candidates.
        given: Source of an initial controller, if there is one.

    Attributes:
        written: The candidates so far.
    """

    def __init__(self, dialogue: Dialogue, trials: Trials, given: str | None) -> None:
        self._dialogue, self._trials, self._given = dialogue, trials, given
        self._recorder = trials.terms.recorder
        self.written: list[Candidate] = []
        # Recorded answers do not count, so that a resumed run asks as often again.
        self._empty = 0

    def run(self) -> str:
        """Writes and tests candidates until nothing is left to repair, or to ask.

        Returns:
            What ended the writing early; empty after K iterations, and after a success.

        Raises:
            OutOfBudget: The budget of money or tokens is used up.
            Fault: A model does not answer, or gives no code again and again.
        """
        for ks, answers in self._dialogue.new_candidates(self._given):
            ended = self._iteration(ks, answers)
            if ended is not None:
                return ended
        return ""

    def _iteration(
        self, ks: Sequence[int], answers: Sequence[ModelAnswer]
    ) -> str | None:
        """One iteration; returns what ends the writing, or None."""
        run, count = self._recorder.run, len(self.written)
        at = self._begun(ks, answers)
        while at is not None:
            ended = self._ended(at)
            if ended is not None:
                return ended
            if at.j == run.patience:
                break
            at = self._edited(at)
        if at is None:
            return None
        failure = self._trials.result(at.candidate).failure
        if run.refine and failure is not None:
            self._dialogue.summarise(at.k, at.j, at.source, failure)
        if self._trials.needs_new_code and len(self.written) == count:
            return f"iteration {at.k} brought no new code"
        return None

    def _ended(self, at: _Answered) -> str | None:
        """What ends the writing after a candidate; None if it is to be repaired."""
        if self._is_last(at.candidate):
            return f"{self._dialogue.learner.name} has one controller"
        result = self._trials.result(at.candidate)
        spent = self._trials.tests_left == 0
        if result.passed or result.failure is None or spent:
            return self._trials.ended
        return None

    def _begun(
        self, ks: Sequence[int], answers: Sequence[ModelAnswer]
    ) -> _Answered | None:
        """Tests new candidates; returns the best one, or None if there is no code."""
        group: list[_Answered] = []
        for k, (source, notes) in zip(ks, answers, strict=True):
            if source is None:
                self._no_code(k, 0, notes)
            else:
                group.append(self._answered(k, 0, source, notes))
        if not group:
            return None
        new = [each for each in group if each.new]
        self._trials.test([each.candidate for each in new])
        best = max(new or group[:1], key=self._rank)
        self._go_on(best.candidate)
        for each in group:
            self._record(each)
        # The next question is about the last one that was seen.
        for each in [*(one for one in group if one is not best), best]:
            self._see(each)
        return best

    def _edited(self, at: _Answered) -> _Answered | None:
        """Asks for a repaired candidate and tests it; None if there is no code."""
        k, j, parent = at.k, at.j + 1, at.candidate
        failure = self._trials.result(parent).failure
        assert failure is not None
        source, notes = self._dialogue.edit(k, j, at.source, failure)
        if source is None:
            self._no_code(k, j, notes)
            return None
        edited = self._answered(k, j, source, notes)
        if edited.new:
            self._trials.test([edited.candidate])
        self._go_on(edited.candidate)
        self._record(edited)
        self._see(edited, parent)
        return edited

    def _rank(self, answered: _Answered) -> tuple[float, ...]:
        return self._trials.result(answered.candidate).rank

    def _go_on(self, candidate: Candidate) -> None:
        """Tests a candidate further, unless nobody uses what that tells."""
        if not self._is_last(candidate):
            self._trials.go_on(candidate)

    def _is_last(self, candidate: Candidate) -> bool:
        """Whether the models have nothing else to answer, however it does."""
        dialogue, first = self._dialogue, (candidate.k, candidate.j) == (1, 0)
        fixed = is_fixed(dialogue.learner) and is_fixed(dialogue.optimizer)
        return fixed and not (self._given is not None and first)

    def _answered(self, k: int, j: int, source: str, notes: Notes) -> _Answered:
        """Keeps the source of an answer; its candidate is new if its code is."""
        self._empty = 0
        folder = self._recorder.candidate(k, j, source)
        same = (each for each in self.written if same_code(source, each.source))
        known = next(same, None)
        candidate = known or Candidate(k, j, source, folder)
        if known is None:
            self.written.append(candidate)
        return _Answered(k, j, source, notes, candidate, known is None)

    def _record(self, answered: _Answered) -> None:
        """Records the result of an answer."""
        candidate, result = answered.candidate, self._trials.result(answered.candidate)
        said = result.said if answered.new else same_as(candidate.k, candidate.j)
        notes = (*answered.notes, said) if said else answered.notes
        attempt = result.attempt(answered.k, answered.j, notes, new=answered.new)
        self._recorder.attempted(attempt)

    def _see(self, answered: _Answered, parent: Candidate | None = None) -> None:
        """Notes the result of an answer for later questions."""
        k, j, candidate = answered.k, answered.j, answered.candidate
        failure = self._trials.result(candidate).failure
        if candidate is parent:
            self._dialogue.saw_no_change(k, j)
        elif not answered.new:
            self._dialogue.saw_again(k, j, (candidate.k, candidate.j))
        elif failure is not None:
            self._dialogue.saw(k, j, failure)

    def _no_code(self, k: int, j: int, notes: Notes) -> None:
        """Records an answer without code.

        Raises:
            Fault: A paid model has given none in some iterations in a row.
        """
        attempt = Attempt(k=k, j=j, valid=False, passed=False, notes=notes)
        new = self._recorder.attempted(attempt)
        self._empty += new and j == 0
        learner, most = self._dialogue.learner, self._recorder.run.iterations
        if learner.paid and self._empty >= MOST_SPENT and k < most:
            raise _given_up(learner, self._empty, notes)


def _given_up(model: Provider, count: int, notes: Notes) -> Fault:
    """The fault of a model that gives no code, with the note on its last answers."""
    return Fault(
        f"{model.name}: {count} iterations in a row without a controller; in the last "
        f"one, {notes[-1]}"
    )
