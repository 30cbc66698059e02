"""The interface of executors, which execute jobs in other processes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

MOST_DEATHS = 3
"""Number of process deaths after which a job is given up."""


class ExecutorJob(Protocol):
    """Work for one process; if that dies, another one goes on with it."""

    @property
    def name(self) -> str:
        """Its name, which no other job has."""

    def to_json(self) -> str:
        """The job on one line, for another process."""


J = TypeVar("J", bound=ExecutorJob)
O = TypeVar("O")  # noqa: E741 - the outcome


@dataclass(frozen=True, slots=True)
class Work(Generic[O]):
    """What all jobs have in common.

    Attributes:
        module: Module with the function `perform_job(job, terms, judge, tell)`: it gets
            the line of a job, `terms`, a warm judge, and a function to report a record
            with; it returns the outcome as JSON.
        terms: Settings of all jobs, as JSON.
        workers: Number of jobs at a time.
        folder: Folder for the error log.
        read: Makes an outcome from its JSON.
        failed: Makes the outcome of a job, by its name, that could not be executed, for
            a reason.
    """

    module: str
    terms: dict[str, Any]
    workers: int
    folder: Path
    read: Callable[[dict[str, Any]], O]
    failed: Callable[[str, str], O]


@dataclass(frozen=True, slots=True)
class Started(Generic[J]):
    """A job has begun."""

    job: J


@dataclass(frozen=True, slots=True)
class Reported(Generic[J]):
    """A job has reported a record."""

    job: J
    record: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Ended(Generic[J, O]):
    """A job has ended, well or not."""

    job: J
    outcome: O


@dataclass(frozen=True, slots=True)
class Died(Generic[J]):
    """The process of a job has died; another process will go on with the job."""

    job: J
    reason: str


Update = Started[J] | Reported[J] | Ended[J, O] | Died[J]
Next = Callable[[], J | None]
"""Returns the next job, or None; None is final if no job is under way."""
Executor = Callable[[Work[O], Next[J]], Generator[Update[J, O]]]


@dataclass(slots=True)
class RetryQueue(Generic[J, O]):
    """Hands out jobs; those whose process has died come before all others.

    Attributes:
        work: What the jobs have in common.
        then: Source of the other jobs.
    """

    work: Work[O]
    then: Next[J]
    _waiting: list[J] = field(default_factory=list)
    _deaths: Counter[str] = field(default_factory=Counter)

    def next(self) -> J | None:
        """The next job."""
        return self._waiting.pop() if self._waiting else self.then()

    def died(self, job: J, reason: str) -> Update[J, O]:
        """Queues a job whose process died, or ends it after `MOST_DEATHS` deaths."""
        self._deaths[job.name] += 1
        if self._deaths[job.name] < MOST_DEATHS:
            self._waiting.append(job)
            return Died(job, reason)
        message = f"its process died {MOST_DEATHS} times; last reason: {reason}"
        return Ended(job, self.work.failed(job.name, message))
