"""Tests of candidates on worlds of `dev`, within the budget of episodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import fmean

from pydantic import ValidationError

from tdac_agent.runs.recorder import Recorder
from tdac_agent.storage.hashes import number_of, sha256_of
from tdac_agent.synthesis.workload import Shares
from tdac_agent.tasks.provenance import versions
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs.core.intake import RECORD_BYTES, parse_json, read_file
from tdac_envs.ladder.task_sets import TaskSet

BLOCKS = 2**30
"""Feedback worlds have smaller numbers than this; each other purpose has as many."""
PURPOSES = ("feedback", "validation", "improve", "comparison")
"""What worlds are used for, in the order of their numbers."""
MOST_EPISODES = 100_000
SET_REPORT = "episodes.json"


@dataclass(slots=True)
class Candidate:
    """A controller that a model wrote, and how it drove.

    Attributes:
        k: Its iteration.
        j: Its edit.
        source: Its source.
        folder: Its folder.
        feedback: Reports of its tests, in order.
        validation: Its episodes on validation worlds.
        explored: Its report on the worlds for variations, if it was to drive there.
    """

    k: int
    j: int
    source: str
    folder: Path
    feedback: list[EpisodeReport] = field(default_factory=list)
    validation: list[EpisodeRow] = field(default_factory=list)
    explored: EpisodeReport | None = None

    @property
    def drives(self) -> bool:
        """Whether it passed the static and contract tests, so that it drove."""
        return any(report.count for report in self.feedback)

    @property
    def explored_score(self) -> float | None:
        """Mean time score on the worlds for variations; None if it did not drive."""
        report = self.explored
        return _mean(report.episodes) if report and report.episodes else None

    @property
    def first_failure(self) -> EpisodeReport | None:
        """The report that ended its tests; None if it has not failed so far."""
        failed = (r for r in self.feedback if not r.count or r.successes < r.count)
        return next(failed, None)

    @property
    def failure_folder(self) -> Path:
        """Folder of the report that ended its tests: the last one."""
        return self.feedback_folder(len(self.feedback))

    @property
    def exploring_folder(self) -> Path:
        """Folder of the report on the worlds for variations."""
        return self.folder / "improve-1"

    def feedback_folder(self, number: int) -> Path:
        """Folder of the report on a test, from 1."""
        return self.folder / f"feedback-{number}"

    @property
    def feedback_score(self) -> float:
        """Mean time score on feedback worlds; 0 if it did not drive."""
        return _mean([each for report in self.feedback for each in report.episodes])

    @property
    def score(self) -> float:
        """Mean time score on validation worlds; 0 if it has not driven on any."""
        return _mean(self.validation)


def _mean(episodes: Sequence[EpisodeRow]) -> float:
    return fmean(each.time_score for each in episodes) if episodes else 0.0


def first_world(seed: int, index: int) -> int:
    """Number of the first feedback world of a run, below `BLOCKS` - `MOST_EPISODES`."""
    return number_of(f"dev block|{seed}|{index}") % (BLOCKS - MOST_EPISODES)


@dataclass(slots=True)
class Trials:
    """Drives candidates, and counts the episodes.

    Attributes:
        tasks: The task set.
        recorder: Records the run.
        judge: A warm judge.
        tier: Sandbox tier.
        block: Most episodes of a test.
        shares: How the episodes are divided.
        feedback_left: Episodes that are left for tests.
        validation_left: Episodes that are left for the selection.
        explore_left: Episodes that are left for variations.
    """

    tasks: TaskSet
    recorder: Recorder
    judge: WarmJudge
    tier: str
    block: int
    shares: Shares
    feedback_left: int = field(init=False)
    validation_left: int = field(init=False)
    explore_left: int = field(init=False)
    feedback_used: int = 0
    validation_used: int = 0
    explore_used: int = 0
    comparison_used: int = 0

    def __post_init__(self) -> None:
        self.feedback_left = self.shares.feedback
        self.validation_left = self.shares.validation
        self.explore_left = self.shares.explore

    @property
    def can_explore(self) -> bool:
        """Whether there are episodes for another variation."""
        return self.explore_left >= self.shares.block

    @property
    def first(self) -> int:
        """Number of the first feedback world."""
        run = self.recorder.run
        assert run.seed is not None
        return first_world(run.seed, run.index)

    def test(self, candidate: Candidate) -> EpisodeReport | None:
        """The first report with a failure; None if the episodes end without one.

        A candidate that reaches all goals goes on with the next worlds.
        """
        while self.feedback_left and candidate.first_failure is None:
            self.drive_next(candidate)
        return candidate.first_failure

    def test_alike(self, candidates: Sequence[Candidate]) -> None:
        """Drives candidates on the same next worlds, once each.

        If the episodes do not suffice for all, the first ones drive on one world.
        """
        count = min(self.block, max(1, self.feedback_left // len(candidates)))
        first = self.first + self.feedback_used
        for candidate in candidates:
            if self.feedback_left >= count:
                self._give_feedback(candidate, first, count)

    def drive_next(self, candidate: Candidate) -> EpisodeReport:
        """Drives on the next block of feedback worlds; there must be some left."""
        count = min(self.block, self.feedback_left)
        first = self.first + self.feedback_used
        return self._give_feedback(candidate, first, count)

    def _give_feedback(
        self, candidate: Candidate, first: int, count: int
    ) -> EpisodeReport:
        out = candidate.feedback_folder(len(candidate.feedback) + 1)
        report = self._drive(candidate, first, count, out)
        candidate.feedback.append(report)
        self.feedback_used += report.count
        self.feedback_left -= report.count
        return report

    def validate(self, candidate: Candidate, count: int) -> None:
        """Drives on the next `count` validation worlds of this candidate."""
        done = len(candidate.validation)
        first = self._first_for("validation") + done
        out = candidate.folder / f"validation-{done + 1}"
        report = self._drive(candidate, first, count, out)
        candidate.validation.extend(report.episodes)
        self.validation_used += report.count
        self.validation_left -= report.count

    def explore(self, candidate: Candidate) -> EpisodeReport:
        """Drives on the worlds for variations, the same ones for each candidate."""
        first, count = self._first_for("improve"), self.shares.block
        report = self._drive(candidate, first, count, candidate.exploring_folder)
        candidate.explored = report
        self.explore_used += report.count
        self.explore_left -= report.count
        return report

    def compare(self, candidate: Candidate) -> EpisodeReport:
        """Drives on the worlds of the comparison at the end, which decide nothing."""
        first, count = self._first_for("comparison"), self.shares.comparison
        out = candidate.folder / "comparison-1"
        report = self._drive(candidate, first, count, out)
        self.comparison_used += report.count
        return report

    def _first_for(self, purpose: str) -> int:
        """Number of the first world for a purpose."""
        return PURPOSES.index(purpose) * BLOCKS + self.first

    def _drive(
        self, candidate: Candidate, first: int, count: int, out: Path
    ) -> EpisodeReport:
        """Drives on worlds of `dev`; a report on record is reused."""
        k, j = candidate.k, candidate.j
        about = {"k": k, "j": j, "what": out.name.partition("-")[0], "worlds": count}
        self.recorder.event("drive.start", **about)
        source = candidate.source.encode("utf-8", "surrogatepass")
        report = None
        if self.recorder.vouches(out / SET_REPORT):
            report = kept_report(out, self.tasks, source, first, count)
        if report is None:
            report = verify_episodes(
                source,
                self.tasks,
                count,
                split="dev",
                first=first,
                tier=self.tier,
                out=out,
                judge=self.judge,
                watch=lambda done, reached: self.recorder.tell(
                    {"event": "drive.step", **about, "done": done, "reached": reached}
                ),
            )
            self.recorder.vouch(out / SET_REPORT)
        self.recorder.event(
            "drive.end", **about, reached=report.successes, driven=report.count
        )
        return report


def kept_report(
    folder: Path, tasks: TaskSet, source: bytes, first: int, count: int
) -> EpisodeReport | None:
    """The report in a folder if it is about this controller and these worlds."""
    try:
        content = parse_json(read_file(folder / SET_REPORT, RECORD_BYTES))
        report = EpisodeReport.model_validate(content)
    except (OSError, ValueError, ValidationError):
        return None
    about = report.provenance
    facts = (about.sha256, about.split, about.controller_sha256, about.versions)
    wanted = (tasks.sha256, "dev", sha256_of(source), versions())
    numbers = [episode.index for episode in report.episodes]
    # After a failed static test, there are no episodes.
    complete = numbers in ([], list(range(first, first + count)))
    return report if facts == wanted and complete else None
