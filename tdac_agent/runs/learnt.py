"""Which rules were in force when a candidate was written, as the journal tells it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from pydantic import ValidationError

from tdac_agent.prompting.rules import RepairRule
from tdac_agent.storage.journal import JournalRecord

At = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Learnt:
    """The rules of the prompt around one candidate.

    Attributes:
        rules: In force when it was written, oldest first.
        fresh: Ids of those that are new since the iteration before.
        changes: What changed the rules after it failed, a line each.
    """

    rules: tuple[RepairRule, ...] = ()
    fresh: frozenset[str] = frozenset()
    changes: tuple[str, ...] = ()


def what_was_learnt(journal: Iterable[JournalRecord]) -> Mapping[At, Learnt]:
    """The rules around each candidate (k, j); records that make no sense are skipped.

    Rules change only between iterations, so that those of k hold for all of its j.
    """
    found: dict[At, Learnt] = {}
    rules: tuple[RepairRule, ...] = ()
    last: At | None = None
    for record in journal:
        at = _place(record)
        if at is not None and at not in found:
            before = found[last].rules if last in found else ()
            known = {rule.id for rule in before}
            fresh = frozenset(rule.id for rule in rules if rule.id not in known)
            found[at], last = Learnt(rules, fresh), at
        if record.get("event") == "rules":
            rules = _rules(record.get("rules"))
            notes = record.get("notes")
            if last is not None and isinstance(notes, list):
                changes = (*found[last].changes, *map(str, notes))
                found[last] = replace(found[last], changes=changes)
    return found


def _place(record: JournalRecord) -> At | None:
    """K and j of a record that is about writing or testing a candidate."""
    k, j = record.get("k"), record.get("j")
    if record.get("kind") == "summarise" or not isinstance(record.get("event"), str):
        return None
    return (k, j) if isinstance(k, int) and isinstance(j, int) else None


def _rules(found: object) -> tuple[RepairRule, ...]:
    rules = []
    for one in found if isinstance(found, list) else ():
        try:
            rules.append(RepairRule.model_validate(one))
        except ValidationError:
            continue
    return tuple(rules)
