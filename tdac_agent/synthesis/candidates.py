"""Candidates: controllers that models wrote, and how they did."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import fmean
from typing import NamedTuple

from tdac_agent.prompting.feedback import Feedback
from tdac_agent.runs.run_record import Attempt
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.verification.diagnosis.gap import Gap
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.judge.episode_row import EpisodeRow


class ToldEpisode(NamedTuple):
    """What may be told of an episode.

    Attributes:
        name: Its name, or the number of its world.
        outcome: How it ended.
        steps: Its steps.
        smallest_gap: Its smallest gap; None if it was not driven.
    """

    name: str
    outcome: str
    steps: int
    smallest_gap: Gap | None


@dataclass(frozen=True, slots=True)
class Result:
    """What came of the tests of a candidate so far.

    Attributes:
        passed: Whether it was tested, and nothing failed.
        rank: What decides which candidate is better, the main figure first; that is
            above 0 if the candidate works.
        failure: What the models are told; None if there is nothing to tell.
        summary: The result in one line, with figures.
        said: What the record says, unless the names of failed tests say it.
        unfit: Why it cannot be delivered; empty if it can.
        failed: What failed.
        seed: Seed of its jittered starts, if its tests had one.
        episodes: The episodes that may be told.
        confirmed: Result of its blind confirmation; None without one.
    """

    passed: bool
    rank: tuple[float, ...]
    failure: Feedback | None
    summary: str = ""
    said: str = ""
    unfit: str = ""
    failed: tuple[str, ...] = ()
    seed: int | None = None
    episodes: tuple[ToldEpisode, ...] = ()
    confirmed: bool | None = None

    @property
    def works(self) -> bool:
        """Whether it is good for something."""
        return self.rank[0] > 0.0

    def attempt(
        self, k: int, j: int, notes: tuple[str, ...], *, new: bool = True
    ) -> Attempt:
        """The record of an answer with this result; `new` is whether its code is."""
        return Attempt(
            k=k,
            j=j,
            valid=True,
            passed=self.passed or self.confirmed is False,
            failed_tests=self.failed,
            confirmed=self.confirmed,
            seed=self.seed,
            notes=notes,
            unchanged=not new,
        )


@dataclass(frozen=True, slots=True)
class Figures:
    """How a candidate drove in the episodes of a search; higher is better.

    Attributes:
        by_name: All figures.
        ranked: Those that decide which member is best, the first one first, with what
            they are called in texts.
    """

    by_name: Mapping[str, float]
    ranked: Mapping[str, str]

    @property
    def time(self) -> float:
        """Mean time score."""
        return self.by_name["time"]

    @property
    def rank(self) -> tuple[float, ...]:
        """The figures that decide."""
        return tuple(self.by_name[name] for name in self.ranked)


@dataclass(frozen=True, slots=True)
class Explored:
    """What came of a candidate in the episodes of a search.

    Attributes:
        figures: Its figures; None if it does not become a member of the archive.
        said: The result in one line.
        passed: Whether nothing failed.
        failed: What failed.
        drove: Whether it drove at all.
        seed: Seed of its jittered starts, if its tests had one.
        episodes: Number of episodes.
        feedback: How it failed in them; None if it never did.
    """

    figures: Figures | None
    said: str
    passed: bool = False
    failed: tuple[str, ...] = ()
    drove: bool = True
    seed: int | None = None
    episodes: int = 0
    feedback: str | None = None


@dataclass(slots=True)
class Candidate:
    """A controller that a model wrote.

    Attributes:
        k: Its iteration.
        j: Its edit.
        source: Its source.
        folder: Its folder.
        report: The report of a suite; None before it was tested by one.
        confirmation: The report of its blind confirmation, if there was one.
        feedback: Reports on feedback worlds, in order.
        validation: Its episodes on validation worlds.
        pool: Its episodes in the pool of a race.
        pool_folders: Folders of their reports.
        explored: What came of it in a race, if it took part in one.
    """

    k: int
    j: int
    source: str
    folder: Path
    report: Report | None = None
    confirmation: EpisodeReport | None = None
    feedback: list[EpisodeReport] = field(default_factory=list)
    validation: list[EpisodeRow] = field(default_factory=list)
    pool: list[EpisodeRow] = field(default_factory=list)
    pool_folders: list[Path] = field(default_factory=list)
    explored: Explored | None = None

    @property
    def name(self) -> str:
        """Its number in texts for models."""
        return f"{self.k}.{self.j}" if self.j else str(self.k)

    @property
    def place(self) -> str:
        """Its name in texts."""
        return f"k={self.k} j={self.j}"

    @property
    def raw(self) -> bytes:
        """The bytes of its source."""
        return raw(self.source)

    @property
    def sha256(self) -> str:
        """Hash of its source."""
        return sha256_of(self.raw)

    @property
    def drives(self) -> bool:
        """Whether it passed the static and contract tests, so that it drove."""
        return any(report.count for report in self.feedback)

    @property
    def refused(self) -> bool:
        """Whether it failed a suite, so that it does not drive."""
        return self.report is not None and not self.report.passed

    @property
    def first_failure(self) -> EpisodeReport | None:
        """The report that ended its tests; None if it has not failed so far."""
        failed = (r for r in self.feedback if not r.count or r.successes < r.count)
        return next(failed, None)

    @property
    def feedback_score(self) -> float:
        """Mean time score on feedback worlds; 0 if it did not drive."""
        return _mean([each for report in self.feedback for each in report.episodes])

    @property
    def pool_score(self) -> float:
        """Mean time score in the pool of a race; 0 if it has not driven there."""
        return _mean(self.pool)

    @property
    def score(self) -> float:
        """Mean time score on validation worlds; 0 if it has not driven on any."""
        return _mean(self.validation)


def raw(source: str) -> bytes:
    """The bytes of a controller's source."""
    return source.encode("utf-8", "surrogatepass")


def _mean(episodes: Sequence[EpisodeRow]) -> float:
    return fmean(each.time_score for each in episodes) if episodes else 0.0
