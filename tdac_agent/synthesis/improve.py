"""Search beyond the first success: variations of good candidates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, Protocol

import numpy as np

from tdac_agent.prompting.improve import Tried, improve_text
from tdac_agent.prompting.python_source import same_code
from tdac_agent.runs.recorder import Recorder, difference
from tdac_agent.runs.run_record import Attempt
from tdac_agent.synthesis.archive import Archive, C, Figures, Member, Refused
from tdac_agent.synthesis.dialogue import Dialogue, ModelAnswer, same_as
from tdac_agent.verification.diagnosis.model_picture import FailurePicture

FOUNDERS = 3
"""Most candidates of the loop that a search begins with."""
MOST_STALE = 3
"""Answers in a row without a new controller that drives, after which it ends."""


@dataclass(frozen=True, slots=True)
class Explored:
    """What came of a candidate.

    Attributes:
        figures: Its figures; None if it does not become a member.
        said: The result in one line.
        passed: Whether nothing failed.
        failed: What failed.
        drove: Whether it drove at all.
        seed: Seed of its jittered starts, if its tests had one.
    """

    figures: Figures | None
    said: str
    passed: bool = False
    failed: tuple[str, ...] = ()
    drove: bool = True
    seed: int | None = None


class Explorer(Protocol[C]):
    """Drives the candidates of a search, all in the same episodes.

    Attributes:
        aim: What the models are to increase, as an instruction.
    """

    aim: str

    @property
    def recorder(self) -> Recorder:
        """Records the run."""

    def goes_on(self, asked: int) -> bool:
        """Whether another variation may be asked for.

        Args:
            asked: Number of variations that were answered.
        """

    def made(self, k: int, source: str, folder: Path) -> C:
        """A candidate for a variation, which has not driven yet."""

    def explore(self, candidate: C) -> Explored:
        """Drives a candidate."""

    def figures(self, member: Member[C], best: Member[C]) -> list[str]:
        """The figures of a member for a model, in lines."""

    def feedback(self, candidate: C) -> str | None:
        """How a candidate failed in these episodes; None if it never did."""

    def picture(self, candidate: C) -> FailurePicture | None:
        """A picture of such a failure."""


class ImprovingSearch(Generic[C]):
    """Asks for variations of candidates until the episodes for it are used up.

    Parents are drawn from the Pareto front of the archive.

    Args:
        dialogue: The models.
        explorer: Drives candidates.
        known: Candidates so far; receives the variations.

    Attributes:
        archive: The members so far.
        asked: Number of variations that were answered.
    """

    def __init__(
        self, dialogue: Dialogue, explorer: Explorer[C], known: list[C]
    ) -> None:
        run = explorer.recorder.run
        assert run.seed is not None
        self.archive: Archive[C] = Archive()
        self.asked = 0
        self._dialogue, self._explorer = dialogue, explorer
        self._known = known
        self._results: list[tuple[C, Explored]] = []
        self._random = np.random.default_rng([run.seed, run.index])

    def run(self, founders: Sequence[C]) -> None:
        """Drives candidates of the loop, then variations, one after the other.

        Args:
            founders: Those that it begins with; at least one.

        Raises:
            OutOfBudget: The budget of money or tokens is used up.
            Fault: A model does not answer.
        """
        for candidate in founders:
            explored = self._explored(candidate)
            if explored.figures is not None:
                self.archive.members.append(Member(candidate, explored.figures))
        stale = 0
        while stale < MOST_STALE and self._explorer.goes_on(self.asked):
            parent = self.archive.parent(self._random)
            stale = 0 if self._varied(parent) else stale + 1

    def _varied(self, parent: Member[C]) -> bool:
        """Asks for a variation, and drives it; returns whether a new one drove."""
        run = self._explorer.recorder.run
        k = run.iterations + self.asked + 1
        answer = self._dialogue.improve(
            k,
            parent.candidate.source,
            self._text(parent),
            self._explorer.aim,
            self._explorer.picture(parent.candidate) if run.vision else None,
        )
        self.asked += 1
        return self._tried(k, parent, answer)

    def _text(self, parent: Member[C]) -> str:
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
        figures = self._explorer.figures(parent, self.archive.best())
        feedback = self._explorer.feedback(parent.candidate)
        return improve_text(figures, feedback, shown)

    def _tried(self, k: int, parent: Member[C], answer: ModelAnswer) -> bool:
        """Drives a variation and records it; returns whether a new one drove."""
        source, notes = answer
        if source is None:
            self._record(k, parent, notes, valid=False)
            return False
        recorder, before = self._explorer.recorder, parent.candidate.source
        folder = recorder.candidate(k, 0, source, before=before)
        same = [each for each in self._known if same_code(source, each.source)]
        if same:
            said = same_as(same[0].k, same[0].j)
            found = (known for one, known in self._results if one is same[0])
            earlier = next(found, None)
            self._record(k, parent, (*notes, said), earlier, unchanged=True)
            return False
        candidate = self._explorer.made(k, source, folder)
        self._known.append(candidate)
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

    def _explored(self, candidate: C) -> Explored:
        explored = self._explorer.explore(candidate)
        self._results.append((candidate, explored))
        return explored

    def _record(
        self,
        k: int,
        parent: Member[C],
        notes: tuple[str, ...],
        explored: Explored | None = None,
        *,
        valid: bool = True,
        unchanged: bool = False,
    ) -> None:
        found = explored or Explored(None, "")
        self._explorer.recorder.attempted(
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


def _changed(child: Member[C], parent: Member[C]) -> str:
    """How the figures changed, such as `Mean time score +0.012`."""
    after, before = child.figures, parent.figures
    parts = zip(after.ranked, after.rank, before.rank, strict=True)
    text = ", ".join(f"{name} {new - old:+.3f}" for name, new, old in parts)
    return text[0].upper() + text[1:]


def _told(member: Member[C], parent: Member[C]) -> str:
    change = member.figures.time - parent.figures.time
    return f"time score {member.figures.time:.3f}, {change:+.3f} from {parent.place}"
