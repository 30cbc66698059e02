"""The texts of the questions of a race: what is known, and about which controllers."""

from __future__ import annotations

from itertools import combinations
from statistics import fmean

from tdac_agent.prompting.feedback import cut
from tdac_agent.prompting.improve import Tried, improve_text
from tdac_agent.runs.recorder import difference
from tdac_agent.synthesis.archive import Archive, Member
from tdac_agent.synthesis.candidates import Candidate
from tdac_agent.synthesis.pool_feedback import mean_losses
from tdac_agent.synthesis.question_kinds import FASTER, MERGE
from tdac_agent.synthesis.trials import Trials

LEAST_GAIN = 0.02
"""Two controllers are merged if the better one of both in each episode would be ahead
of the better one by this mean time score."""
MOST_REFUSED = 3
MOST_KNOWN = 8
"""Most candidates with a line of their own, the best ones."""
COUNTEREXAMPLE = (
    "Robots and worlds differ a little from what a controller is told. In these "
    "drives, only what is named differed. It is a search: there may be smaller "
    "failures."
)
AIMS = {
    "repair": "Find out what costs most, failures or time, and repair that.",
    FASTER: "Save time where it is lost: the table says in which worlds, and on what.",
    MERGE: (
        "Each of the two is ahead in some episodes. Write one controller that is as "
        "good as the better one in all of them: find out which idea of which one "
        "makes the difference, and combine the ideas, not the files."
    ),
}


class RaceQuestions:
    """Writes the texts.

    Args:
        archive: The members so far.
        trials: Their episodes.
    """

    def __init__(self, archive: Archive, trials: Trials) -> None:
        self._archive, self._trials = archive, trials

    def partners(self) -> tuple[Member, ...]:
        """The two live members that are worth most together; none if it is little."""
        pairs = [
            (_joint(one.candidate, other.candidate) - one.figures.time, one, other)
            for one, other in combinations(self._archive.live, 2)
        ]
        gain, *pair = max(pairs, key=lambda each: each[0], default=(0.0,))
        return tuple(pair) if gain >= LEAST_GAIN else ()

    def known(self, *, robot_only: bool = False) -> str:
        """What all drives so far show, without any code.

        Args:
            robot_only: Whether only what they show of the robot is told.
        """
        if robot_only:
            return "\n".join(self._robot("(nothing yet)"))
        archive, told = self._archive, self._trials.pool_feedback
        # Of those that were dropped, the figures are of fewer episodes.
        ranked = [*_ranked(archive.members), *_ranked(archive.dropped)]
        parts = []
        if ranked:
            parts += ["### How they drove", *map(self._line, ranked[:MOST_KNOWN])]
        robot = self._robot()
        parts += ["", *robot] if robot else []
        if ranked:
            best, others = ranked[0].candidate, [each.candidate for each in ranked[1:]]
            parts += ["", f"### The best one, candidate {best.name}"]
            parts += self._drives(best, [], others)
        parts += self._smallest_failure()
        for each in ranked[1:3]:
            failed, name = told.failures(each.candidate), each.candidate.name
            parts += ["", f"### Failures of candidate {name}", failed] if failed else []
        return "\n".join([*parts, *self._refused()])

    def _robot(self, nothing: str = "") -> list[str]:
        """What all drives show of the robot, under a heading; none if it is nothing."""
        found = self._trials.pool_feedback.robot() or nothing
        return ["### What all drives show of the robot", found] if found else []

    def _smallest_failure(self) -> list[str]:
        """What the best member survives and what not, if the run searches for it."""
        top = self._archive.top
        told = "" if top is None else self._trials.counterexample(top.candidate)
        if top is None or not told:
            return []
        head = f"### How far candidate {top.candidate.name} carries"
        return ["", head, COUNTEREXAMPLE, told]

    def _refused(self) -> list[str]:
        """Why the latest candidates that did not drive were refused."""
        parts = []
        for one in self._archive.refused[-MOST_REFUSED:]:
            name, explored = one.candidate.name, one.candidate.explored
            said = (explored and explored.feedback) or one.said
            head = f"### Candidate {name} failed tests, and did not drive"
            parts += ["", head, cut(said)]
        return parts

    def about(self, kind: str, parents: tuple[Member, ...]) -> tuple[str, str]:
        """What a model is told about controllers, and what it is to do.

        Args:
            kind: `repair`, `faster` or `merge`.
            parents: The member to improve; with `merge`, also the other one.
        """
        parent, *partners = parents
        top = self._archive.best()
        others = [each.candidate for each in (*partners, top) if each is not parent]
        siblings = [
            each.candidate for each in self._archive.members if each is not parent
        ]
        lines = [self._line(parent)]
        if top is not parent:
            lines.append(self._line(top))
        lines += ["", *self._drives(parent.candidate, others[:2], siblings)]
        robot = self._robot()
        lines += ["", *robot] if robot else []
        lines += self._smallest_failure()
        for each in partners:
            source = each.candidate.source.rstrip()
            lines += ["", f"### The other controller, candidate {each.candidate.name}"]
            lines += ["```python", source, "```", *self._drives(each.candidate, [], [])]
        text = improve_text(lines, self._tried(parent))
        return text, f"{AIMS[kind]} {self._trials.aim}"

    def _line(self, member: Member) -> str:
        candidate = member.candidate
        lost = mean_losses(candidate.pool)
        causes = ", ".join(
            f"{c} {share:.3f}" for c, share in lost.items() if share >= 0.001
        )
        reached = sum(row.success for row in candidate.pool)
        figures = ", ".join(
            f"{name} {value:.3f}"
            for name, value in zip(
                member.figures.ranked.values(), member.figures.rank, strict=True
            )
        )
        return (
            f"- candidate {candidate.name}: {figures}; the goal reached in {reached} "
            f"of {len(candidate.pool)} {self._trials.pool_feedback.word}s; lost by "
            f"{causes or 'nothing'}"
        )

    def _drives(
        self, candidate: Candidate, others: list[Candidate], siblings: list[Candidate]
    ) -> list[str]:
        told = self._trials.pool_feedback
        parts = [told.table(candidate, others)]
        for text in (told.worst(candidate, siblings), told.failures(candidate)):
            parts += ["", text] if text else []
        return parts

    def _tried(self, parent: Member) -> list[Tried]:
        """Answers to earlier questions about a member that were not better."""
        archive, source = self._archive, parent.candidate.source
        tried = [
            (child.candidate, child.figures.rank, _changed(child, parent))
            for child in archive.children(parent)
        ]
        tried += [
            (each.candidate, (), f"Failed: {each.said}")
            for each in archive.refused_of(parent)
        ]
        tried.sort(key=lambda each: each[0].k)
        return [
            Tried(difference(source, candidate.source), rank, said)
            for candidate, rank, said in tried
        ]


def _ranked(members: list[Member]) -> list[Member]:
    return sorted(members, key=lambda each: each.figures.rank, reverse=True)


def _joint(one: Candidate, other: Candidate) -> float:
    """Mean time score of the better one of two in each episode that both drove in."""
    known = {row.number: row.time_score for row in other.pool}
    scores = [
        max(row.time_score, known[row.number])
        for row in one.pool
        if row.number in known
    ]
    return fmean(scores) if scores else 0.0


def _changed(child: Member, parent: Member) -> str:
    """How scores and losses changed, in the episodes that both drove in."""
    numbers = {row.number for row in child.candidate.pool}
    before = [row for row in parent.candidate.pool if row.number in numbers]
    after = child.candidate.pool
    change = fmean(r.time_score for r in after) - fmean(r.time_score for r in before)
    lost, gone = mean_losses(after), mean_losses(before)
    causes = ", ".join(
        f"{name} {lost[name] - gone[name]:+.3f}"
        for name in lost
        if abs(lost[name] - gone[name]) >= 0.005
    )
    text = f"Mean time score {change:+.3f} in {len(after)} episodes"
    return f"{text}; lost more or less by {causes}" if causes else text
