"""How candidates of a problem are tested, driven, compared and delivered."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from tdac_agent.problems.problem import Problem
from tdac_agent.runs.run_record import Status
from tdac_agent.synthesis.archive import Archive
from tdac_agent.synthesis.candidates import Candidate, Explored, Result
from tdac_agent.synthesis.pool_feedback import PoolFeedback
from tdac_agent.synthesis.suite_trials import SuiteTrials
from tdac_agent.synthesis.terms import Chosen, Terms
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.verdict import confirmed_text, word_of


class Trials(Protocol):
    """Tests candidates: `SuiteTrials` or `WorldTrials`.

    Attributes:
        terms: What all tests share.
        status: Status of a run that has delivered a controller without a confirmation.
        confirms: Whether the delivered controller is to be confirmed.
        ended: Why the writing ends after a candidate with nothing to repair, or
            without episodes; empty if its pass is the aim of the run.
        needs_new_code: Whether an iteration without new code ends the writing.
        aim: What variations are to raise, as an instruction to a model.
    """

    terms: Terms
    status: Status
    ended: str
    needs_new_code: bool
    aim: str

    @property
    def confirms(self) -> bool:
        """See the class."""

    @property
    def tests_left(self) -> int | None:
        """Episodes that are left for tests; None if tests take none of a budget."""

    def prove(self) -> None:
        """Checks the tests before an answer is paid for, once per run.

        Raises:
            Fault: The reference fails, or a controller that does nothing passes.
        """

    def test(self, candidates: Sequence[Candidate]) -> None:
        """Tests candidates once, all alike; recorded results are reused."""

    def go_on(self, candidate: Candidate) -> None:
        """Tests a candidate until it fails, or no episodes are left."""

    def recall(self, candidate: Candidate) -> None:
        """Reads the first test of a candidate of a finished run.

        Raises:
            OSError: It is not on record.
            ValueError: The record is damaged.
        """

    def result(self, candidate: Candidate) -> Result:
        """What came of its tests so far."""

    @property
    def pool_feedback(self) -> PoolFeedback:
        """Tells models how candidates drove in a race."""

    def counterexample(self, candidate: Candidate) -> str:
        """The smallest deviation with which a candidate of a race fails, in lines.

        Empty if the options ask for no such search.
        """

    def can_explore(self, asked: int) -> bool:
        """Whether there are episodes for another candidate of a race.

        Args:
            asked: Number of its questions that were answered.
        """

    def admit(self, candidate: Candidate) -> Explored | None:
        """Tests a candidate before a race; returns why it may not drive, or None."""

    def drive_pool(self, candidate: Candidate, count: int) -> Explored | None:
        """Drives a candidate in its next episodes of a race.

        Returns:
            Why it did not drive, if tests refused it.
        """

    def pool_result(self, candidate: Candidate) -> Explored:
        """What came of a candidate in its episodes of a race; it drove in some."""

    def finalists(self, archive: Archive) -> list[Candidate]:
        """The candidates for the selection after a search."""

    def validate(self, candidate: Candidate, count: int) -> None:
        """Drives a candidate in its next episodes of the selection."""

    def why_none(self, able: Sequence[Candidate]) -> str:
        """Why nothing was selected from these."""

    def secure(self, candidate: Candidate) -> None:
        """Delivers a verified candidate before a search, which may be interrupted."""

    def deliver(self, chosen: Chosen) -> Candidate:
        """Writes the selected controller, its evidence, and what a search brought.

        It is compared with what the search began with, in episodes that decided
        nothing.

        Returns:
            The delivered candidate: what the search began with if that is confirmed,
            and the selected one is not.
        """

    def confirm(self, candidate: Candidate) -> EpisodeReport:
        """The blind drives of the delivered controller; on a set, on hidden worlds."""


def trials_of(problem: Problem, terms: Terms) -> Trials:
    """The trials of a problem.

    Args:
        problem: A task, or a task set.
        terms: What all tests share.
    """
    if problem.task is not None:
        return SuiteTrials(problem.task, terms)
    assert problem.tasks is not None
    # Task sets need much that a task does not.
    from tdac_agent.synthesis.world_trials import WorldTrials

    return WorldTrials(problem.tasks, terms, problem.suite)


def conclude(trials: Trials, chosen: Chosen) -> None:
    """Delivers a candidate, confirms it if wanted, and ends the run.

    Args:
        trials: The trials.
        chosen: The candidate.
    """
    recorder, status, reason = trials.terms.recorder, trials.status, chosen.stopped
    delivered = trials.deliver(chosen)
    if recorder.run.tau is None:
        recorder.run.tau = delivered.k
    if trials.confirms:
        found = trials.confirm(delivered)
        if recorder.run.on_set:
            status = "verified" if found.passed else "not verified"
        else:
            status = word_of(found)
            reason = reason if status == "verified" else confirmed_text(found)
    recorder.finish(status, k=delivered.k, j=delivered.j, reason=reason)
