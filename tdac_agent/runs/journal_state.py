"""What earlier processes of a run have recorded in its journal."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from pydantic import TypeAdapter, ValidationError

from tdac_agent.models.budget import Amount
from tdac_agent.models.provider import Provider, Reply, Request, served_at
from tdac_agent.storage.hashes import sha256_of_json
from tdac_agent.storage.journal import JournalRecord

KEY_SCHEMA = 1
# Steps that a resumed run repeats, and does not record again.
REPEATED = (
    *("prove.start", "prove.end", "verify.start", "verify.end"),
    *("call.unused", "rules", "drive.start", "drive.end"),
    *("select.end", "hidden.start", "hidden.end"),
)
_REPLY = TypeAdapter(Reply)
_AMOUNT = TypeAdapter(Amount)
_REPORTED = (
    *("stop", "tokens_in", "tokens_out", "tokens_cached", "tokens_written"),
    *("model", "request_id", "notes"),
)


def call_key(model: Provider, request: Request) -> str:
    """Hash of everything that an answer depends on, including the sample's indices."""
    facts = {
        "schema": KEY_SCHEMA,
        "model": model.name,
        "served_at": served_at(model),
        "kind": request.kind,
        "prompt": request.prompt,
        "max_tokens": request.max_tokens,
        "sample": request.sample,
        "turn": request.turn,
    }
    return sha256_of_json(facts)


def reply_of(record: JournalRecord, text: str) -> Reply | None:
    """The answer of a record `call.reply`; None if the record is damaged."""
    reported = {name: record[name] for name in _REPORTED if name in record}
    try:
        return _REPLY.validate_python({"text": text, **reported})
    except ValidationError:
        return None


@dataclass(slots=True)
class JournalState:
    """Calls and steps on record.

    Attributes:
        replies: Answer records by key.
        taken: What each call took or may have taken of the budget, by `KEY/ATTEMPT`.
        lost: Calls whose answer was lost, but may have been billed.
        open: Calls with neither an answer nor a fault on record.
        attempts: Number of calls by key.
        steps: Number of records of each step that no repetition has used up yet.
        started: Whether all files of a new run were written.
        seconds: Duration of the run so far.
    """

    replies: dict[str, JournalRecord] = field(default_factory=dict)
    taken: dict[str, Amount] = field(default_factory=dict)
    lost: set[str] = field(default_factory=set)
    open: set[str] = field(default_factory=set)
    attempts: Counter[str] = field(default_factory=Counter)
    steps: Counter[str] = field(default_factory=Counter)
    started: bool = False
    seconds: float = 0.0

    @property
    def proven(self) -> bool:
        """Whether the check of the suite is on record."""
        return any(step.startswith('["prove.end"') for step in self.steps)

    @property
    def lost_usd(self) -> float:
        """Maximum cost of the lost answers, USD."""
        return sum(self.taken[call].usd for call in self.lost)

    @property
    def unanswered(self) -> int:
        """Number of questions that were asked and have no answer."""
        keys = {call.rpartition("/")[0] for call in self.open}
        return len(keys - self.replies.keys())

    def next_call(self, key: str) -> str:
        """Counts a call for a key, and returns its name."""
        self.attempts[key] += 1
        return f"{key}/{self.attempts[key]}"

    def has_step(self, event: str, facts: dict[str, Any]) -> bool:
        """Whether a step is on record; uses up one record of it."""
        step = _step(event, facts)
        known = self.steps[step] > 0
        self.steps[step] -= known
        return known


def read_past(records: Iterable[JournalRecord]) -> JournalState:
    """Reads a journal; ignores damaged records."""
    past = JournalState()
    for record in records:
        event = record.get("event")
        past.seconds = max(past.seconds, _number(record.get("seconds")))
        key = str(record.get("key"))
        call = f"{key}/{past.attempts[key]}"
        if event == "run.start":
            past.started = True
        elif event == "call.intent":
            call = past.next_call(key)
            past.taken[call] = _amount(record.get("reserved"))
            past.open.add(call)
        elif event == "call.fault" and call in past.open:
            past.open.discard(call)
            if record.get("billed"):
                past.lost.add(call)
            else:
                past.taken[call] = Amount()
        elif event == "call.reply" and call in past.open:
            past.open.discard(call)
            past.taken[call] = _amount(record.get("spent"))
            past.replies[key] = record
        elif event in REPEATED:
            facts = {k: v for k, v in record.items() if k not in {"event", "seconds"}}
            past.steps[_step(event, facts)] += 1
    past.lost |= past.open
    return past


def _step(event: str, facts: dict[str, Any]) -> str:
    return json.dumps([event, facts], sort_keys=True)


def _amount(value: object) -> Amount:
    try:
        return _AMOUNT.validate_python(value)
    except ValidationError:
        return Amount()


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else 0.0
