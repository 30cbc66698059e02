"""Variations of good candidates for a task set: how they drive, and who is selected."""

from __future__ import annotations

from dataclasses import astuple, dataclass
from pathlib import Path
from statistics import fmean

from tdac_agent.runs.recorder import Recorder
from tdac_agent.set_synthesis.feedback import set_feedback
from tdac_agent.set_synthesis.pictures import world_picture
from tdac_agent.set_synthesis.trials import Candidate, Trials
from tdac_agent.synthesis.archive import Archive, Member
from tdac_agent.synthesis.improve import FOUNDERS, Explored
from tdac_agent.verification.diagnosis.model_picture import FailurePicture
from tdac_agent.verification.episode_report import EpisodeReport

FINALISTS = 4
"""Most candidates that go on to the selection."""
WORST = 4
"""The worst n-th of the worlds stands for robustness."""


@dataclass(frozen=True, slots=True)
class SetFigures:
    """How a candidate drove on the worlds of the search; higher is better, in [0, 1].

    Attributes:
        time: Mean time score.
        path: Mean path score.
        success: Fraction of worlds whose goal was reached.
        worst: Mean time score on the worst quarter of the worlds.
    """

    time: float
    path: float
    success: float
    worst: float
    ranked = ("mean time score",)

    @classmethod
    def of(cls, report: EpisodeReport) -> SetFigures:
        """The figures of a report with episodes."""
        episodes = report.episodes
        times = sorted(each.time_score for each in episodes)
        worst = times[: max(1, len(times) // WORST)]
        return cls(
            fmean(times),
            fmean(each.path_score for each in episodes),
            fmean(each.success for each in episodes),
            fmean(worst),
        )

    @property
    def values(self) -> tuple[float, ...]:
        """See `Figures`."""
        return astuple(self)

    @property
    def rank(self) -> tuple[float, ...]:
        """See `Figures`."""
        return (self.time,)


def founders(trials: Trials, candidates: list[Candidate]) -> list[Candidate]:
    """The candidates of the loop that a search begins with, the best one first.

    Args:
        trials: Has the episodes for variations.
        candidates: Those of the loop; one of them at least has reached a goal.
    """
    able = [each for each in candidates if each.feedback_score]
    able.sort(key=lambda each: -each.feedback_score)
    share = trials.explore_left // trials.shares.block - 1
    return able[: max(1, min(FOUNDERS, share))]


def finalists(archive: Archive[Candidate]) -> list[Candidate]:
    """The candidates for the selection, oldest first: the best founder is one."""
    best = [each.candidate for each in archive.front()[:FINALISTS]]
    founder = base_of(archive)
    chosen = best if any(founder is each for each in best) else [founder, *best]
    return sorted(chosen, key=lambda each: (each.k, each.j))


def base_of(archive: Archive[Candidate]) -> Candidate:
    """The best founder: what the search has to improve."""
    return Archive(archive.founders).best().candidate


@dataclass(slots=True)
class SetExplorer:
    """Drives variations on worlds of `dev` that no other test uses; see `Explorer`.

    Attributes:
        trials: Drives candidates.
    """

    trials: Trials
    aim: str = "Raise its mean time score on worlds that nobody has seen yet."

    @property
    def recorder(self) -> Recorder:
        """See `Explorer`."""
        return self.trials.recorder

    def goes_on(self, asked: int) -> bool:
        """See `Explorer`."""
        del asked
        return self.trials.can_explore

    def made(self, k: int, source: str, folder: Path) -> Candidate:
        """See `Explorer`."""
        return Candidate(k, 0, source, folder)

    def explore(self, candidate: Candidate) -> Explored:
        """See `Explorer`."""
        report = self.trials.explore(candidate)
        if not report.count:
            refused = set_feedback(report).line
            return Explored(None, refused, failed=tuple(report.told), drove=False)
        return Explored(
            SetFigures.of(report),
            f"the goal reached in {report.successes} of {report.count} worlds",
            passed=report.successes == report.count,
            failed=tuple(report.causes),
        )

    def figures(self, member: Member[Candidate], best: Member[Candidate]) -> list[str]:
        """See `Explorer`."""
        report = _report(member.candidate)
        own = SetFigures.of(report)
        return [
            f"On {report.count} worlds, the same for all controllers:",
            f"- mean time score (success weighted by time): {own.time:.3f}; the best "
            f"controller so far has {best.figures.time:.3f}",
            f"- on the worst quarter of the worlds: {own.worst:.3f}",
            f"- mean path score (success weighted by length): {own.path:.3f}",
            f"- goals reached: {own.success:.3f}",
        ]

    def feedback(self, candidate: Candidate) -> str | None:
        """See `Explorer`."""
        report = _report(candidate)
        if report.successes == report.count:
            return None
        return set_feedback(report).text

    def picture(self, candidate: Candidate) -> FailurePicture | None:
        """See `Explorer`."""
        folder = candidate.exploring_folder
        return world_picture(self.trials.tasks, _report(candidate), folder)


def _report(candidate: Candidate) -> EpisodeReport:
    assert candidate.explored is not None
    return candidate.explored
