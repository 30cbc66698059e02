"""Progress of a campaign, kept as counts so that memory stays bounded."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from tdac_agent.campaign.perform import Outcome
from tdac_agent.campaign.plan import Cell, Plan, PlannedRun, Shard
from tdac_agent.executors.executor import Died, Ended, Reported, Started, Update
from tdac_agent.runs.run_record import FINISHED

RunEnded = Ended[PlannedRun, Outcome]
RunUpdate = Update[PlannedRun, Outcome]
REASONS = 50
"""Number of different reasons that are counted separately."""


@dataclass(slots=True)
class Tally:
    """Counts of the runs of one kind.

    Attributes:
        cell: The kind.
        planned: Number of planned runs.
        ended: Number of ended runs by status.
        tokens: Tokens of the runs that ended.
        cost: USD of the runs that ended; None once one is unknown.
    """

    cell: Cell
    planned: int = 0
    ended: Counter[str] = field(default_factory=Counter)
    tokens: int = 0
    cost: float | None = 0.0

    @property
    def finished(self) -> int:
        """Number of runs with nothing left to do."""
        return sum(self.ended[status] for status in FINISHED)

    @property
    def halted(self) -> int:
        """Number of ended runs that are not finished."""
        return self.ended.total() - self.finished

    def add(self, outcome: Outcome, sign: int = 1) -> None:
        """Counts a run; removes it if `sign` is -1."""
        self.ended[outcome.status] += sign
        self.tokens += sign * outcome.tokens
        unknown = self.cost is None or outcome.cost is None
        self.cost = None if unknown else self.cost + sign * outcome.cost  # type: ignore[operator]


@dataclass(slots=True)
class Doing:
    """A run under way, and its current activity."""

    planned: PlannedRun
    since: float
    activity: str = "beginning"


@dataclass(slots=True)
class CampaignProgress:
    """Progress of a campaign, or of a shard of it.

    Attributes:
        tallies: Counts by the folder of the kind.
        before: Number of runs that were finished when the command began.
        now: Number of runs finished since.
        doing: Runs under way, by name.
        problems: Why runs were not finished, and how often.
        deaths: Number of processes that died and were replaced.
        exhausted: Whether the budget is exhausted.
    """

    tallies: dict[str, Tally]
    before: int = 0
    now: int = 0
    doing: dict[str, Doing] = field(default_factory=dict)
    problems: Counter[str] = field(default_factory=Counter)
    deaths: int = 0
    exhausted: bool = False
    _began: float = field(default_factory=time.monotonic)

    @classmethod
    def of(cls, plan: Plan, shard: Shard) -> CampaignProgress:
        """The progress of a plan before its first run."""
        tallies = {cell.folder: Tally(cell) for cell in plan.cells}
        for planned in plan.all(shard):
            tallies[planned.cell.folder].planned += 1
        return cls({name: t for name, t in tallies.items() if t.planned})

    @property
    def planned(self) -> int:
        """Number of all runs."""
        return sum(tally.planned for tally in self.tallies.values())

    @property
    def finished(self) -> int:
        """Number of runs with nothing left to do."""
        return sum(tally.finished for tally in self.tallies.values())

    @property
    def tokens(self) -> int:
        """Tokens of the runs that ended."""
        return sum(tally.tokens for tally in self.tallies.values())

    @property
    def cost(self) -> float:
        """USD of the runs that ended, as far as known."""
        return sum(tally.cost or 0.0 for tally in self.tallies.values())

    @property
    def seconds(self) -> float:
        """Seconds since the command began."""
        return time.monotonic() - self._began

    @property
    def seconds_left(self) -> float | None:
        """Estimate from the runs so far; None before the first one."""
        left = self.planned - self.before - self.now
        return self.seconds / self.now * left if self.now else None

    def had(self, planned: PlannedRun, outcome: Outcome) -> None:
        """Counts a run that was finished when the command began."""
        self.before += 1
        self.tallies[planned.cell.folder].add(outcome)

    def take_back(self, planned: PlannedRun, outcome: Outcome) -> None:
        """Removes an unfinished run, which begins again."""
        self.tallies[planned.cell.folder].add(outcome, -1)
        self.problems -= Counter([_problem(outcome)])

    def update(self, update: RunUpdate) -> None:
        """Applies an update of an executor."""
        name = update.job.name
        match update:
            case Started():
                self.doing[name] = Doing(update.job, time.monotonic())
            case Reported() if name in self.doing:
                self.doing[name].activity = _activity(update.record)
            case Died():
                self.deaths += 1
                self.doing.pop(name, None)
            case Ended():
                self.doing.pop(name, None)
                self._ended(update)

    def _ended(self, update: RunEnded) -> None:
        outcome = update.outcome
        self.tallies[update.job.cell.folder].add(outcome)
        self.now += outcome.finished
        self.exhausted |= outcome.status == "budget"
        if not outcome.finished:
            problem = _problem(outcome)
            known = problem in self.problems or len(self.problems) < REASONS
            self.problems[problem if known else "others"] += 1


def _problem(outcome: Outcome) -> str:
    """Status and reason, with the run's name replaced."""
    reason = outcome.reason.replace(outcome.name, "RUN")
    return f"{outcome.status}: {reason}" if reason else outcome.status


def _activity(record: dict[str, Any]) -> str:
    at = f"k={record.get('k')} j={record.get('j')}"
    match record.get("event"):
        case "call.intent":
            verb = {"generate": "writing", "edit": "editing", "improve": "improving"}
            return f"{at} {verb.get(str(record.get('kind')), 'writing rules')}"
        case "call.fault":
            return f"{at} waiting after a {record.get('fault')} fault"
        case "verify.start":
            return f"{at} testing"
        case "drive.start":
            what = "worlds" if "worlds" in record else "episodes"
            return f"{at} {record.get('what')}: {record.get(what)} {what}"
        case "hidden.start":
            return "hidden worlds"
    return at
