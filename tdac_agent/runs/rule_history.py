"""Which rules were in force when a candidate was written, according to the journal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from pydantic import ValidationError

from tdac_agent.prompting.rules import RepairRule
from tdac_agent.storage.journal import JournalRecord

At = tuple[int, int]


@dataclass(frozen=True, slots=True)
class RuleChanges:
    """The rules of the prompt before and after one candidate.

    Attributes:
        rules: Rules in force when it was written, oldest first.
        fresh: Ids of the rules that the previous candidate did not have.
        changes: Changes to the rules after it failed, one line each.
    """

    rules: tuple[RepairRule, ...] = ()
    fresh: frozenset[str] = frozenset()
    changes: tuple[str, ...] = ()


def rule_changes(journal: Iterable[JournalRecord]) -> Mapping[At, RuleChanges]:
    """The rules before and after each candidate (k, j); skips malformed records.

    Rules change only between iterations, so that all j of one k have the same rules.
    """
    found: dict[At, RuleChanges] = {}
    rules: tuple[RepairRule, ...] = ()
    last: At | None = None
    for record in journal:
        at = _place(record)
        if at is not None and at not in found:
            before = found[last].rules if last in found else ()
            known = {rule.id for rule in before}
            fresh = frozenset(rule.id for rule in rules if rule.id not in known)
            found[at], last = RuleChanges(rules, fresh), at
        if record.get("event") == "rules":
            rules = _rules(record.get("rules"))
            notes = record.get("notes")
            if last is not None and isinstance(notes, list):
                changes = (*found[last].changes, *map(str, notes))
                found[last] = replace(found[last], changes=changes)
    return found


def _place(record: JournalRecord) -> At | None:
    """(k, j) of a record about writing or testing a candidate, else None."""
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
