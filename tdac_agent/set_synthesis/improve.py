"""Search beyond the first success: variations of good candidates."""

from __future__ import annotations

import numpy as np

from tdac_agent.evaluation.set_report import SetReport
from tdac_agent.prompting.extract import same_code
from tdac_agent.prompting.improve import improve_text
from tdac_agent.runs.recorder import difference
from tdac_agent.runs.run_record import Attempt
from tdac_agent.set_synthesis.archive import Archive, Figures, Member
from tdac_agent.set_synthesis.feedback import set_feedback
from tdac_agent.set_synthesis.pictures import world_picture
from tdac_agent.set_synthesis.trials import Candidate, Trials
from tdac_agent.synthesis.dialogue import Dialogue, ModelAnswer
from tdac_agent.verification.diagnosis.model_picture import FailurePicture

FOUNDERS = 3
"""Most candidates of the loop that the search begins with."""
MOST_STALE = 3
"""Answers in a row without a new controller that drives, after which it ends."""
FINALISTS = 4
"""Most candidates that go on to the selection."""


def finalists(archive: Archive) -> list[Candidate]:
    """The candidates for the selection, oldest first: the best founder is one."""
    best = [each.candidate for each in archive.front()[:FINALISTS]]
    founder = base_of(archive)
    chosen = best if any(founder is each for each in best) else [founder, *best]
    return sorted(chosen, key=lambda each: (each.k, each.j))


def base_of(archive: Archive) -> Candidate:
    """The best founder: what the search has to improve."""
    founders = [each for each in archive.members if each.parent is None]
    return Archive(founders).best().candidate


class ImprovingSearch:
    """Asks for variations of candidates until the episodes for it are used up.

    All members drive on the same worlds of `dev`, which no other test uses. Parents are
    drawn from the Pareto front of the archive.

    Args:
        dialogue: The models.
        trials: Drives candidates.
        candidates: Those of the loop; receives the variations. One of them at least has
            reached a goal.

    Attributes:
        archive: The members so far.
    """

    def __init__(
        self, dialogue: Dialogue, trials: Trials, candidates: list[Candidate]
    ) -> None:
        run = trials.recorder.run
        assert run.seed is not None
        self.archive = Archive()
        self._dialogue, self._trials = dialogue, trials
        self._candidates = candidates
        self._random = np.random.default_rng([run.seed, run.index])

    def run(self) -> None:
        """Drives the best candidates of the loop, then variations of them.

        Raises:
            OutOfBudget: The budget of money or tokens is used up.
            Fault: A model does not answer.
        """
        self._found()
        self._vary()

    def _found(self) -> None:
        """Drives the founders, the best candidates of the loop."""
        able = [each for each in self._candidates if each.feedback_score]
        able.sort(key=lambda each: -each.feedback_score)
        share = self._trials.explore_left // self._trials.shares.block - 1
        for candidate in able[: max(1, min(FOUNDERS, share))]:
            report = self._trials.explore(candidate)
            member = Member(candidate, report, Figures.of(report))
            self.archive.members.append(member)

    def _vary(self) -> None:
        """Asks for variations, one after the other, and drives them."""
        number, stale = self._trials.recorder.run.iterations + 1, 0
        while self._trials.can_explore and stale < MOST_STALE:
            parent = self.archive.parent(self._random)
            answer = self._dialogue.improve(
                number,
                parent.candidate.source,
                self._text(parent),
                self._picture(parent),
            )
            stale = 0 if self._tried(number, parent, answer) else stale + 1
            number += 1

    def _picture(self, parent: Member) -> FailurePicture | None:
        """A picture of a failure, if the models are shown pictures."""
        if not self._trials.recorder.run.vision:
            return None
        folder = parent.candidate.exploring_folder
        return world_picture(self._trials.tasks, parent.report, folder)

    def _text(self, parent: Member) -> str:
        """What the models are told about a member and its variations."""
        feedback = None
        if parent.report.successes < parent.report.worlds:
            feedback = set_feedback(parent.report).text
        tried = [
            (
                difference(parent.candidate.source, child.candidate.source),
                child.figures.time - parent.figures.time,
            )
            for child in self.archive.children(parent)
        ]
        return improve_text(
            worlds=parent.report.worlds,
            figures=parent.figures,
            best=self.archive.best().figures.time,
            feedback=feedback,
            tried=tried,
        )

    def _tried(self, k: int, parent: Member, answer: ModelAnswer) -> bool:
        """Drives a variation and records it; returns whether it is a new member."""
        source, notes = answer
        if source is None:
            self._record(k, parent, notes, valid=False)
            return False
        recorder = self._trials.recorder
        folder = recorder.candidate(k, 0, source, before=parent.candidate.source)
        same = [each for each in self._candidates if same_code(source, each.source)]
        if same:
            said = f"same code as k={same[0].k} j={same[0].j}"
            self._record(k, parent, (*notes, said), unchanged=True)
            return False
        candidate = Candidate(k, 0, source, folder)
        self._candidates.append(candidate)
        report = self._trials.explore(candidate)
        if not report.worlds:
            refused = set_feedback(report).line
            self._record(k, parent, (*notes, refused), failed=tuple(report.told))
            return False
        member = Member(candidate, report, Figures.of(report), parent)
        self.archive.members.append(member)
        self._record(
            k,
            parent,
            (*notes, _told(member, parent)),
            passed=report.successes == report.worlds,
            failed=tuple(report.causes),
        )
        return True

    def _record(
        self,
        k: int,
        parent: Member,
        notes: tuple[str, ...],
        *,
        valid: bool = True,
        passed: bool = False,
        failed: tuple[str, ...] = (),
        unchanged: bool = False,
    ) -> None:
        self._trials.recorder.attempted(
            Attempt(
                k=k,
                j=0,
                valid=valid,
                passed=passed,
                failed_tests=failed,
                notes=notes,
                unchanged=unchanged,
                parent=(parent.candidate.k, parent.candidate.j),
            )
        )


def _told(member: Member, parent: Member) -> str:
    report: SetReport = member.report
    change = member.figures.time - parent.figures.time
    return (
        f"time score {member.figures.time:.3f}, {change:+.3f} from {parent.place}; the "
        f"goal reached in {report.successes} of {report.worlds} worlds"
    )
