"""Search beyond the first success: variations of good candidates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tdac_agent.prompting.improve import Tried, improve_text
from tdac_agent.prompting.python_source import same_code
from tdac_agent.runs.recorder import difference
from tdac_agent.runs.run_record import Attempt
from tdac_agent.synthesis.archive import Archive, Member, Refused
from tdac_agent.synthesis.calls import OutOfBudget
from tdac_agent.synthesis.candidates import Candidate, Explored
from tdac_agent.synthesis.dialogue import Dialogue, ModelAnswer, same_as
from tdac_agent.synthesis.trials import Trials

FOUNDERS = 3
"""Most candidates of the loop that a search begins with."""
MOST_STALE = 3
"""Answers in a row without a new controller that drives, after which it ends."""


class ImprovingSearch:
    """Asks for variations of candidates until the episodes for it are used up.

    Parents are drawn from the Pareto front of the archive.

    Args:
        dialogue: The models.
        trials: Drives candidates, all in the same episodes.
        written: Candidates so far; receives the variations.

    Attributes:
        archive: The members so far.
        asked: Number of variations that were answered.
    """

    def __init__(
        self, dialogue: Dialogue, trials: Trials, written: list[Candidate]
    ) -> None:
        self._recorder = trials.terms.recorder
        run = self._recorder.run
        assert run.seed is not None
        self.archive = Archive()
        self.asked = 0
        self._dialogue, self._trials, self._written = dialogue, trials, written
        self._random = np.random.default_rng([run.seed, run.index])

    def run(self, able: Sequence[Candidate]) -> str:
        """Drives the best candidates of the loop, then variations, one by one.

        Without money for further questions, the run goes on with what there is.

        Args:
            able: The candidates of the loop; at least one of them works.

        Returns:
            What ended the search early, or nothing.

        Raises:
            Fault: A model does not answer.
        """
        for candidate in self._founders(able):
            explored = self._explored(candidate)
            if explored.figures is not None:
                self.archive.members.append(Member(candidate, explored.figures))
        stale = 0
        try:
            while stale < MOST_STALE and self._trials.can_explore(self.asked):
                parent = self.archive.parent(self._random)
                stale = 0 if self._varied(parent) else stale + 1
        except OutOfBudget as error:
            return str(error)
        return ""

    def _founders(self, able: Sequence[Candidate]) -> list[Candidate]:
        """The candidates that it begins with, the best one first."""
        results = [(self._trials.result(each), each) for each in able]
        working = [(result.rank[0], each) for result, each in results if result.works]
        working.sort(key=lambda each: -each[0])
        most = max(1, min(FOUNDERS, self._trials.terms.shares.variations))
        return [each for _, each in working[:most]]

    def _varied(self, parent: Member) -> bool:
        """Asks for a variation, and drives it; returns whether a new one drove."""
        k = self._recorder.run.iterations + self.asked + 1
        answer = self._dialogue.improve(
            k, parent.candidate.source, self._text(parent), self._trials.aim
        )
        self.asked += 1
        return self._tried(k, parent, answer)

    def _text(self, parent: Member) -> str:
        """What the models are told about a member and its variations."""
        tried = [
            (child.candidate, child.figures.rank, _changed(child, parent))
            for child in self.archive.children(parent)
        ]
        tried += [
            (each.candidate, (), f"Failed: {each.said}")
            for each in self.archive.refused_of(parent)
        ]
        tried.sort(key=lambda each: each[0].k)
        source = parent.candidate.source
        shown = [
            Tried(difference(source, candidate.source), rank, said)
            for candidate, rank, said in tried
        ]
        lines = self._trials.lines(parent, self.archive.best())
        return improve_text(lines, _explored(parent).feedback, shown)

    def _tried(self, k: int, parent: Member, answer: ModelAnswer) -> bool:
        """Drives a variation and records it; returns whether a new one drove."""
        source, notes = answer
        if source is None:
            self._record(k, parent, notes, valid=False)
            return False
        before = parent.candidate.source
        folder = self._recorder.candidate(k, 0, source, before=before)
        same = [each for each in self._written if same_code(source, each.source)]
        if same:
            said = same_as(same[0].k, same[0].j)
            self._record(k, parent, (*notes, said), same[0].explored, unchanged=True)
            return False
        candidate = Candidate(k, 0, source, folder)
        self._written.append(candidate)
        explored = self._explored(candidate)
        said = explored.said
        if explored.figures is None:
            self.archive.refused.append(Refused(candidate, parent, said))
        else:
            member = Member(candidate, explored.figures, parent)
            self.archive.members.append(member)
            said = f"{_told(member, parent)}; {said}"
        self._record(k, parent, (*notes, said), explored)
        return explored.drove

    def _explored(self, candidate: Candidate) -> Explored:
        candidate.explored = self._trials.explore(candidate)
        return candidate.explored

    def _record(
        self,
        k: int,
        parent: Member,
        notes: tuple[str, ...],
        explored: Explored | None = None,
        *,
        valid: bool = True,
        unchanged: bool = False,
    ) -> None:
        found = explored or Explored(None, "")
        self._recorder.attempted(
            Attempt(
                k=k,
                j=0,
                valid=valid,
                passed=found.passed,
                failed_tests=found.failed,
                seed=found.seed,
                notes=notes,
                unchanged=unchanged,
                parent=(parent.candidate.k, parent.candidate.j),
            )
        )


def _explored(member: Member) -> Explored:
    assert member.candidate.explored is not None
    return member.candidate.explored


def _changed(child: Member, parent: Member) -> str:
    """How the figures changed, such as `Mean time score +0.012`."""
    after, before = child.figures, parent.figures
    parts = zip(after.ranked.values(), after.rank, before.rank, strict=True)
    text = ", ".join(f"{name} {new - old:+.3f}" for name, new, old in parts)
    return text[0].upper() + text[1:]


def _told(member: Member, parent: Member) -> str:
    change, place = member.figures.time - parent.figures.time, parent.candidate.place
    return f"time score {member.figures.time:.3f}, {change:+.3f} from {place}"
