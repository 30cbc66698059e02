"""What an executor is: where the runs of a campaign are made."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from typing import Any

from tdac_agent.campaign.perform import Outcome, Terms
from tdac_agent.campaign.plan import PlannedRun

MOST_DEATHS = 3
"""Of the processes that a run was in, before it is given up."""


@dataclass(frozen=True, slots=True)
class Begun:
    """A run is under way."""

    planned: PlannedRun


@dataclass(frozen=True, slots=True)
class Told:
    """A run has told a record of its journal."""

    planned: PlannedRun
    record: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Ended:
    """A run has ended, one way or another."""

    planned: PlannedRun
    outcome: Outcome


@dataclass(frozen=True, slots=True)
class Died:
    """The process of a run has died; the run goes on in another one.

    Attributes:
        planned: The run.
        reason: Of the death.
    """

    planned: PlannedRun
    reason: str


Update = Begun | Told | Ended | Died
Next = Callable[[], PlannedRun | None]
"""The next run; None where there is none for now: for good, if nothing is under way."""
Executor = Callable[[Terms, Next], Generator[Update]]


@dataclass(slots=True)
class Bereaved:
    """Runs whose processes have died; they come before all others.

    Attributes:
        then: Where further runs come from.
    """

    then: Next
    _waiting: list[PlannedRun] = field(default_factory=list)
    _deaths: Counter[str] = field(default_factory=Counter)

    def next(self) -> PlannedRun | None:
        """The next run."""
        return self._waiting.pop() if self._waiting else self.then()

    def died(self, planned: PlannedRun, reason: str) -> Update:
        """What becomes of a run whose process has died."""
        self._deaths[planned.name] += 1
        if self._deaths[planned.name] < MOST_DEATHS:
            self._waiting.append(planned)
            return Died(planned, reason)
        told = f"its process died {MOST_DEATHS} times, at last: {reason}"
        return Ended(planned, Outcome(planned.name, "error", told))
