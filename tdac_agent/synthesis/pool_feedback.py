"""What a race tells of candidates that drove in the same episodes.

A table of the losses by cause, the pieces of the worst tracks, failures, and what the
drives show of the robot: all of it in the frame that a controller observes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import fmean

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.errors import RunError
from tdac_agent.prompting.feedback import cut
from tdac_agent.synthesis.candidates import Candidate
from tdac_agent.tasks.setting import Nominal
from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.losses import Losses
from tdac_agent.verification.diagnosis.robot_log import RobotLog
from tdac_agent.verification.diagnosis.track import told_pieces, told_sibling
from tdac_agent.verification.episode_report import named
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.store import TRAJECTORIES

MOST_ROWS = 16
"""Most episodes that get a row of the table: the worst ones."""
MOST_WORST = 3
"""Episodes whose tracks are told."""
MOST_FAILURES, OF = 3, 3
"""Most failures that are told: at most one of `OF`, but at least one."""
FAILURE_CHARS = 900
Scene = Callable[[int], tuple[Nominal, Units]]
"""The task of an episode, by its number, with the units that a controller observes."""


@dataclass(frozen=True, slots=True)
class PoolFeedback:
    """Tells of candidates that drove in the same episodes.

    Attributes:
        word: What an episode is called, such as `world`.
        first: Number of the first one of the pool; in texts, it is 1.
        scene: Where an episode took place.
        log: What all drives show of the robot.
    """

    word: str
    first: int
    scene: Scene
    log: RobotLog = field(default_factory=RobotLog)

    def note(self, candidate: Candidate) -> None:
        """Adds the drives of a candidate to what is known of the robot."""
        for row in candidate.pool:
            trajectory = trajectory_of(candidate, row)
            if trajectory is not None:
                self.log.add(trajectory, *self.scene(row.number))

    def robot(self) -> str:
        """What the drives show of the robot; empty if nothing."""
        lines = [f"- {line}" for line in self.log.lines]
        return "\n".join(lines)

    def table(self, candidate: Candidate, others: Sequence[Candidate]) -> str:
        """Losses of a candidate by cause, with the scores of others beside it.

        Args:
            candidate: The candidate.
            others: Its parent and the best sibling, for example.
        """
        rows = sorted(candidate.pool, key=lambda row: (row.time_score, row.number))
        scores = [{row.number: row.time_score for row in each.pool} for each in others]
        causes = list(Losses().by_cause)
        columns = [f"candidate {each.name}" for each in others]
        head = [self.word, "least s", "its s", "score", *causes, *columns]
        lines = [_line(head), _line(["---"] * len(head))]
        shown = rows[:MOST_ROWS]
        for row in shown:
            cells = [self._name(row), *_seconds(row), f"{row.time_score:.2f}"]
            lost = row.lost or Losses(failure=1.0)
            cells += [_share(share) for share in lost.by_cause.values()]
            cells += [_score(one.get(row.number)) for one in scores]
            lines.append(_line(cells))
        means = mean_losses(rows)
        cells = [f"mean of {len(rows)}", "", "", f"{candidate.pool_score:.3f}"]
        cells += [f"{share:.3f}" for share in means.values()]
        both = [
            [one[row.number] for row in rows if row.number in one] for one in scores
        ]
        cells += [f"{fmean(each):.3f}" if each else "" for each in both]
        lines.append(_line(cells))
        if len(rows) > len(shown):
            lines.append(f"(the {len(shown)} worst of {len(rows)} are shown)")
        return "\n".join(lines)

    def worst(self, candidate: Candidate, others: Sequence[Candidate]) -> str:
        """Pieces of the worst tracks that reached the goal, and what others did there.

        Args:
            candidate: The candidate.
            others: Other candidates; the one that is best there is told.
        """
        reached = [row for row in candidate.pool if row.success]
        reached.sort(key=lambda row: (row.time_score, row.number))
        parts = [self._track(candidate, row, others) for row in reached[:MOST_WORST]]
        return "\n".join(part for part in parts if part)

    def _track(
        self, candidate: Candidate, row: EpisodeRow, others: Sequence[Candidate]
    ) -> str:
        trajectory = trajectory_of(candidate, row)
        if trajectory is None:
            return ""
        scene = self.scene(row.number)
        seconds, least = _seconds(row)[::-1]
        lines = [
            f"{self.word} {self._name(row)}: score {row.time_score:.2f}, {seconds} s, "
            f"least {least} s"
        ]
        pieces = told_pieces(trajectory, *scene)
        if not pieces:
            return ""
        lines += [f"- {line}" for line in pieces]
        best = _best_in(others, row)
        if best is not None:
            other, found = best
            sibling = trajectory_of(other, found)
            if sibling is not None:
                way = told_sibling(trajectory, sibling, *scene)
                lines.append(
                    f"- candidate {other.name} takes {_seconds(found)[1]} s, {way}"
                )
        return "\n".join(lines)

    def failures(self, candidate: Candidate) -> str:
        """Causes of the failures, and diagnoses of at most one of three."""
        failed = [row for row in candidate.pool if not row.success]
        if not failed:
            return ""
        most = min(MOST_FAILURES, max(1, len(failed) // OF))
        told = [row for row in failed if row.text or row.error][:most]
        lines = [f"{len(failed)} of {len(candidate.pool)} failed:"]
        for row in told:
            text, name = row.text or str(row.error), f"{self.word} {self._name(row)}"
            text = text.replace(named(row), name, 1)
            lines.append(f"- {cut(text, FAILURE_CHARS)}")
        return "\n".join(lines)

    def _name(self, row: EpisodeRow) -> str:
        return str(row.number - self.first + 1)


def trajectory_of(candidate: Candidate, row: EpisodeRow) -> Trajectory | None:
    """The trajectory of an episode of the pool; None if it was not driven or kept."""
    for folder in candidate.pool_folders:
        path: Path = folder / TRAJECTORIES / f"{row.number}.npz"
        if path.is_file():
            try:
                found = Trajectory.load(path)
            except RunError:
                return None
            return found if found.steps else None
    return None


def mean_losses(rows: Sequence[EpisodeRow]) -> dict[str, float]:
    """Mean shares of the score that was lost, by cause."""
    lost = [(row.lost or Losses(failure=1.0)).by_cause for row in rows]
    return {name: fmean(each[name] for each in lost) for name in lost[0]}


def _best_in(
    others: Sequence[Candidate], row: EpisodeRow
) -> tuple[Candidate, EpisodeRow] | None:
    """The candidate that was clearly better in an episode, with its row."""
    found = [
        (other, each)
        for other in others
        for each in other.pool
        if each.number == row.number and each.time_score > row.time_score + 0.05
    ]
    return max(found, key=lambda pair: pair[1].time_score, default=None)


def _seconds(row: EpisodeRow) -> tuple[str, str]:
    """The least and the needed time, s."""
    if not row.seconds or row.least_steps is None:
        return "", ""
    dt = row.seconds / row.steps
    return f"{row.least_steps * dt:.1f}", f"{row.seconds:.1f}"


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _share(share: float) -> str:
    return f"{share:.2f}" if share >= 0.005 else ""


def _score(score: float | None) -> str:
    return "" if score is None else f"{score:.2f}"
