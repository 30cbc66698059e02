"""The interface of executors, which execute the runs of a campaign."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from typing import Any

from tdac_agent.campaign.perform import Outcome, Terms
from tdac_agent.campaign.plan import PlannedRun

MOST_DEATHS = 3
"""Number of process deaths after which a run is given up."""


@dataclass(frozen=True, slots=True)
class Begun:
    """A run has begun."""

    planned: PlannedRun


@dataclass(frozen=True, slots=True)
class RecordReported:
    """A run has reported a journal record."""

    planned: PlannedRun
    record: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Ended:
    """A run has ended, with any status."""

    planned: PlannedRun
    outcome: Outcome


@dataclass(frozen=True, slots=True)
class Died:
    """The process of a run has died; another process will continue the run."""

    planned: PlannedRun
    reason: str


Update = Begun | RecordReported | Ended | Died
Next = Callable[[], PlannedRun | None]
"""Returns the next run, or None; None is final if no run is under way."""
Executor = Callable[[Terms, Next], Generator[Update]]


@dataclass(slots=True)
class RetryQueue:
    """Hands out runs; those whose process has died come before all others.

    Attributes:
        then: Source of the other runs.
    """

    then: Next
    _waiting: list[PlannedRun] = field(default_factory=list)
    _deaths: Counter[str] = field(default_factory=Counter)

    def next(self) -> PlannedRun | None:
        """The next run."""
        return self._waiting.pop() if self._waiting else self.then()

    def died(self, planned: PlannedRun, reason: str) -> Update:
        """Queues a run whose process died, or ends it after `MOST_DEATHS` deaths."""
        self._deaths[planned.name] += 1
        if self._deaths[planned.name] < MOST_DEATHS:
            self._waiting.append(planned)
            return Died(planned, reason)
        message = f"its process died {MOST_DEATHS} times; last reason: {reason}"
        return Ended(planned, Outcome(planned.name, "error", message))
