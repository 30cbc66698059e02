"""A race: controllers that drive in the same episodes, and questions that follow.

The pool of episodes stays the same, so that any two candidates are compared in pairs.
Each question asks for a controller that is better than a known one, in one of several
ways; which way comes next is learned from what paid so far.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tdac_agent.models.provider import is_fixed
from tdac_agent.prompting.feedback import Feedback
from tdac_agent.prompting.python_source import same_code
from tdac_agent.runs.run_record import Attempt
from tdac_agent.synthesis.archive import Archive, Member, Refused
from tdac_agent.synthesis.bandit import Bandit
from tdac_agent.synthesis.calls import OutOfBudget
from tdac_agent.synthesis.candidates import Candidate, Explored
from tdac_agent.synthesis.dialogue import Dialogue, ModelAnswer, Notes, same_as
from tdac_agent.synthesis.paired_drop import is_clearly_worse
from tdac_agent.synthesis.question_kinds import (
    ASKED,
    FASTER,
    FRESH,
    INFORMED,
    MEASURED,
    MERGE,
    REPAIR,
    RULES,
)
from tdac_agent.synthesis.race_questions import RaceQuestions
from tdac_agent.synthesis.trials import Trials

FOUNDERS = 3
"""Most candidates of a loop that a race for improvements begins with."""
MOST_STALE = 3
"""The limit of a race for improvements; see `Race.run`."""
REPAIRED = 2
"""The best of so many controllers are repaired."""
POOL = "pool"
"""What rules are made for, if nothing failed."""
BLOCK = 8
"""Episodes after which a candidate is compared with what it is to improve."""


class Race:
    """Asks for better controllers until the calls or the episodes are used up.

    Args:
        dialogue: The models.
        trials: Drives candidates, all in the same episodes.
        written: Candidates so far; receives the others.
        most: Most questions after the candidates that it begins with.
        kinds: Kinds of questions that may be asked.

    Attributes:
        archive: The members so far.
        asked: Number of questions that were answered.
    """

    def __init__(
        self,
        dialogue: Dialogue,
        trials: Trials,
        written: list[Candidate],
        *,
        most: int,
        kinds: Sequence[str] = ASKED,
    ) -> None:
        self._recorder = trials.terms.recorder
        run = self._recorder.run
        assert run.seed is not None
        self.archive, self.asked = Archive(), 0
        self._dialogue, self._trials, self._written = dialogue, trials, written
        self._most = most
        self._random = np.random.default_rng([run.seed, run.index])
        self._bandit = Bandit(kinds, self._random)
        self._texts = RaceQuestions(self.archive, trials)

    def ask_first(self, given: str | None, count: int) -> None:
        """Asks for the first controllers, and lets them drive.

        Args:
            given: Source of an initial controller, which is the first of all.
            count: Their number.

        Raises:
            OutOfBudget: The budget of money or tokens is used up.
        """
        ks = range(1, count + 1)
        begun = [] if given is None else [ModelAnswer(given)]
        answers = [*begun, *self._dialogue.generate_all(ks[len(begun) :])]
        for k, answer in zip(ks, answers, strict=True):
            kind = "given" if begun and k == 1 else FRESH
            self._entered(k, answer, kind, ())

    def begin_with(self, candidates: Sequence[Candidate]) -> None:
        """Lets candidates of a loop drive that work, the best one first."""
        trials = self._trials
        results = [(trials.result(each), each) for each in candidates]
        working = [(result.rank[0], each) for result, each in results if result.works]
        working.sort(key=lambda each: -each[0])
        most = max(1, min(FOUNDERS, trials.terms.shares.variations))
        for _, candidate in working[:most]:
            self._join(candidate, self._explored(candidate, None), (), "")

    def run(self, most_stale: int | None = None) -> str:
        """Asks one question after the other.

        Args:
            most_stale: Questions in a row without a new controller that drives, after
                which it ends; None for no limit.

        Returns:
            What ended the race early, or nothing.

        Raises:
            Fault: A model does not answer.
        """
        stale = 0
        try:
            while self.asked < self._most and stale != most_stale:
                kind = self._next_kind()
                if not kind or not self._trials.can_explore(self.asked):
                    break
                stale = 0 if self._question(kind) else stale + 1
        except OutOfBudget as error:
            return str(error)
        return ""

    def _next_kind(self) -> str:
        """The kind of the next question; empty if there is nothing to ask."""
        fixed, live = is_fixed(self._dialogue.learner), self.archive.live
        possible = set[str]() if fixed else {FRESH, MEASURED, INFORMED, RULES}
        if live:
            possible |= {REPAIR, FASTER}
        if len(self._texts.partners()) == 2:
            possible.add(MERGE)
        possible &= self._bandit.odds.keys()
        if possible:
            return self._bandit.choose(possible)
        # There is no controller to ask about.
        return "" if fixed else FRESH

    def _question(self, kind: str) -> bool:
        """Asks a question of a kind; returns whether a new controller drove."""
        k = self._begun + self.asked + 1
        parents = self._parents(kind)
        answer = self._answer(kind, k, parents)
        self.asked += 1
        return self._entered(k, answer, kind, parents)

    @property
    def _begun(self) -> int:
        """Number of the last iteration before the first question."""
        run = self._recorder.run
        return run.candidates if run.search == "race" else run.iterations

    def _parents(self, kind: str) -> tuple[Member, ...]:
        """The members that a question is about."""
        live = self.archive.live
        if kind == MERGE:
            return self._texts.partners()
        if kind == FASTER:
            return (live[0],)
        if kind == REPAIR:
            return (live[int(self._random.integers(min(REPAIRED, len(live))))],)
        return ()

    def _answer(self, kind: str, k: int, parents: tuple[Member, ...]) -> ModelAnswer:
        if kind == FRESH:
            return self._dialogue.generate_all([k])[0]
        if kind in (MEASURED, INFORMED, RULES):
            known = self._texts.known(robot_only=kind == MEASURED)
            if kind == RULES:
                self._learn_rules(k, known)
                return self._dialogue.generate_all([k])[0]
            return self._dialogue.informed(k, known, len(self._written))
        text, aim = self._texts.about(kind, parents)
        source = parents[0].candidate.source
        return self._dialogue.improve(k, source, text, aim)

    def _entered(
        self, k: int, answer: ModelAnswer, kind: str, parents: tuple[Member, ...]
    ) -> bool:
        """Lets a controller drive and records it; returns whether a new one drove."""
        source, notes = answer
        if source is None:
            self._record(k, kind, parents, notes, valid=False)
            self._learn(kind, paid=False)
            return False
        before = parents[0].candidate.source if parents else None
        folder = self._recorder.candidate(k, 0, source, before=before)
        same = [each for each in self._written if same_code(source, each.source)]
        if same:
            said = same_as(same[0].k, same[0].j)
            old = same[0].explored
            self._record(k, kind, parents, (*notes, said), old, unchanged=True)
            self._learn(kind, paid=False)
            return False
        candidate = Candidate(k, 0, source, folder)
        self._written.append(candidate)
        against = parents[0] if parents else self.archive.top
        explored = self._explored(candidate, against if kind != "given" else None)
        said, paid = self._join(candidate, explored, parents, kind)
        self._record(k, kind, parents, (*notes, said), explored)
        self._learn(kind, paid=paid)
        return explored.drove

    def _explored(self, candidate: Candidate, against: Member | None) -> Explored:
        """Lets a candidate drive; it stops early if it is clearly worse."""
        trials, size = self._trials, self._trials.terms.shares.block
        refused = trials.admit(candidate)
        while refused is None and len(candidate.pool) < size:
            count = min(BLOCK, size - len(candidate.pool))
            refused = trials.drive_pool(candidate, count)
            if against is not None and is_clearly_worse(
                candidate.pool, against.candidate.pool
            ):
                break
        candidate.explored = refused or trials.pool_result(candidate)
        if candidate.pool:
            trials.pool_feedback.note(candidate)
        return candidate.explored

    def _join(
        self,
        candidate: Candidate,
        explored: Explored,
        parents: tuple[Member, ...],
        kind: str,
    ) -> tuple[str, bool]:
        """Adds a candidate to the archive; returns what came of it and if it paid."""
        parent, top = parents[0] if parents else None, self.archive.top
        if explored.figures is None:
            self.archive.refused.append(Refused(candidate, parent, explored.said))
            return explored.said, False
        founder = self.asked == 0
        member = Member(candidate, explored.figures, parent, kind, founder)
        told = explored.said
        if len(candidate.pool) < self._trials.terms.shares.block:
            reference = parent or top
            assert reference is not None
            told = f"dropped after {len(candidate.pool)} episodes, since it was worse "
            told += f"than {reference.candidate.place}"
            self.archive.dropped.append(member)
            return told, False
        self.archive.members.append(member)
        said = f"time score {explored.figures.time:.3f}"
        if parent is not None:
            change = explored.figures.time - parent.figures.time
            said += f", {change:+.3f} from {parent.candidate.place}"
        reference = parent or top
        paid = reference is None or member.figures.rank > reference.figures.rank
        if paid:
            self.archive.replace(parents)
        return f"{said}; {told}", paid and reference is not None

    def _learn_rules(self, k: int, known: str) -> None:
        """Has rules made of what is known, which then stand in the question."""
        best = self.archive.top
        candidate = self._written[-1] if best is None else best.candidate
        explored = candidate.explored
        said, failed = (
            ("", ()) if explored is None else (explored.said, explored.failed)
        )
        failure = Feedback(known, said, failed or (POOL,))
        self._dialogue.summarise(k, 0, candidate.source, failure)

    def _learn(self, kind: str, *, paid: bool) -> None:
        if kind in self._bandit.odds:
            self._bandit.learn(kind, paid=paid)

    def _record(
        self,
        k: int,
        kind: str,
        parents: tuple[Member, ...],
        notes: Notes,
        explored: Explored | None = None,
        *,
        valid: bool = True,
        unchanged: bool = False,
    ) -> None:
        found = explored or Explored(None, "")
        places = [(each.candidate.k, each.candidate.j) for each in parents]
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
                asked=kind,
                parent=places[0] if places else None,
                merged=places[1] if len(places) > 1 else None,
            )
        )
