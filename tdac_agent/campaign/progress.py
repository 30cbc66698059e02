"""How far a campaign is: counts, not runs, so that it stays small."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from tdac_agent.campaign.executor import Begun, Died, Ended, Told, Update
from tdac_agent.campaign.perform import Outcome
from tdac_agent.campaign.plan import Cell, Plan, PlannedRun, Shard

REASONS = 50
"""Different reasons that are told apart."""


@dataclass(slots=True)
class Tally:
    """Of the runs of one kind.

    Attributes:
        cell: The kind.
        planned: How many there are to be.
        ended: How many ended how.
        tokens: Of those that ended.
        cost: USD of those that ended; None once one is unknown.
    """

    cell: Cell
    planned: int = 0
    ended: Counter[str] = field(default_factory=Counter)
    tokens: int = 0
    cost: float | None = 0.0

    @property
    def finished(self) -> int:
        """Runs with nothing left to do."""
        return self.ended["verified"] + self.ended["not verified"]

    @property
    def halted(self) -> int:
        """Runs that did not come to their end."""
        return self.ended.total() - self.finished

    def add(self, outcome: Outcome, sign: int = 1) -> None:
        """Counts a run, or takes it out again."""
        self.ended[outcome.status] += sign
        self.tokens += sign * outcome.tokens
        unknown = self.cost is None or outcome.cost is None
        self.cost = None if unknown else self.cost + sign * outcome.cost  # type: ignore[operator]


@dataclass(slots=True)
class Doing:
    """What a run under way is at."""

    planned: PlannedRun
    since: float
    said: str = "beginning"


@dataclass(slots=True)
class Progress:
    """Of a campaign, or of a shard of it.

    Attributes:
        tallies: By the folder of the kind.
        before: Runs that had come to their end when it began.
        now: Runs that have since.
        doing: What is under way, by the run's name.
        problems: Why runs did not come to their end, and how often.
        deaths: Processes that died and were replaced.
        exhausted: Whether the budget is.
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
    def of(cls, plan: Plan, shard: Shard) -> Progress:
        """Nothing done yet."""
        tallies = {cell.folder: Tally(cell) for cell in plan.cells}
        for planned in plan.all(shard):
            tallies[planned.cell.folder].planned += 1
        return cls({name: t for name, t in tallies.items() if t.planned})

    @property
    def planned(self) -> int:
        """Runs in all."""
        return sum(tally.planned for tally in self.tallies.values())

    @property
    def finished(self) -> int:
        """Runs with nothing left to do."""
        return sum(tally.finished for tally in self.tallies.values())

    @property
    def tokens(self) -> int:
        """Of the runs that ended."""
        return sum(tally.tokens for tally in self.tallies.values())

    @property
    def cost(self) -> float:
        """USD of the runs that ended, as far as it is known."""
        return sum(tally.cost or 0.0 for tally in self.tallies.values())

    @property
    def seconds(self) -> float:
        """Since it began."""
        return time.monotonic() - self._began

    @property
    def seconds_left(self) -> float | None:
        """By the runs so far; None before the first one."""
        left = self.planned - self.before - self.now
        return self.seconds / self.now * left if self.now else None

    def had(self, planned: PlannedRun, outcome: Outcome) -> None:
        """Counts a run that had come to its end before."""
        self.before += 1
        self.tallies[planned.cell.folder].add(outcome)

    def take_back(self, planned: PlannedRun, outcome: Outcome) -> None:
        """A run that had been halted is begun again."""
        self.tallies[planned.cell.folder].add(outcome, -1)
        self.problems -= Counter([_problem(outcome)])

    def update(self, update: Update) -> None:
        """Takes in what an executor says."""
        name = update.planned.name
        match update:
            case Begun():
                self.doing[name] = Doing(update.planned, time.monotonic())
            case Told() if name in self.doing:
                self.doing[name].said = _said(update.record)
            case Died():
                self.deaths += 1
                self.doing.pop(name, None)
            case Ended():
                self.doing.pop(name, None)
                self._ended(update)

    def _ended(self, update: Ended) -> None:
        outcome = update.outcome
        self.tallies[update.planned.cell.folder].add(outcome)
        self.now += outcome.finished
        self.exhausted |= outcome.status == "budget"
        if not outcome.finished:
            problem = _problem(outcome)
            known = problem in self.problems or len(self.problems) < REASONS
            self.problems[problem if known else "others"] += 1


def _problem(outcome: Outcome) -> str:
    """Status and reason, without what is of this run alone."""
    reason = outcome.reason.replace(outcome.name, "RUN")
    return f"{outcome.status}: {reason}" if reason else outcome.status


def _said(record: dict[str, Any]) -> str:
    at = f"k={record.get('k')} j={record.get('j')}"
    match record.get("event"):
        case "call.intent":
            verb = {"generate": "writing", "edit": "editing"}
            return f"{at} {verb.get(str(record.get('kind')), 'learning')}"
        case "call.fault":
            return f"{at} waiting: {record.get('fault')} fault"
        case "verify.start":
            return f"{at} testing"
    return at
