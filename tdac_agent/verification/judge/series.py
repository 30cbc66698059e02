"""Drives one policy in one problem, in as many jobs as come, in the same processes.

A search asks for few episodes at a time. If each of its jobs had a worker, a worker
pool and zygotes of its own, starting them would take as long as driving. Each episode
still has a fresh child.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.deviated import DeviatedEpisodes
from tdac_agent.verification.judge.episode_job import (
    EpisodeJob,
    EpisodeRun,
    EpisodeSummary,
    drive_or_skip,
    judge_episodes,
)
from tdac_agent.verification.judge.in_order import drivers
from tdac_agent.verification.judge.worlds import Case, DeviatedWorlds


def judge_series(
    job: EpisodeJob, child_pool: ChildPool, further: Iterator[EpisodeJob]
) -> None:
    """Drives a series of jobs, whose worker pool stays.

    Args:
        job: The first job.
        child_pool: The child pool.
        further: The other ones, which come once the job before them has ended.
    """
    with ExitStack() as stack:
        series = Series(child_pool, stack)
        for each in itertools.chain([job], further):
            judge_episodes(each, child_pool, series.drive)


@dataclass(slots=True)
class Series:
    """Drives cases of one policy in one problem, in as many jobs as come.

    Attributes:
        child_pool: The child pool.
        stack: What ends the worker pool.
    """

    child_pool: ChildPool
    stack: ExitStack
    _first: EpisodeJob | None = None
    _drive: Callable[..., Iterator[EpisodeSummary]] | None = None

    def drive(self, job: EpisodeJob) -> Generator[EpisodeSummary]:
        """Yields the episodes of a job in the order of their cases."""
        assert isinstance(job.worlds, DeviatedWorlds)
        numbered = tuple(enumerate(job.worlds.cases))
        if self._drive is None or self._first is None:
            work = partial(_work_case, EpisodeRun.of(job, self.child_pool))
            pool = drivers(work, self.child_pool.close)
            self._first, self._drive = job, self.stack.enter_context(pool)
        assert _without_cases(job) == _without_cases(self._first)
        yield from self._drive(numbered, [], len(numbered) + 1)


def _without_cases(job: EpisodeJob) -> EpisodeJob:
    worlds = job.worlds.model_copy(update={"cases": ()})
    return job.model_copy(update={"worlds": worlds, "numbers": (), "out": Path()})


def _work_case(
    run: EpisodeRun, numbered: tuple[int, Case], skip: bool
) -> EpisodeSummary:
    """Drives or skips a case that the worker pool did not know before."""
    assert isinstance(run.worlds, DeviatedEpisodes)
    worlds = replace(run.worlds, cases=dict([numbered]))
    return drive_or_skip(replace(run, worlds=worlds), numbered[0], skip)
